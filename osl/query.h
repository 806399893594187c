/* The glint query: which elements of the map, within the footprint, can reflect a hinted light into the view.
 *
 * An element is a texel (Closest) or a bilinear patch (Linear). To visit an element is to fetch it and to test its
 * slopes against the region of each hint. Near footprints: all elements under the footprint are visited while these are
 * no more than map.visits; of more, a random subset of that size stands for all, which is noisier but right in the
 * mean. Footprints in the middle distance use slope_index.h where that is faster (decision 14), and far footprints use
 * counts.h from where a block is about as wide as the footprint. The index is not thinned out at random: decision 10.
 * glint_query is what the shader uses, with its twin hit_is_selected.
 */

/* Most elements that a sample visits; fewer leave noise that more samples do not make up for: decision 7. The material
 * may ask for fewer (Choice of glint_addon/choice/ranking.py): decision 41. */
#define LARGEST_VISIT 4096
/* A material that allows so few visits uses no counts, which would take longer: decision 8. */
#define COUNTS_VISITS 512
/* Weight of the kernel, 1 in its middle, from which on a patch is always visited. Lighter patches are drawn at random
 * (is_drawn), about a third of them: neighbouring patches are alike, so those drawn stand for the others: decision 9.
 * Texels differ from their neighbours, and a pixel's only sample would show which are drawn: there all are visited. */
#define SURE_WEIGHT 0.75
/* Least semi-axis in texels of a footprint that is queried: a smaller footprint hardly leaves one element. */
#define SINGLE_ELEMENT 0.5
/* Least short semi-axis in texels for visits row by row: a thinner ellipse may contain no centre of an element, so
 * points along the ellipse are visited. */
#define THIN_FOOTPRINT 1.0
/* Points per texel of a thin footprint, and the fewest points of all. */
#define POINTS_PER_TEXEL 4.0
#define FEWEST_POINTS 8

#define MODE_PLAIN 0
#define MODE_SINGLE 1
#define MODE_POINTS 2
#define MODE_ALL 3
#define MODE_SUBSET 4
#define MODE_COUNTS 5
#define MODE_INDEX 6

/* Additive recurrence with the plastic number: the k-th of a low-discrepancy set of points in the unit square.
 * Source: Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018. */
#define PLASTIC_1 0.7548776662466927
#define PLASTIC_2 0.5698402909980532

/* Standard deviation of a uniform distribution over 0..1: 1 / sqrt(12). */
#define UNIFORM_DEVIATION 0.28867513
/* Largest standard deviation, in texels, of the positions for which one point of a thin footprint stands: that of half
 * a texel. */
#define LARGEST_SPREAD 0.14433757

/* How to query a footprint, one of MODE_..., if at most `visits` elements may be visited. */
int query_mode(Footprint footprint, int visits)
{
  if (footprint.long_axis < SINGLE_ELEMENT) {
    return MODE_SINGLE;
  }
  if (footprint.short_axis < THIN_FOOTPRINT) {
    return MODE_POINTS;
  }
  return footprint.area <= visits ? MODE_ALL : MODE_SUBSET;
}

/* Whether a hint selects the texel normal n at a texel offset, and the slope there. Divides only for a selected
 * normal. */
int texel_slope(HalfVector hint, vector n, float offset_u, float offset_v, output float p1, output float p2)
{
  vector form = slope_forms(hint, n, offset_u, offset_v);
  float reach = hint.radius * form[2];
  if (!(form[2] > 0.0) || !(form[0] * form[0] + form[1] * form[1] < reach * reach)) {
    return 0;
  }
  p1 = form[0] / form[2];
  p2 = form[1] / form[2];
  return 1;
}

/* Whether glint_query selects, for any hint, the element at the hit point: then the remainder must leave it out. patch,
 * (a, b): the hit's patch and the place in it; n: the normal there. This function must cut patches exactly as
 * glint_query does. */
int hit_is_selected(Map map, HalfVector hints[HINT_COUNT], int hint_count, float alpha, int mode, Patch patch, float a, float b,
                    vector n)
{
  float part_a = a;
  float part_b = b;
  if (map.is_linear && mode != MODE_POINTS) {
    int columns = patch_columns(patch, alpha);
    int rows = patch_rows(patch, alpha);
    part_a = (min(floor(a * columns), columns - 1.0) + 0.5) / columns;
    part_b = (min(floor(b * rows), rows - 1.0) + 0.5) / rows;
  }
  for (int h = 0; h < hint_count; ++h) {
    float p1, p2;
    if (map.is_linear) {
      PatchSlopes slopes;
      if (patch_slopes(hints[h], patch, -a, -b, slopes) && patch_slope(hints[h], slopes, part_a, part_b, p1, p2)) {
        return 1;
      }
    }
    else if (texel_slope(hints[h], n, 0, 0, p1, p2)) {
      return 1;
    }
  }
  return 0;
}

/* Visit one texel for the hints from `from` to before `to`. A normal that lies in the regions of several hints is
 * selected for the first of all hints alone, or it would count twice. first: hints[from] as a parameter, because each
 * use of an array's element copies the whole struct: decision 12. */
void visit_texel(output Map map, HalfVector first, HalfVector hints[HINT_COUNT], int from, int to, int i, int j, float offset_u,
                 float offset_v, float weight, output Selection s)
{
  vector n = map_normal(map, i, j);
  int found = -1;
  float p1, p2;
  if (texel_slope(first, n, offset_u, offset_v, p1, p2)) {
    found = from;
  }
  for (int h = from + 1; h < to && found < 0; ++h) {
    if (texel_slope(hints[h], n, offset_u, offset_v, p1, p2)) {
      found = h;
    }
  }
  for (int g = 0; g < from && found >= 0; ++g) {
    float q1, q2;
    if (texel_slope(hints[g], n, offset_u, offset_v, q1, q2)) {
      found = -1;
    }
  }
  if (found >= 0) {
    SlopeMoments m = { p1, p2, 0.0, 0.0, 0.0 };
    select_element(s, hints, found, weight, m);
  }
}

/* Visit one patch for the hints from `from` to before `to`, cut into parts; in MODE_POINTS only the part `place`.
 * offset: of the patch's lower left corner. */
void visit_patch(output Map map, HalfVector hints[HINT_COUNT], int from, int to, float alpha, int mode, int i, int j,
                 float offset_u, float offset_v, PatchPart place, float weight, output Selection s)
{
  /* Skip a patch that no hint can select, by one fetch. */
  if (patch_has_bounds(map.width, map.height, i, j)) {
    float ball = 0;
    map.fetches += 1;
    vector centre = strengthened(
        patch_bounds(map.table, map.inverse_padded_width, map.inverse_padded_height, i, j, ball), map.strength);
    ball *= max(abs(map.strength), 1.0);
    int reached = 0;
    for (int h = from; h < to && !reached; ++h) {
      reached = hint_reaches_ball(hints[h], centre, ball, offset_u + 0.5, offset_v + 0.5);
    }
    if (!reached) {
      return;
    }
  }

  Patch patch = map_patch(map, i, j);
  int columns = mode == MODE_POINTS ? 1 : patch_columns(patch, alpha);
  int rows = mode == MODE_POINTS ? 1 : patch_rows(patch, alpha);
  float part_weight = weight / (columns * rows);
  PatchPart part = place;
  if (mode != MODE_POINTS) {
    part.first_a = UNIFORM_DEVIATION / columns;
    part.second_b = UNIFORM_DEVIATION / rows;
  }
  for (int h = from; h < to; ++h) {
    PatchSlopes slopes;
    if (patch_slopes(hints[h], patch, offset_u, offset_v, slopes)) {
      for (int k = 0; k < columns * rows; ++k) {
        if (mode != MODE_POINTS) {
          part.a = (k % columns + 0.5) / columns;
          part.b = (k / columns + 0.5) / rows;
        }
        SlopeMoments m;
        if (patch_slope(hints[h], slopes, part.a, part.b, m.p1, m.p2)) {
          /* Select a normal for the first hint in whose region it lies. */
          int taken = 0;
          for (int g = 0; g < h && !taken; ++g) {
            PatchSlopes other;
            float q1, q2;
            taken = patch_slopes(hints[g], patch, offset_u, offset_v, other) &&
                    patch_slope(hints[g], other, part.a, part.b, q1, q2);
          }
          if (!taken) {
            patch_covariance(slopes, part, m);
            select_element(s, hints, h, part_weight, m);
          }
        }
      }
    }
  }
}

/* Visit the elements within the footprint around the texel coordinates (u, v), for Linear less half a texel, and select
 * those that mirror a hinted light. sure: weight from which on an element is always visited (is_drawn); random_1,
 * random_2: uniform numbers of this sample. Returns the sum of the kernel's weights over all elements: selected weights
 * are relative to this sum. */
float glint_query(output Map map, HalfVector hints[HINT_COUNT], int hint_count, float alpha, Footprint footprint, int mode,
                  float sure, float u, float v, float random_1, float random_2, output Selection s, output int visited)
{
  float total = 0;
  HalfVector first = hints[0];
  PatchPart place = { 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 };
  float odds = random_1;

  if (mode == MODE_ALL) {
    /* Visit the ellipse row by row. */
    Ellipse ellipse = footprint_ellipse(footprint, 0.0, 0.0);
    int last_row = (int)floor(v + ellipse.reach_v - 0.5);
    for (int row = (int)ceil(v - ellipse.reach_v - 0.5); row <= last_row; ++row) {
      float dv = row + 0.5 - v;
      float offset = ellipse.quv * dv;
      float half_width = sqrt(max(offset * offset - ellipse.quu * (ellipse.qvv * dv * dv - 1.0), 0.0)) / ellipse.quu;
      float middle = u - offset / ellipse.quu - 0.5;
      int last_column = (int)floor(middle + half_width);
      int column = (int)ceil(middle - half_width);
      int i = wrapped(column, map.width);
      int j = wrapped(row, map.height);
      for (; column <= last_column; ++column) {
        float du = column + 0.5 - u;
        float weight = footprint_kernel(ellipse_square(ellipse, du, dv));
        total += weight;
        if (is_drawn(sure, odds, weight)) {
          visited += 1;
          if (map.is_linear) {
            visit_patch(map, hints, 0, hint_count, alpha, MODE_ALL, i, j, du - 0.5, dv - 0.5, place, weight, s);
          }
          else {
            visit_texel(map, first, hints, 0, hint_count, i, j, du, dv, weight, s);
          }
        }
        i = i + 1 < map.width ? i + 1 : 0;
      }
    }
  }
  else {
    /* Visit points drawn from the kernel. */
    int points = map.visits;
    if (mode == MODE_POINTS) {
      float wanted = POINTS_PER_TEXEL * 2.0 * footprint.long_axis * max(2.0 * footprint.short_axis, 1.0);
      points = clamp((int)ceil(min(wanted, LARGEST_VISIT)), FEWEST_POINTS, LARGEST_VISIT);
    }
    /* Find the part of the footprint that one point stands for, no wider than half a patch: another patch has other
     * slopes. */
    float share = min(sqrt(KERNEL_VARIANCE / points), LARGEST_SPREAD / footprint.long_axis);
    place.first_a = share * footprint.ux;
    place.first_b = share * footprint.vx;
    place.second_a = share * footprint.uy;
    place.second_b = share * footprint.vy;
    for (int k = 0; k < points; ++k) {
      float x, y;
      float a = random_1 + k * PLASTIC_1;
      float b = random_2 + k * PLASTIC_2;
      footprint_sample(a - floor(a), b - floor(b), x, y);
      float point_u = u + footprint.ux * x + footprint.uy * y;
      float point_v = v + footprint.vx * x + footprint.vy * y;
      float column = floor(point_u);
      float row = floor(point_v);
      int i = wrapped((int)column, map.width);
      int j = wrapped((int)row, map.height);
      total += 1.0;
      visited += 1;
      if (map.is_linear) {
        place.a = point_u - column;
        place.b = point_v - row;
        visit_patch(map, hints, 0, hint_count, alpha, mode, i, j, column - u, row - v, place, 1.0, s);
      }
      else {
        /* Take the view at the point: the texel's centre may lie far outside a thin footprint. */
        visit_texel(map, first, hints, 0, hint_count, i, j, point_u - u, point_v - v, 1.0, s);
      }
    }
  }
  return total;
}
