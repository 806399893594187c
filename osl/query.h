/* The glint query: which elements of the map, within the footprint, can reflect a hinted light into the view.
 *
 * Near: every texel (Closest) or bilinear patch (Linear) under the footprint is visited while there are at most
 * LARGEST_VISIT; beyond that a random subset of that size stands for all, so that such views get noisier, never wrong.
 * The middle distance is that of slope_index.h where that is faster, far views those of counts.h, which take over where a
 * block is about as wide as the footprint: a visit costs 50 ns (35 of them the fetch), so 4096 of them 200 us. Measured with
 * the index: flakes of 7,000 texels a footprint 266 -> 45 us, of 450 22 -> 5 us; smooth patches, a third of which mirror a
 * light where the light is near the middle of the slopes, gain nothing there: each then fetches all its corners.
 * A random part of the candidates does not pay where there are many: one row, or list of the index, of so many that 256 or
 * 128 candidates are left gave an error of 0.26 or 0.42 instead of 0.17 (eight_bit, 4 samples) in 0.47 or 0.29 of the time.
 * glint_query is what the shader uses, with its twin hit_is_selected.
 */

/* Elements visited a sample at most: 4096 cost about 200 us of one core. Fewer leave noise in views of a thousand texels
 * a pixel that more samples do not make up for (512: error 0.27 instead of 0.12 at 4 samples). Where most noise is that of
 * lights which are not looked for, fewer are worth it (Choice of glint_addon/choice/ranking.py): a hundred lamps, 4 samples:
 * error 3.9, 58 us a sample with 4096; 4.1, 9 us with 64; 4.6, 6 us with 16. */
#define LARGEST_VISIT 4096
/* So few visits cost no more than counts, which under eight lights take 25 to 40 us. */
#define COUNTS_VISITS 512
/* Weight of the kernel, 1 in its middle, from which on a patch is always visited; of the others a third is drawn (is_drawn).
 * Error at 4 samples, us a sample, with 0 (all), 0.5, 0.75, 1: bumps 0.275, 38; 0.287, 30; 0.304, 24; 0.324, 18; scratches
 * 0.690, 42; 0.695, 30; 0.694, 24; 0.752, 20; brushed metal 0.988, 44; 0.988, 29; 0.988, 23; 0.990, 18. Neighbours hardly
 * differ, so what is drawn stands for what is not; texels do differ (flakes 0.179 -> 0.238 at hardly less time), and a
 * pixel's only sample would show it (bumps 0.111 -> 0.209): there all are visited. */
#define SURE_WEIGHT 0.75
/* Below this semi-axis (texels) a footprint hardly leaves one element: the sample's own is the answer. */
#define SINGLE_ELEMENT 0.5
/* Ellipses thinner than this would slip between the centres of elements: points along them are used instead. */
#define THIN_FOOTPRINT 1.0
/* Points a texel of a thin footprint, and the fewest of all. */
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

/* Deviation of a uniform spread over 0..1: 1 / sqrt(12). */
#define UNIFORM_DEVIATION 0.28867513
/* Largest deviation, in texels, of the positions that one point of a thin footprint stands for: those of half a texel. */
#define LARGEST_SPREAD 0.14433757

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

/* Whether the texel normal n at a texel offset is selected by a hint, and its slope there. Divides only when it is. */
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

/* Whether glint_query selects the element at the hit point (u, v) itself, for any hint: then it is not in the remainder.
 * patch: the hit's own; n: the normal there. Must cut patches exactly as glint_query does. */
int hit_is_selected(Map map, HalfVector hints[8], int hint_count, float alpha, int mode, Patch patch, float a, float b,
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

/* Select what one texel holds for the hints from `from` to before `to`. A normal belongs to the first of all hints in whose
 * region it lies, or it would count twice. first: hints[from] by itself, because each use of an array's element copies the
 * whole struct (a quarter of the time). */
void visit_texel(output Map map, HalfVector first, HalfVector hints[8], int from, int to, int i, int j, float offset_u,
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
    select_element(s, hints, found, weight, p1, p2, 0, 0, 0);
  }
}

/* Select what one patch holds for the hints from `from` to before `to`, or in MODE_POINTS its point (a, b), whose share of
 * the footprint has the deviations (first_a, first_b) and (second_a, second_b). offset: of the patch's lower left corner. */
void visit_patch(output Map map, HalfVector hints[8], int from, int to, float alpha, int mode, int i,
                 int j, float offset_u, float offset_v, float a, float b, float first_a, float first_b,
                 float second_a, float second_b, float weight, output Selection s)
{
  /* Skip patches that no half vector can reach, by one fetch. */
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
  for (int h = from; h < to; ++h) {
    PatchSlopes slopes;
    if (patch_slopes(hints[h], patch, offset_u, offset_v, slopes)) {
      for (int part = 0; part < columns * rows; ++part) {
        float part_a = mode == MODE_POINTS ? a : (part % columns + 0.5) / columns;
        float part_b = mode == MODE_POINTS ? b : (part / columns + 0.5) / rows;
        float p1, p2;
        if (patch_slope(hints[h], slopes, part_a, part_b, p1, p2)) {
          /* The first hint that has it keeps it. */
          int taken = 0;
          for (int g = 0; g < h && !taken; ++g) {
            PatchSlopes other;
            float q1, q2;
            taken = patch_slopes(hints[g], patch, offset_u, offset_v, other) &&
                    patch_slope(hints[g], other, part_a, part_b, q1, q2);
          }
          if (!taken) {
            float c11, c12, c22;
            if (mode == MODE_POINTS) {
              patch_covariance(slopes, a, b, first_a, first_b, second_a, second_b, c11, c12, c22);
            }
            else {
              patch_covariance(slopes, part_a, part_b, UNIFORM_DEVIATION / columns, 0, 0, UNIFORM_DEVIATION / rows,
                               c11, c12, c22);
            }
            select_element(s, hints, h, part_weight, p1, p2, c11, c12, c22);
          }
        }
      }
    }
  }
}

/* Select the elements within the footprint around the texel coordinates (u, v) (for Linear, less half a texel).
 * sure: weight from which on an element is always visited (is_drawn); shift_1, shift_2: two uniform numbers of this
 * sample. Returns the sum of the kernel's weights over all elements, which the selected weights are relative to. */
float glint_query(output Map map, HalfVector hints[8], int hint_count, float alpha, Footprint footprint, int mode, float sure,
                  float u, float v, float shift_1, float shift_2, output Selection s, output int visited)
{
  float total = 0;
  HalfVector first = hints[0];
  float due = shift_1;

  if (mode == MODE_ALL) {
    /* Visit the ellipse quu du^2 + 2 quv du dv + qvv dv^2 < 1 row by row. */
    float determinant = footprint.ux * footprint.vy - footprint.uy * footprint.vx;
    float ixu = footprint.vy / determinant;
    float ixv = -footprint.uy / determinant;
    float iyu = -footprint.vx / determinant;
    float iyv = footprint.ux / determinant;
    float quu = ixu * ixu + iyu * iyu;
    float quv = ixu * ixv + iyu * iyv;
    float qvv = ixv * ixv + iyv * iyv;
    float half_height = sqrt(footprint.vx * footprint.vx + footprint.vy * footprint.vy);
    int last_row = (int)floor(v + half_height - 0.5);
    for (int row = (int)ceil(v - half_height - 0.5); row <= last_row; ++row) {
      float dv = row + 0.5 - v;
      float root = max(quv * quv * dv * dv - quu * (qvv * dv * dv - 1.0), 0.0);
      float middle = u - quv / quu * dv - 0.5;
      int last_column = (int)floor(middle + sqrt(root) / quu);
      int column = (int)ceil(middle - sqrt(root) / quu);
      int i = wrapped(column, map.width);
      int j = wrapped(row, map.height);
      for (; column <= last_column; ++column) {
        float du = column + 0.5 - u;
        float weight = footprint_kernel(quu * du * du + 2.0 * quv * du * dv + qvv * dv * dv);
        total += weight;
        if (is_drawn(sure, due, weight)) {
          visited += 1;
          if (map.is_linear) {
            visit_patch(map, hints, 0, hint_count, alpha, MODE_ALL, i, j, du - 0.5, dv - 0.5, 0, 0, 0, 0, 0, 0,
                        weight, s);
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
    /* A point's own spread ends within its patch: beyond, slopes go another way. */
    float share = min(sqrt(KERNEL_VARIANCE / points), LARGEST_SPREAD / footprint.long_axis);
    for (int k = 0; k < points; ++k) {
      float x, y;
      float a = shift_1 + k * PLASTIC_1;
      float b = shift_2 + k * PLASTIC_2;
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
        visit_patch(map, hints, 0, hint_count, alpha, mode, i, j, column - u, row - v, point_u - column,
                    point_v - row, share * footprint.ux, share * footprint.vx, share * footprint.uy,
                    share * footprint.vy, 1.0, s);
      }
      else {
        /* Seen at the point, not at the texel's centre, which may lie far outside a thin footprint. */
        visit_texel(map, first, hints, 0, hint_count, i, j, point_u - u, point_v - v, 1.0, s);
      }
    }
  }
  return total;
}
