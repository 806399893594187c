#pragma once
/* The glint lobe of one shading point: closures of the selected elements, and the remainder. The remainder is one
 * normal drawn at random from the footprint, the normal at the hit point, unless that normal is among the selected
 * elements: it stands for all elements that are not selected. One is enough: decision 13. */

#include "closures.h"
#include "counts.h"
#include "pixel_grid.h"
#include "slope_index.h"
#include "view.h"

/* A material that allows so few visits uses no counts, which would take longer: decision 8. */
#define COUNTS_VISITS 512

/* The scene's lights: see light_hint.h. */
struct Lights {
  vector place[HINT_COUNT];
  vector shape[HINT_COUNT];
};

/* The footprint on the pixel grid. Whether it is used must not depend on the sample's place in the grid, or light would
 * be gained or lost: so the round footprint and the widest one, which is returned, decide. A close view, whose round
 * footprint lies within one element, is answered by that element; counted footprints hold so many elements that the
 * noise of the totals costs more. */
int grid_footprint(View view, Map map, Footprint own, output PixelGrid grid, output Footprint widest)
{
  Matrix2 surface;
  if (!view.on_grid || query_mode(own, map.visits) == MODE_SINGLE) {
    return 0;
  }
  grid = grid_here(view.samples);
  if (!grid.is_known || !grid_on_surface(grid.widest, grid.widest, surface) ||
      !surface_footprint(surface, view.texels, widest)) {
    return 0;
  }
  int mode = query_mode(widest, map.visits);
  return (mode == MODE_ALL || mode == MODE_POINTS) && far_block(map.counts, widest, FAR_SIDE_FIRST) == 0;
}

/* By how much to make a query's footprint smaller, 0..1: its turn is limited to `largest_turn`, and to
 * SPARE_TURN where it has more than LARGEST_VISIT elements. */
float footprint_scale(Query query, float samples, float largest_turn)
{
  float scale = 1.0;
  float spare = 1.0;
  for (int k = 0; k < query.hint_count; ++k) {
    /* A little less than counts may turn, whatever rounding does. */
    float widest = (samples > 1.0 ? SPARE_TURN : 0.999 * FAR_TURN) * query.hints[k].radius;
    scale = min(scale, largest_turn / max(query.hints[k].turn, largest_turn));
    spare = min(spare, widest / max(query.hints[k].turn, widest));
  }
  float area = query.footprint.area;
  return area > LARGEST_VISIT ? min(scale, max(spare, sqrt(LARGEST_VISIT / area))) : scale;
}

/* Give the query the half vectors of all lights that can make glints here. */
void add_hints(Lights lights, NormalFrame frame, View view, output Query query)
{
  float view_turn = view.diffuse_distance > 0.0 ? 1.0 / view.diffuse_distance : length(Dx(I)) / length(Dx(P));
  query.hint_count = 0;
  for (int k = 0; k < HINT_COUNT; ++k) {
    HalfVector hint;
    if (half_vector(lights.place[k], lights.shape[k], REGION * query.facet.alpha, frame, query.footprint, view_turn,
                    hint)) {
      query.hints[query.hint_count] = hint;
      query.hint_count += 1;
    }
  }
}

/* Keep the hints that some normal of the map can reach within the footprint. */
void keep_reached(Map map, output Query query)
{
  int bounded = map.high[0] > map.low[0] || map.high[1] > map.low[1];
  vector low = map.low;
  vector high = map.high;
  strengthened_bounds(map.strength, low, high);
  int kept = 0;
  for (int k = 0; k < query.hint_count; ++k) {
    HalfVector hint = query.hints[k];
    turn_over(query.footprint, hint);
    if (!bounded || map_reaches_hint(hint, low, high)) {
      query.hints[kept] = hint;
      kept += 1;
    }
  }
  query.hint_count = kept;
}

/* Choose the query's footprint and the hints that matter within it. Returns the total that it stands for: see
 * pixel_grid.h. */
float fit_footprint(Lights lights, NormalFrame frame, View view, Map map, output Query query)
{
  PixelGrid grid;
  Footprint widest;
  Footprint own = query.footprint;
  int is_grid = grid_footprint(view, map, own, grid, widest);
  if (is_grid) {
    query.footprint = widest;
  }
  add_hints(lights, frame, view, query);
  /* Make the footprint smaller until it turns little enough, and keep what it then reaches. The loop calls keep_reached
   * at one place only, because OSL compiles each call of a function anew. */
  int is_scaled = 0;
  for (int is_done = 0; !is_done;) {
    keep_reached(map, query);
    float scale = 1.0;
    if (!is_scaled) {
      scale = footprint_scale(query, view.samples, is_grid ? GRID_TURN : LARGEST_FOOTPRINT_TURN);
    }
    is_done = scale == 1.0 || query.hint_count == 0;
    if (is_grid && !is_done) {
      query.footprint = own;
      is_grid = 0;
    }
    else if (!is_done) {
      Footprint footprint = query.footprint;
      scale_footprint(scale, footprint);
      query.footprint = footprint;
      is_scaled = 1;
    }
  }
  query.is_on_grid = is_grid;
  if (!is_grid) {
    return 1.0;
  }
  Matrix2 surface;
  grid_on_surface(grid.radius_x, grid.radius_y, surface);
  surface_footprint(surface, view.texels, widest);
  query.footprint = widest;
  return grid.total;
}

/* Closure of a footprint smaller than a texel (Linear): slopes vary linearly within it, so one closure is enough. */
closure color patch_closure(Query query, output Map map, Hit hit, NormalFrame frame)
{
  HalfVector around = query.hints[0];
  around.h = normalize(frame_to_world(frame, hit.n));
  slope_axes(frame, around);
  float deviation = sqrt(KERNEL_VARIANCE);
  PatchPart part = { hit.u - hit.i, hit.v - hit.j, deviation * query.footprint.ux, deviation * query.footprint.vx,
                     deviation * query.footprint.uy, deviation * query.footprint.vy };
  SlopeLobe lobe = { 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 };
  spread_over_part(around, map_patch(map, hit.column, hit.row), part, lobe);
  return glint_closure(query.facet, 1.0, color(1.0), around, lobe);
}

/* Select the elements of a footprint wider than one element, in the way that `mode` asks for, or by counts or index
 * where these serve. is_selected: whether the hit is among them. Returns the sum to which the selected weights are
 * relative. */
float select_elements(output Map map, Query query, Hit hit, View view, output int mode, output Selection s,
                      output int is_selected)
{
  Level level;
  Cells cells[HINT_COUNT];
  /* Try the counts, then the index, then, before a random subset, counts of wider blocks. The loop calls counts_serve
   * at one place only, because OSL compiles each call of a function anew. */
  int is_searched = mode == MODE_ALL || mode == MODE_SUBSET;
  float widest = FAR_SIDE_FIRST;
  while (widest > 0.0) {
    if (map.visits > COUNTS_VISITS && counts_serve(map, query, widest, level, cells)) {
      mode = MODE_COUNTS;
    }
    else if (widest == FAR_SIDE_FIRST && is_searched && index_serves(map, query)) {
      mode = MODE_INDEX;
    }
    widest = mode == MODE_SUBSET && widest == FAR_SIDE_FIRST ? FAR_SIDE_SUBSET : 0.0;
  }
  if (mode == MODE_COUNTS) {
    s.is_merged = 1;
    is_selected = hit_is_counted(query, cells, level, map, hit);
    counts_query(map, level, query, cells, s);
    return 1.0;
  }
  is_selected = hit_is_selected(query, map, hit, mode);
  if (mode == MODE_INDEX) {
    return index_query(map, query, s);
  }
  return visit_elements(map, query, mode, map.is_linear && view.samples > 1.0 ? SURE_WEIGHT : 0.0, s);
}

/* The lobe. s: empty, for as many closures as the lobe may return besides the remainder. plain: the closure of the
 * normal at the hit point, which is returned alone where no hinted light can show a glint; 0 where no flake is. */
closure color glint_lobe(Facet facet, output Map map, NormalFrame frame, Hit hit, View view, Lights lights,
                         output Selection s, closure color plain)
{
  Query query;
  query.u = hit.u;
  query.v = hit.v;
  query.facet = facet;
  query.random = (vector)hashnoise(point(hit.u, hit.v, P[0] + 2.0 * P[1] + 3.0 * P[2]));
  Footprint footprint;
  if (!round_footprint(view, footprint)) {
    map.costs.left = LEFT_NO_FOOTPRINT;
    return plain;
  }
  query.footprint = footprint;
  float share = fit_footprint(lights, frame, view, map, query);
  map.costs.hints = query.hint_count;
  if (query.hint_count == 0) {
    map.costs.left = LEFT_NOT_REACHED;
    return plain;
  }
  int mode = query_mode(query.footprint, map.visits);
  if (mode == MODE_SINGLE && query.is_on_grid) {
    mode = MODE_POINTS; /* narrow here, but wider than an element elsewhere in the pixel */
  }
  if (mode == MODE_SINGLE) {
    map.costs.left = LEFT_WITHIN_TEXEL;
    if (!map.is_linear) {
      return plain;
    }
    map.costs.visited = 1;
    map.costs.mode = mode;
    return patch_closure(query, map, hit, frame);
  }
  s.random = query.random[2];
  int is_selected = 0;
  float total = select_elements(map, query, hit, view, mode, s, is_selected);
  map.costs.mode = mode;
  map.costs.closures = !is_selected && hit.is_flake;
  closure color remainder = 0;
  if (!is_selected) {
    remainder = plain;
  }
  return selection_closures(query, map, hit, s, total / share, remainder);
}
