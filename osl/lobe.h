/* The glint lobe of one shading point: closures of the selected elements, and the remainder. The remainder is one
 * normal drawn at random from the footprint, the normal at the hit point, unless that normal is among the selected
 * elements: it stands for all elements that are not selected. */

/* The bilinear patch around the hit point; Linear only. */
Patch hit_patch(output Map map, Hit hit)
{
  return map_patch(map, wrapped((int)hit.i, map.width), wrapped((int)hit.j, map.height));
}

/* The map at UV coordinates, which are reduced to one repeat first, because large UVs would lose precision. */
Hit map_hit(output Map map, point uv)
{
  Hit hit;
  hit.u = (uv[0] - floor(uv[0])) * map.width - (map.is_linear ? 0.5 : 0.0);
  hit.v = (uv[1] - floor(uv[1])) * map.height - (map.is_linear ? 0.5 : 0.0);
  hit.i = floor(hit.u);
  hit.j = floor(hit.v);
  if (!map.is_linear) {
    hit.unscaled = unscaled_normal(map, wrapped((int)hit.i, map.width), wrapped((int)hit.j, map.height));
  }
  else if (hit.i >= 0 && hit.j >= 0 && hit.i + 1 < map.width && hit.j + 1 < map.height) {
    map.fetches += 1;
    hit.unscaled = table_between(map.table, map.inverse_padded_width, map.inverse_padded_height, hit.u + 0.5,
                                 hit.v + 0.5);
  }
  else {
    /* Interpolate across the map's edge from four texels, because the padded table continues with other values. */
    Map plain = map;
    plain.strength = 1.0;
    plain.kept = 0;
    hit.unscaled = patch_normal(hit_patch(plain, hit), hit.u - hit.i, hit.v - hit.j);
    map.fetches = plain.fetches;
  }
  hit.n = strengthened(hit.unscaled, map.strength);
  return hit;
}

/* Closure of a footprint smaller than a texel (Linear): slopes vary linearly within it, so one closure is enough. */
closure color patch_closure(string distribution, float alpha, Patch patch, Hit hit, NormalFrame frame,
                            Footprint footprint, HalfVector hint)
{
  HalfVector around = hint;
  around.h = normalize(frame_to_world(frame, hit.n));
  slope_axes(frame, around);
  PatchSlopes slopes;
  patch_slopes(around, patch, hit.i - hit.u, hit.j - hit.v, slopes);
  float deviation = sqrt(KERNEL_VARIANCE);
  PatchPart part = { hit.u - hit.i, hit.v - hit.j, deviation * footprint.ux, deviation * footprint.vx,
                     deviation * footprint.uy, deviation * footprint.vy };
  SlopeMoments m = { 0.0, 0.0, 0.0, 0.0, 0.0 };
  patch_covariance(slopes, part, m);
  return glint_closure(distribution, around, alpha, m);
}

/* Sum of the closures of a selection and of the remainder. total: the sum to which the selection's weights are
 * relative. */
closure color selection_closures(string distribution, float alpha, HalfVector hints[HINT_COUNT], Selection s, float total,
                                 float seed_1, float seed_2, closure color remainder, output int closures)
{
  closure color sum = remainder;
  for (int k = 0; k < min(s.count, s.limit); ++k) {
    float w = total > 0.0 ? roulette(s.weight[k] * s.sum[k] / (s.importance[k] * total), seed_1, seed_2, k) : 0.0;
    if (w > 0.0) {
      HalfVector hint = hints[s.hint[k]];
      SlopeMoments m = { s.p1[k], s.p2[k], s.c11[k], s.c12[k], s.c22[k] };
      if (s.is_merged) {
        w *= merged_reflection(hint, alpha, m);
      }
      /* Add in this order: Cycles flattens sum + x only 16 deep and drops the rest. */
      sum = w * glint_closure(distribution, hint, alpha, m) + sum;
      closures += 1;
    }
  }
  return sum;
}

/* By how much to make a footprint smaller, 0..1: its turn is limited to LARGEST_FOOTPRINT_TURN, and to SPARE_TURN where
 * it has more than LARGEST_VISIT elements. */
float footprint_scale(HalfVector hints[HINT_COUNT], int hint_count, float area, float samples)
{
  float scale = 1.0;
  float spare = 1.0;
  for (int k = 0; k < hint_count; ++k) {
    HalfVector hint = hints[k];
    /* A little less than counts may turn, whatever rounding does. */
    float widest = (samples > 1.0 ? SPARE_TURN : 0.999 * FAR_TURN) * hint.radius;
    scale = min(scale, LARGEST_FOOTPRINT_TURN / max(hint.turn, LARGEST_FOOTPRINT_TURN));
    spare = min(spare, widest / max(hint.turn, widest));
  }
  return area > LARGEST_VISIT ? min(scale, max(spare, sqrt(LARGEST_VISIT / area))) : scale;
}

/* The lobe for colour 1. plain: the closure of the normal at the hit point, which is returned alone where no hinted
 * light can show a glint. lobes: number of lobes that share the closures of a shading point; closure_count: most of one
 * lobe, besides the remainder. lights, shapes: see light_hint.h; low, high: slope bounds of the map, equal if unknown.
 * is_grid: whether the pixel filter is that of pixel_grid.h; texels: texel coordinates by Dx(P), Dy(P);
 * diffuse_distance: to the diffuse bounce before this point, 0 if there was none. left: why `plain` is returned
 * (counters.h); hint_count: number of hints that some element of the map can reach here. */
closure color glint_lobe(string distribution, float alpha, int lobes, int closure_count, output Map map,
                         vector low, vector high, NormalFrame frame, Hit hit, vector lights[HINT_COUNT], vector shapes[HINT_COUNT], float samples,
                         int is_grid, float diffuse_distance, Matrix2 texels,
                         closure color plain, output color counters, output int left, output int hint_count)
{
  vector dpdx = Dx(P);
  vector dpdy = Dy(P);
  float radius = footprint_radius(samples);
  float view_turn = length(Dx(I)) / length(dpdx);
  Footprint own;
  if (!surface_footprint(cone_on_surface(dpdx, dpdy, diffuse_distance > 0.0 ? vector(Ng) : I, Ng, radius), texels, own)) {
    left = LEFT_NO_FOOTPRINT;
    return plain;
  }
  if (diffuse_distance > 0.0) {
    scale_footprint(caustic_scale(own, radius * length(dpdx), diffuse_distance), own);
    view_turn = 1.0 / diffuse_distance;
  }
  /* Whether the pixel grid is used must not depend on the sample's place in it, or light would be gained or lost. So the
   * widest footprint decides. Counted footprints hold so many elements that the totals' noise costs more. */
  Footprint footprint = own;
  PixelGrid grid;
  grid.is_known = 0;
  if (is_grid) {
    grid = grid_here(samples);
    Matrix2 surface;
    grid.is_known = grid.is_known && grid_on_surface(grid.widest, grid.widest, surface) &&
                    surface_footprint(surface, texels, footprint) &&
                    far_block(map.counts, footprint, FAR_SIDE_FIRST) == 0;
    int widest_mode = query_mode(footprint, map.visits);
    grid.is_known = grid.is_known && (widest_mode == MODE_ALL || widest_mode == MODE_POINTS);
    if (!grid.is_known) {
      footprint = own;
    }
  }
  int mode = query_mode(footprint, map.visits);
  if (mode == MODE_SINGLE && !map.is_linear) {
    left = LEFT_WITHIN_TEXEL;
    return plain;
  }

  /* Keep the hints that some normal of the map can reach here. */
  HalfVector hints[HINT_COUNT];
  float region = REGION * alpha;
  int bounded = high[0] > low[0] || high[1] > low[1];
  vector strong_low = low;
  vector strong_high = high;
  strengthened_bounds(map.strength, strong_low, strong_high);
  for (int k = 0; k < HINT_COUNT; ++k) {
    HalfVector hint;
    if (half_vector(lights[k], shapes[k], region, frame, footprint, dpdx, dpdy, view_turn, hint)) {
      hints[hint_count] = hint;
      hint_count += 1;
    }
  }
  float total = 1.0;
  int passes = 1;
  int is_scaled = 0;
  for (int pass = 0; pass < passes; ++pass) {
    int kept = 0;
    for (int k = 0; k < hint_count; ++k) {
      HalfVector hint = hints[k];
      turn_over(footprint, hint);
      if (kept * lobes + lobes <= HINT_COUNT && (!bounded || map_reaches_hint(hint, strong_low, strong_high))) {
        hints[kept] = hint;
        kept += 1;
      }
    }
    hint_count = kept;
    if (hint_count == 0) {
      left = LEFT_NOT_REACHED;
      return plain;
    }
    float scale = is_scaled ? 1.0 : footprint_scale(hints, hint_count, footprint.area, samples);
    if (grid.is_known && scale == 1.0) {
      Matrix2 surface;
      grid_on_surface(grid.radius_x, grid.radius_y, surface);
      surface_footprint(surface, texels, footprint);
      total = grid.total;
    }
    else if (grid.is_known) {
      footprint = own;
      grid.is_known = 0;
      passes += 1;
    }
    else if (scale < 1.0) {
      scale_footprint(scale, footprint);
      is_scaled = 1;
      passes += 1;
    }
  }
  mode = query_mode(footprint, map.visits);
  if (mode == MODE_SINGLE && total != 1.0) {
    mode = MODE_POINTS;
  }
  if (mode == MODE_SINGLE && !map.is_linear) {
    left = LEFT_WITHIN_TEXEL;
    return plain;
  }
  if (mode == MODE_SINGLE) {
    counters = color(1, 1, mode);
    left = LEFT_WITHIN_TEXEL;
    return patch_closure(distribution, alpha, hit_patch(map, hit), hit, frame, footprint, hints[0]);
  }

  /* Choose between the counts, the index and visits. The remainder is one normal: more would gain nothing: decision
   * 13. */
  Level level;
  Cells cells[HINT_COUNT];
  vector random = (vector)hashnoise(point(hit.u, hit.v, P[0] + 2.0 * P[1] + 3.0 * P[2]));
  int is_selected = 0;
  /* Try the counts, then the index, then, before a random subset, counts of wider blocks. The loop calls counts_serve
   * at one place only, because OSL compiles each call of a function anew. */
  int is_searched = mode == MODE_ALL || mode == MODE_SUBSET;
  float widest = FAR_SIDE_FIRST;
  while (widest > 0.0) {
    if (map.visits > COUNTS_VISITS &&
        counts_serve(map, hints, hint_count, lobes, alpha, footprint, widest, random, level, cells)) {
      mode = MODE_COUNTS;
    }
    else if (widest == FAR_SIDE_FIRST && is_searched && index_serves(map, footprint, hints, hint_count, hit.u, hit.v)) {
      mode = MODE_INDEX;
    }
    widest = mode == MODE_SUBSET && widest == FAR_SIDE_FIRST ? FAR_SIDE_SUBSET : 0.0;
  }
  if (mode == MODE_COUNTS) {
    is_selected = hit_is_counted(hints, hint_count, cells, level, map, hit);
  }
  else {
    Patch patch;
    if (map.is_linear) {
      patch = hit_patch(map, hit);
    }
    is_selected = hit_is_selected(map, hints, hint_count, alpha, mode, patch, hit.u - hit.i, hit.v - hit.j, hit.n);
  }
  closure color remainder = 0;
  int closures = 0;
  if (!is_selected) {
    remainder = plain;
    closures = 1;
  }

  int visited = 0;
  float weights = 1.0;
  Selection s = new_selection(closure_count, lobes, distribution == "ggx", alpha, random[2]);
  s.is_merged = mode == MODE_COUNTS;
  if (mode == MODE_COUNTS) {
    counts_query(alpha, map, level, hints, hint_count, peak_parts(hint_count * lobes), cells, footprint, hit.u, hit.v,
                 random, s, visited);
  }
  else if (mode == MODE_INDEX) {
    weights = index_query(map, hints, hint_count, alpha, footprint, hit.u, hit.v, s, visited);
  }
  else {
    weights = glint_query(map, hints, hint_count, alpha, footprint, mode,
                        map.is_linear && samples > 1.0 ? SURE_WEIGHT : 0.0, hit.u, hit.v, random[0], random[1], s,
                        visited);
  }
  closure color sum = selection_closures(distribution, alpha, hints, s, weights / total, hit.u, hit.v, remainder, closures);
  counters = color(visited, closures, mode);
  return sum;
}
