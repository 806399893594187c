/* Far footprints: the NDF of square blocks of the map, counted over slope bins, read as masses of a few cells around each
 * half vector. The cost does not grow with the footprint. Layout: glint_addon/bake/counts.py, which writes it.
 *
 * A group is 2 x 2 blocks, whose counts share one texel; a texel holds how many elements lie below a corner of the bins
 * (a summed-area table: Crow 1984), so that four fetches give the mass of any cell of any size in four blocks. The
 * selection is a set of whole bins; the remainder leaves out exactly these (hit_is_counted), so nothing is lost or
 * counted twice, wherever the cells lie.
 */

/* Largest side of a block relative to the footprint's short semi-axis. */
#define FAR_SIDE 1.0
/* Groups visited a sample at most; beyond, larger blocks are taken. */
#define FAR_GROUPS 12
/* Widest bin relative to the width of the lobe and its light: elements are taken for evenly spread over a cell. */
#define FAR_BIN_CLOSEST 1.2
#define FAR_BIN_LINEAR 2.2
/* Least height of a half vector above the surface (cosine) for which slopes are counted. */
#define LEAST_HEIGHT 0.05

/* One level of the counts, in use. */
struct Level {
  int block;    /* side in texels of a block; 0: none */
  int corners;  /* a side of the summed-area table: one more than bins */
  int columns;  /* groups along u and v */
  int rows;
  int first;    /* texel of its first corner */
  float group_u; /* texels, side of a group */
  float group_v;
  int log_width; /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

/* Corners along one side; twin: corners() of the bake. */
int level_corners(int block, int is_linear)
{
  if (is_linear) {
    return block <= 32 ? 46 : block <= 64 ? 64 : block <= 128 ? 90 : block <= 256 ? 128 : block <= 512 ? 160 : 192;
  }
  return block <= 64 ? 88 : block <= 128 ? 136 : block <= 256 ? 184 : block <= 512 ? 232 : 256;
}

/* Groups of blocks of that side along `size` texels. */
int level_groups(int size, int block)
{
  return max((size + block) / (2 * block), 1);
}

/* Level with blocks of that side; the counts' own sides in the texture come out with the last level. */
Level counts_level(Counts counts, int block, int width, int height, int is_linear)
{
  Level level;
  level.block = block;
  level.first = 1;
  for (int side = counts.first; side < block; side *= 2) {
    int corners = level_corners(side, is_linear);
    level.first += level_groups(width, side) * level_groups(height, side) * corners * corners;
  }
  level.corners = level_corners(block, is_linear);
  level.columns = level_groups(width, block);
  level.rows = level_groups(height, block);
  level.group_u = width / (float)level.columns;
  level.group_v = height / (float)level.rows;
  return level;
}

/* Sides of the texture, powers of two: it is as nearly square as they can be. */
void counts_size(Counts counts, int width, int height, int is_linear, output Level level)
{
  Level end = counts_level(counts, counts.first << counts.levels, width, height, is_linear);
  level.log_width = 4;
  while (level.log_width < 13 && (1 << (2 * level.log_width)) < end.first) {
    level.log_width += 1;
  }
  int rows = 1;
  while ((rows << level.log_width) < end.first) {
    rows *= 2;
  }
  level.inverse_width = 1.0 / (1 << level.log_width);
  level.inverse_height = 1.0 / rows;
}

/* The level for a footprint; its block is 0 where there is none: too near, or bins too wide for the lobe. lobe: alpha and
 * a share of the light's size, the narrowest of the hints. */
Level far_level(Counts counts, Footprint footprint, int width, int height, int is_linear, float strength, float lobe)
{
  Level level;
  level.block = 0;
  int block = counts.first;
  int last = counts.first << (counts.levels - 1);
  float u_side = 2.0 * hypot(footprint.ux, footprint.uy);
  float v_side = 2.0 * hypot(footprint.vx, footprint.vy);
  if (block == 0 || block > FAR_SIDE * footprint.short_axis) {
    return level;
  }
  while (block < last && (2 * block <= FAR_SIDE * footprint.short_axis ||
                          (u_side / (2 * block) + 1.0) * (v_side / (2 * block) + 1.0) > FAR_GROUPS)) {
    block *= 2;
  }
  vector bin = abs(strength) * (counts.high - counts.low) / (level_corners(block, is_linear) - 1);
  if (max(bin[0], bin[1]) > (is_linear ? FAR_BIN_LINEAR : FAR_BIN_CLOSEST) * lobe) {
    return level;
  }
  level = counts_level(counts, block, width, height, is_linear);
  counts_size(counts, width, height, is_linear, level);
  return level;
}

/* The cells of one hint: whole bins around its half vector. */
struct Cells {
  int columns; /* along both slopes; 0: the half vector lies below the surface's horizon */
  int rows;
  int start1;  /* lowest bin */
  int start2;
  int stride1; /* bins in a cell */
  int stride2;
  float centre1; /* bin coordinates of the half vector */
  float centre2;
  float reach1;  /* bins, semi-axes of the selected ellipse's bounding box */
  float reach2;
  /* Bins per slope p around the half vector. */
  float a11;
  float a12;
  float a21;
  float a22;
};

/* Cells across a region: as many as `hints` hints may have of the closures. A lattice of spacing d within a circle of
 * diameter D d has at most 24, 24, 16, 14, 10, 9, 7, 7 points for these D. */
float far_cells(int hints)
{
  return hints <= 2 ? 5.0 : hints == 3 ? 4.0 : hints == 4 ? 3.5 : hints <= 6 ? 2.9 : 2.5;
}

/* Lay the cells of a hint along one slope: an odd number of them, the half vector about in the middle one. */
void lay_cells(float centre, float reach, float across, output int count, output int start, output int stride)
{
  stride = (int)max(ceil(2.0 * reach / across), 1.0);
  count = 2 * (int)ceil(reach / stride - 0.5) + 1;
  start = (int)floor(centre - 0.5 * count * stride + 0.5);
}

/* The cells around one hint, by the dual basis of its three forms. */
Cells far_cells_of(HalfVector hint, int hint_count, Counts counts, Level level, float strength)
{
  Cells cells;
  vector g1 = cross(hint.f2, hint.f3);
  vector g2 = cross(hint.f3, hint.f1);
  vector g3 = cross(hint.f1, hint.f2);
  float determinant = dot(hint.f1, g1);
  /* Slope in the map's own frame, without Strength: where it is below 1, z grows too (see strengthened). */
  float z = g3[2] / determinant / max(length(g3 / determinant), 1e-30);
  cells.columns = 0;
  cells.rows = 0;
  if (!(z > LEAST_HEIGHT) || strength == 0.0) {
    return cells;
  }
  float gain = strength * z / mix(1.0, z, clamp(strength, 0.0, 1.0));
  vector bins = (level.corners - 1.0) / (counts.high - counts.low);
  float s1 = g3[0] / g3[2];
  float s2 = g3[1] / g3[2];
  cells.centre1 = (s1 / gain - counts.low[0]) * bins[0];
  cells.centre2 = (s2 / gain - counts.low[1]) * bins[1];
  cells.a11 = bins[0] / gain * (g1[0] - s1 * g1[2]) / g3[2];
  cells.a12 = bins[0] / gain * (g2[0] - s1 * g2[2]) / g3[2];
  cells.a21 = bins[1] / gain * (g1[1] - s2 * g1[2]) / g3[2];
  cells.a22 = bins[1] / gain * (g2[1] - s2 * g2[2]) / g3[2];
  cells.reach1 = hint.radius * hypot(cells.a11, cells.a12);
  cells.reach2 = hint.radius * hypot(cells.a21, cells.a22);
  float across = far_cells(hint_count);
  lay_cells(cells.centre1, cells.reach1, across, cells.columns, cells.start1, cells.stride1);
  lay_cells(cells.centre2, cells.reach2, across, cells.rows, cells.start2, cells.stride2);
  return cells;
}

/* Whether cell (i, j) of hint k is selected: its middle lies in the region, and no earlier hint's cells touch it, or
 * elements would count twice. */
int cell_is_selected(Cells cells[8], int k, int i, int j)
{
  float low1 = cells[k].start1 + i * cells[k].stride1;
  float low2 = cells[k].start2 + j * cells[k].stride2;
  float x = (low1 + 0.5 * cells[k].stride1 - cells[k].centre1) / max(cells[k].reach1, 0.5);
  float y = (low2 + 0.5 * cells[k].stride2 - cells[k].centre2) / max(cells[k].reach2, 0.5);
  int selected = x * x + y * y < 1.0;
  for (int h = 0; h < k && selected; ++h) {
    selected = low1 >= cells[h].start1 + cells[h].columns * cells[h].stride1 ||
               low1 + cells[k].stride1 <= cells[h].start1 ||
               low2 >= cells[h].start2 + cells[h].rows * cells[h].stride2 ||
               low2 + cells[k].stride2 <= cells[h].start2;
  }
  return selected;
}

/* Bins by which the cells move for elements at a texel offset, whose slopes are turned by surface and half vector. */
void cell_shift(HalfVector hint, Cells cells, float offset_u, float offset_v, output int shift1, output int shift2)
{
  float p1 = offset_u * hint.shift_u1 + offset_v * hint.shift_v1;
  float p2 = offset_u * hint.shift_u2 + offset_v * hint.shift_v2;
  shift1 = (int)floor(0.5 - cells.a11 * p1 - cells.a12 * p2);
  shift2 = (int)floor(0.5 - cells.a21 * p1 - cells.a22 * p2);
}

/* Whether the counts' selection holds the hit point's own normal: then it is not in the remainder. */
int hit_is_counted(HalfVector hints[8], int hint_count, Cells cells[8], Level level, Map map, Hit hit)
{
  vector slope = hit.own / hit.own[2];
  vector bin = (slope - map.counts.low) / (map.counts.high - map.counts.low) * (level.corners - 1.0);
  int bin1 = (int)floor(bin[0]);
  int bin2 = (int)floor(bin[1]);
  if (!(hit.own[2] > 0.0) || bin1 < 0 || bin2 < 0 || bin1 >= level.corners - 1 || bin2 >= level.corners - 1) {
    return 0;
  }
  /* The middle of its group, all of which counts as turned alike. */
  int i = wrapped((int)hit.i, map.width);
  int j = wrapped((int)hit.j, map.height);
  float offset_u = (((i + 1) * level.columns - 1) / map.width + 0.5) * level.group_u - i - (hit.u - hit.i);
  float offset_v = (((j + 1) * level.rows - 1) / map.height + 0.5) * level.group_v - j - (hit.v - hit.j);
  for (int k = 0; k < hint_count; ++k) {
    if (cells[k].columns > 0) {
      int shift1, shift2;
      cell_shift(hints[k], cells[k], offset_u, offset_v, shift1, shift2);
      int column = (int)floor((bin1 - shift1 - cells[k].start1) / (float)cells[k].stride1);
      int row = (int)floor((bin2 - shift2 - cells[k].start2) / (float)cells[k].stride2);
      if (column >= 0 && row >= 0 && column < cells[k].columns && row < cells[k].rows &&
          cell_is_selected(cells, k, column, row)) {
        return 1;
      }
    }
  }
  return 0;
}

/* Sum of the closures of all cells, on top of the remainder. (u, v): the hit's texel coordinates; shift_1, shift_2: two
 * uniform numbers of this sample. */
closure color counts_closures(string distribution, float alpha, output Map map, Level level,
                              HalfVector hints[8], int hint_count, Cells cells[8], Footprint footprint, float u, float v,
                              float shift_1, float shift_2, closure color remainder, output int visited,
                              output int closures)
{
  /* Weights are those of blocks' middles, so the kernel is narrower by a block's own spread, as far as it meets a
   * middle everywhere. */
  float block_u = 0.5 * level.group_u;
  float block_v = 0.5 * level.group_v;
  float own = block_u * block_v / (12.0 * KERNEL_VARIANCE);
  float narrower = min((footprint.short_axis * footprint.short_axis - 0.5625 * block_u * block_v) / own, 1.0) /
                   (12.0 * KERNEL_VARIANCE);
  float suu = footprint.ux * footprint.ux + footprint.uy * footprint.uy - narrower * block_u * block_u;
  float suv = footprint.ux * footprint.vx + footprint.uy * footprint.vy;
  float svv = footprint.vx * footprint.vx + footprint.vy * footprint.vy - narrower * block_v * block_v;
  float determinant = suu * svv - suv * suv;
  float quu = svv / determinant;
  float quv = -suv / determinant;
  float qvv = suu / determinant;
  float reach_u = sqrt(suu) - 0.5 * block_u;
  float reach_v = sqrt(svv) - 0.5 * block_v;
  int first_column = (int)floor((u - reach_u) / level.group_u);
  int first_row = (int)floor((v - reach_v) / level.group_v);
  int columns = (int)floor((u + reach_u) / level.group_u) - first_column + 1;
  int rows = (int)floor((v + reach_v) / level.group_v) - first_row + 1;
  /* Beyond the largest blocks: groups at random points of the footprint stand for all. */
  int is_random = columns * rows > 2 * FAR_GROUPS;
  int groups = !is_random ? columns * rows : level.columns * level.rows == 1 ? 1 : FAR_GROUPS;

  closure color sum = remainder;
  for (int k = 0; k < hint_count; ++k) {
    if (cells[k].columns == 0) {
      continue;
    }
    float mass[25];
    for (int c = 0; c < cells[k].columns * cells[k].rows; ++c) {
      mass[c] = 0;
    }
    float total = 0;
    for (int g = 0; g < groups; ++g) {
      int column = first_column + g % columns;
      int row = first_row + g / columns;
      color weight = 1.0;
      float last_weight = 1.0;
      if (is_random) {
        float x, y;
        float first = shift_1 + g * PLASTIC_1;
        float second = shift_2 + g * PLASTIC_2;
        footprint_sample(first - floor(first), second - floor(second), x, y);
        column = (int)floor((u + footprint.ux * x + footprint.uy * y) / level.group_u);
        row = (int)floor((v + footprint.vx * x + footprint.vy * y) / level.group_v);
      }
      else {
        /* The four blocks' middles. */
        float du = (column + 0.25) * level.group_u - u;
        float dv = (row + 0.25) * level.group_v - v;
        float right = du + block_u;
        float up = dv + block_v;
        weight = color(footprint_kernel(quu * du * du + 2.0 * quv * du * dv + qvv * dv * dv),
                       footprint_kernel(quu * right * right + 2.0 * quv * right * dv + qvv * dv * dv),
                       footprint_kernel(quu * du * du + 2.0 * quv * du * up + qvv * up * up));
        last_weight = footprint_kernel(quu * right * right + 2.0 * quv * right * up + qvv * up * up);
      }
      float group_weight = weight[0] + weight[1] + weight[2] + last_weight;
      if (group_weight > 0.0) {
        total += group_weight * block_u * block_v;
        visited += 1;
        int shift1, shift2;
        cell_shift(hints[k], cells[k], (column + 0.5) * level.group_u - u, (row + 0.5) * level.group_v - v, shift1,
                   shift2);
        int group = wrapped(row, level.rows) * level.columns + wrapped(column, level.columns);
        int texel = level.first + group * level.corners * level.corners;
        float below[6];
        for (int j = 0; j <= cells[k].rows; ++j) {
          int corner_row = clamp(cells[k].start2 + j * cells[k].stride2 + shift2, 0, level.corners - 1);
          int row_texel = texel + corner_row * level.corners;
          float left = 0;
          float left_below = 0;
          for (int i = 0; i <= cells[k].columns; ++i) {
            int index = row_texel + clamp(cells[k].start1 + i * cells[k].stride1 + shift1, 0, level.corners - 1);
            float last = 0;
            color corner = texture(map.counts.table, ((index & ((1 << level.log_width) - 1)) + 0.5) * level.inverse_width,
                                   ((index >> level.log_width) + 0.5) * level.inverse_height, 0, 0, 0, 0, "alpha", last);
            float value = dot((vector)weight, (vector)corner) + last_weight * last;
            if (i > 0 && j > 0) {
              mass[(j - 1) * cells[k].columns + i - 1] += value - left - below[i] + left_below;
            }
            left_below = below[i];
            below[i] = value;
            left = value;
          }
        }
        map.fetches += (cells[k].columns + 1) * (cells[k].rows + 1);
      }
    }

    /* Spread of a cell, in slopes around the half vector, and of a group's turn. */
    float inverse = 1.0 / (cells[k].a11 * cells[k].a22 - cells[k].a12 * cells[k].a21);
    float p11 = cells[k].a22 * inverse;
    float p12 = -cells[k].a12 * inverse;
    float p21 = -cells[k].a21 * inverse;
    float p22 = cells[k].a11 * inverse;
    float spread1 = cells[k].stride1 * UNIFORM_DEVIATION;
    float spread2 = cells[k].stride2 * UNIFORM_DEVIATION;
    float turn_u1 = level.group_u * UNIFORM_DEVIATION * hints[k].shift_u1;
    float turn_v1 = level.group_v * UNIFORM_DEVIATION * hints[k].shift_v1;
    float turn_u2 = level.group_u * UNIFORM_DEVIATION * hints[k].shift_u2;
    float turn_v2 = level.group_v * UNIFORM_DEVIATION * hints[k].shift_v2;
    float c11 = p11 * p11 * spread1 * spread1 + p12 * p12 * spread2 * spread2 + turn_u1 * turn_u1 + turn_v1 * turn_v1;
    float c12 = p11 * p21 * spread1 * spread1 + p12 * p22 * spread2 * spread2 + turn_u1 * turn_u2 + turn_v1 * turn_v2;
    float c22 = p21 * p21 * spread1 * spread1 + p22 * p22 * spread2 * spread2 + turn_u2 * turn_u2 + turn_v2 * turn_v2;
    vector bin = (map.counts.high - map.counts.low) / (level.corners - 1.0);
    for (int j = 0; j < cells[k].rows; ++j) {
      for (int i = 0; i < cells[k].columns; ++i) {
        float w = mass[j * cells[k].columns + i] / total;
        if (w > 0.0 && cell_is_selected(cells, k, i, j)) {
          if (w < LEAST_WEIGHT) {
            w = (float)hashnoise(point(shift_1, shift_2, k * 25 + j * cells[k].columns + i)) * LEAST_WEIGHT < w ?
                    LEAST_WEIGHT : 0.0;
          }
          vector slope = map.counts.low + bin * vector(cells[k].start1 + (i + 0.5) * cells[k].stride1,
                                                   cells[k].start2 + (j + 0.5) * cells[k].stride2, 0.0);
          vector n = strengthened(normalize(vector(slope[0], slope[1], 1.0)), map.strength);
          float p1, p2;
          if (w > 0.0 && hint_slope(hints[k], n, 0, 0, p1, p2)) {
            /* In this order: Cycles flattens sum + x only 16 deep and drops the rest. */
            sum = w * glint_closure(distribution, hints[k], alpha, p1, p2, c11, c12, c22) + sum;
            closures += 1;
          }
        }
      }
    }
  }
  return sum;
}
