/* Far footprints: the NDF of square blocks of the map, counted over slope bins, read as masses of a few cells around
 * each half vector. The cost does not grow with the footprint. Layout: glint_addon/bake/counts.py, which writes it.
 *
 * A group is 2 x 2 blocks, whose counts share one texel; a texel holds how many elements lie below a corner of the bins
 * (a summed-area table: Crow 1984), so that four fetches give the mass of any cell of any size in four blocks. The
 * selection is a set of whole bins; the remainder leaves out exactly these (hit_is_counted), so nothing is lost or
 * counted twice, wherever the cells lie.
 *
 * Measured and why this won: a sample costs 8 to 16 us whatever the footprint (a fetch of a corner 50 ns, most of them cache
 * misses), where enumeration (query.h) of 4096 elements costs 200 and of a random subset leaves noise. Against exact elements
 * where they begin, error at 4 samples times: bumps of 2,200 texels a footprint 0.23 in 14 us instead of 0.17 in 124, flakes of
 * 5,700 0.09 in 13 us instead of 0.05 in 64. What it gives up, as relative RMSE of the NDF of one footprint of radius
 * R, alpha 0.01, slope deviation 0.15, by numpy: blocks of R / 3 with exact slopes 3 to 4 %, of R / 1.5 6 to 9 %; bins of
 * 0.66 alpha with an exact kernel 4 % at R = 96 and 7 % at 48 (flakes), 1 and 2 % (bumps 8 texels wide); bins of 2 alpha
 * 8 and 18 %, 5 and 12 %. Blocks of R / 3 whose bins are that narrow would take 100 bytes a texel at R = 96.
 */

#define COUNTS_MAGIC 7927.0
/* Largest side in texels of blocks of which two groups share texels: a number is a + PACKED_STEP b. */
#define PACKED 64
#define PACKED_STEP 4096.0

/* Largest side of a block relative to the footprint's short semi-axis: wider blocks see more of the map than the footprint.
 * The first level serves nearer footprints too, rather than none. Error of a single glint at 4, 16, 64 samples with exact
 * elements 0.44, 0.22, 0.12, by numpy, of blocks of 0.5, 0.7, 1.0 semi-axes: 0.46, 0.29, 0.19; 0.50, 0.34, 0.24; 0.57, 0.42,
 * 0.31. (With a kernel narrower by the blocks' own spread it was 0.87, 0.52, 0.31 with 0.7: see blocks_under.) */
#define FAR_SIDE 0.7
#define FAR_SIDE_FIRST 1.0
/* Larger still where the other answer would be a random subset: footprints so long that blocks see too much on their narrow
 * side alone. Brushed metal at a grazing view, 16 samples: error 0.136, 16 us a sample; with the subset 0.200, 860 us. */
#define FAR_SIDE_SUBSET 2.5
/* Groups that should lie under a footprint; beyond, larger blocks are taken, up to FAR_SIDE_LONG short semi-axes wide. */
#define FAR_GROUPS 16
#define FAR_SIDE_LONG 2.0
/* Groups that lie under a footprint at most, twice FAR_GROUPS; of more as many as that at random. */
#define MOST_GROUPS 32
/* Groups that a sample reads of those: each costs 1 to 2 us, and most lie on the kernel's rim. Error at 4 samples, us a sample,
 * of all, 4, 3, 2 groups: flakes of 10^5 texels a pixel 0.037, 21.6; 0.038, 16.2; 0.043, 14; 0.052, 12; scratches on a ball
 * 0.534, 14.2; 0.587, 8.8; 0.568, 8; 0.791, 6.7; bumps of 8 bits 0.231, 15.9; 0.233, 12.7; 0.246, 11; 0.285, 10. At 16 samples
 * the scratches have 0.192, 0.199, 0.260, 0.300. */
#define DRAWN_GROUPS 4
/* Fewest bins from the middle of a hint's region to its rim: a bin is then no wider than 1.4 or, on smooth maps whose
 * slopes spread evenly over it, 2.2 times the lobe. With 2.5 times (FAR_REACH_LINEAR 1.0), bumps of 4,400 texels a pixel are
 * 0.95 % too dim. */
#define FAR_REACH_CLOSEST 1.75
#define FAR_REACH_LINEAR 1.15
/* Widths of a cell, relative to alpha, between which its spread goes from -1/12 of its square to 1/12. A mass in the
 * cell's middle stands for facets spread evenly over it, and shows twice the spread wherever cells happen to lie, so a
 * narrow cell's closure is narrower than a facet's lobe by that much; where cells are wide gaps between their lobes would
 * show. Mean error and what depends on the cells' places, random slopes of deviation 3 alpha, by numpy: 1 alpha wide
 * 0.0 %, 0.15 %; 1.4 alpha with -1/12 0.2 %, 11 %, with 0 -1.5 %, 2.5 %, with 1/12 -3.0 %, 0.6 %. */
#define CELL_NARROW 1.1
#define CELL_WIDE 2.0
/* Largest turn within the footprint relative to a hint's region: beyond, the turn within a block would make one closure as
 * wide as the view changes (measured: a third of the light lost in a view of 170 degrees). */
#define FAR_TURN 2.0
/* And where a footprint has more than LARGEST_VISIT elements, it is made smaller until it turns no more than this: as it turns
 * it blurs the highlight of whatever is flat. Scratches on a ball, 10^4 texels a pixel, error at 4 and 16 samples: 0.60, 0.43
 * with 2 and with 0.5, 0.53, 0.19 with 0.25, 0.58, 0.20 with 0.12; flakes, 10^5, which have nothing flat: 0.028, 0.017 with
 * 2, 0.037, 0.018 with 0.25, 0.069, 0.037 with 0.12. Not of a pixel's only sample, which lies in its middle: there the
 * footprint is the pixel's filter (scratches 0.74 with FAR_TURN, 1.0 with 0.25). */
#define SPARE_TURN 0.25
/* Share of a hint's mass that makes a cell stand out. */
#define PEAK_SHARE 0.3
/* Least height of a half vector above the surface (cosine) for which slopes are counted. */
#define LEAST_HEIGHT 0.05

/* Cells of a hint that serve: narrower ones than this (alpha) change nothing. */
#define CELL_FINE 0.9
/* Most cells across a region along one slope; cells of a hint at most, and corners along a side of them: lay_cells makes up
 * to two more than there are across, far_cells_of no more than 10 x 5 or 7 x 7. */
#define MOST_ACROSS 8.0
#define MOST_CELLS 50
#define MOST_CELL_CORNERS 11

/* One level of the counts, in use. */
struct Level {
  int block;    /* side in texels of a block; 0: none */
  int corners;  /* a side of the summed-area table: one more than bins */
  int columns;  /* groups along u and v */
  int rows;
  int first;    /* texel of its first corner */
  float group_u; /* texels, side of a group */
  float group_v;
  float unit;    /* elements that a step of a packed count stands for; 0: not packed */
  int log_width; /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

/* Corners along one side; twin: corners() of the bake. */
int level_corners(int block, int is_linear)
{
  if (is_linear) {
    return block <= 16 ? 28 : block <= 32 ? 46 : block <= 64 ? 64 : block <= 128 ? 90 : block <= 256 ? 128 : block <= 512 ? 160 : 192;
  }
  return block <= 32 ? 56 : block <= 64 ? 88 : block <= 128 ? 120 : block <= 256 ? 168 : block <= 512 ? 192 : 208;
}

/* Groups of blocks of that side along `size` texels. */
int level_groups(int size, int block)
{
  return max((size + block) / (2 * block), 1);
}

/* Texels of all levels before the one with blocks of that side. */
int texels_before(Counts counts, int block, int width, int height, int is_linear)
{
  int texels = 0;
  for (int side = counts.first; side < block; side *= 2) {
    int corners = level_corners(side, is_linear);
    int groups = level_groups(width, side) * level_groups(height, side);
    texels += (side <= PACKED ? (groups + 1) / 2 : groups) * corners * corners;
  }
  return texels;
}

/* The level with blocks of that side. The texture's sides are powers of two, as nearly alike as they can be. */
Level counts_level(Counts counts, int block, int width, int height, int is_linear)
{
  Level level;
  level.block = block;
  level.first = texels_before(counts, block, width, height, is_linear);
  level.corners = level_corners(block, is_linear);
  level.columns = level_groups(width, block);
  level.rows = level_groups(height, block);
  level.group_u = width / (float)level.columns;
  level.group_v = height / (float)level.rows;
  level.unit = 0.0;
  if (block <= PACKED) {
    int columns = 2 * level.columns;
    int rows = 2 * level.rows;
    level.unit = (width + columns - 1) / columns * ((height + rows - 1) / rows) / (PACKED_STEP - 1.0);
  }
  int texels = texels_before(counts, counts.first << counts.levels, width, height, is_linear) + 1; /* and the header */
  list_shape(texels, level.log_width, level.inverse_width, level.inverse_height);
  return level;
}

/* A texel of the list; its rows lie from the top down, as in the file. */
color counts_texel(Counts counts, Level level, int texel, output float last)
{
  return texture(counts.table, ((texel & ((1 << level.log_width) - 1)) + 0.5) * level.inverse_width,
                 1.0 - ((texel >> level.log_width) + 0.5) * level.inverse_height, 0, 0, 0, 0, "alpha", last);
}

/* Whether the table is there, is the one that `counts` tells of, and is whole (see table_is_intact): the header lies at the
 * file's end. */
int counts_are_intact(Counts counts, Level level)
{
  color header = texture(counts.table, 1.0 - 0.5 * level.inverse_width, 0.5 * level.inverse_height, 0, 0, 0, 0);
  return header[0] == COUNTS_MAGIC && header[1] == counts.first && header[2] == counts.levels;
}

/* Side of the blocks for a footprint; 0: too near for the counts, whose blocks may be `widest` short semi-axes wide. */
int far_block(Counts counts, Footprint footprint, float widest)
{
  int block = counts.first;
  int last = counts.first << (counts.levels - 1);
  float u_side = 2.0 * hypot(footprint.ux, footprint.uy);
  float v_side = 2.0 * hypot(footprint.vx, footprint.vy);
  if (block == 0 || block > widest * footprint.short_axis) {
    return 0;
  }
  while (block < last && (2 * block <= FAR_SIDE * footprint.short_axis ||
                          (2 * block <= FAR_SIDE_LONG * footprint.short_axis &&
                           (u_side / (2 * block) + 1.0) * (v_side / (2 * block) + 1.0) > FAR_GROUPS))) {
    block *= 2;
  }
  return block;
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

/* Cells across a region: as many as `hints` hints may have of the closures, see cell_limit. */
float far_cells(int hints)
{
  return hints == 1 ? 5.0 : hints == 2 ? 4.0 : hints == 3 ? 3.0 : hints == 4 ? 2.5 : hints <= 6 ? 1.9 : 1.5;
}

/* Cells of one of `hints` hints at most: of a lattice of spacing d that many points lie within a circle of diameter
 * (D + 1) d, where D = far_cells(hints). */
int cell_limit(int hints)
{
  return hints == 1 ? 32 : hints == 2 ? 24 : hints == 3 ? 16 : hints == 4 ? 14 : hints == 5 ? 10 : hints == 6 ? 9 : 7;
}

/* Spread of a cell's closure along one side, relative to its square; width: of the cell, relative to alpha. */
float cell_spread(float width)
{
  return (clamp(2.0 * (width - CELL_NARROW) / (CELL_WIDE - CELL_NARROW), 0.0, 2.0) - 1.0) / 12.0;
}

/* Parts along one side of a cell that stands out; 1: it is left whole. Together with cell_limit no more than the closures
 * hold: 31 + 25, 2 (23 + 4), 3 (15 + 4). */
int peak_parts(int hints)
{
  return hints == 1 ? 5 : hints <= 3 ? 2 : 1;
}

/* The part of a region that may hold slopes: of centre - reach to centre + reach, in bins of a level, what lies in the box
 * of all slopes, moved by up to `turn`. Returns its length. */
float region_span(float centre, float reach, float turn, int corners, output int first, output int last)
{
  float from = max(centre - reach, -turn);
  float to = min(centre + reach, corners - 1.0 + turn);
  first = (int)floor(from);
  last = (int)floor(to);
  return max(to - from, 0.0);
}

/* Lay the cells of a hint along one slope, over the bins `first` to `last`. shift: uniform in 0..1, where in a cell the first
 * bin lies: the sum of the cells' lobes is a little higher at their middles, by 3 % where they are 2 alpha wide. */
void lay_cells(int first, int last, int cell, float shift, output int count, output int start)
{
  start = first - (int)(shift * cell);
  count = (last - start) / cell + 1;
}

/* Radius of a hint's region in the plane of incidence. */
float region_inward(HalfVector hint, float alpha)
{
  float region = REGION * alpha;
  return region + (hint.radius - region) * dot(hint.h, I);
}

/* Whether the middle of cell (i, j) lies within half a cell of the region. */
int cell_is_within(Cells cells, int i, int j)
{
  float x = (cells.start1 + (i + 0.5) * cells.stride1 - cells.centre1) / (cells.reach1 + 0.5 * cells.stride1);
  float y = (cells.start2 + (j + 0.5) * cells.stride2 - cells.centre2) / (cells.reach2 + 0.5 * cells.stride2);
  return x * x + y * y < 1.0;
}

int cells_within(Cells cells)
{
  int found = 0;
  for (int c = 0; c < cells.columns * cells.rows; ++c) {
    found += cell_is_within(cells, c % cells.columns, c / cells.columns);
  }
  return found;
}

/* The cells around one hint, by the dual basis of its three forms. */
Cells far_cells_of(HalfVector hint, float alpha, int hint_count, Counts counts, Level level, float strength, vector shift)
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
  cells.start1 = 0;
  cells.start2 = 0;
  cells.stride1 = 1;
  cells.stride2 = 1;
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
  /* The region: an ellipse, because an angle between lights is one between half vectors of half as much in the plane of
   * incidence, of more across (see half_vector). */
  float inward = region_inward(hint, alpha);
  float x = dot(hint.t1, I);
  float y = dot(hint.t2, I);
  float scale = 1.0 / max(hypot(x, y), 1e-6);
  x *= scale;
  y *= scale;
  cells.reach1 = hypot(inward * (x * cells.a11 + y * cells.a12), hint.radius * (x * cells.a12 - y * cells.a11));
  cells.reach2 = hypot(inward * (x * cells.a21 + y * cells.a22), hint.radius * (x * cells.a22 - y * cells.a21));
  /* As many cells as serve along each slope: no more than there are bins, none narrower than CELL_FINE. What one slope
   * spares the other may have. Streaks along the view at eighty degrees, whose slopes are 60 times as wide one way, 4
   * samples: with as many cells, as wide spread, both ways the highlight's middle was 8.5 % too dim and its rims up to 86 %
   * too bright (error 0.207); with a spread of its own for each slope 1.6 % (0.191), with this too within 1 % (0.182). */
  float alphas = CELL_FINE * max(alpha, 1e-6) * abs(cells.a11 * cells.a22 - cells.a12 * cells.a21);
  float bins1 = max(alphas / hypot(cells.a21, cells.a22), 1.0);
  float bins2 = max(alphas / hypot(cells.a11, cells.a12), 1.0);
  int first1, last1, first2, last2;
  float turn1 = hint.turn * hypot(cells.a11, cells.a12) + 1.0;
  float turn2 = hint.turn * hypot(cells.a21, cells.a22) + 1.0;
  float span1 = region_span(cells.centre1, cells.reach1, turn1, level.corners, first1, last1);
  float span2 = region_span(cells.centre2, cells.reach2, turn2, level.corners, first2, last2);
  float across = far_cells(hint_count);
  float across1 = min(across, span1 / bins1);
  float across2 = min(across, span2 / bins2);
  float all = (across + 1.0) * (across + 1.0);
  cells.stride1 = (int)ceil(max(span1 / min(all / (across2 + 1.0) - 1.0, MOST_ACROSS), bins1));
  cells.stride2 = (int)ceil(max(span2 / min(all / (across1 + 1.0) - 1.0, MOST_ACROSS), bins2));
  if (span1 > 0.0 && span2 > 0.0) {
    int limit = cell_limit(hint_count);
    for (int selected = limit + 1; selected > limit;) {
      lay_cells(first1, last1, cells.stride1, shift[0], cells.columns, cells.start1);
      lay_cells(first2, last2, cells.stride2, shift[1], cells.rows, cells.start2);
      selected = cells_within(cells);
      /* Where the box cuts the region more of them are: widen those of which there are more. */
      if (selected > limit && cells.columns > cells.rows) {
        cells.stride1 += 1 + cells.stride1 / 8;
      }
      else if (selected > limit) {
        cells.stride2 += 1 + cells.stride2 / 8;
      }
    }
  }
  return cells;
}

/* Whether the counts answer for the footprint: by the first level, from the one for its size on, whose bins are narrow enough
 * for all hints. Finds the level and the cells of each hint there. widest: see far_block. */
int counts_serve(output Map map, HalfVector hints[8], int hint_count, int lobes, float alpha, Footprint footprint,
                 float widest, vector shift, output Level level, output Cells cells[8])
{
  int from = far_block(map.counts, footprint, widest);
  /* Larger blocks have narrower bins. Bumps of slope 0.15, alpha 0.01, 4,096 texels a footprint: 12 instead of 225 us. They
   * blur the picture: of 2,000 texels a pixel error at 4 samples 0.27 instead of 0.15, of 1,000 at one sample 0.43 instead of 0.07. */
  int last = from;
  int largest = map.counts.first << (map.counts.levels - 1);
  float limit = (widest == FAR_SIDE_FIRST ? FAR_SIDE_LONG : 2.0 * widest) * footprint.short_axis;
  while (from > 0 && last < largest && 2 * last <= limit) {
    last *= 2;
  }
  int fits = 0;
  for (int block = from; block > 0 && block <= last && !fits; block *= 2) {
    level = counts_level(map.counts, block, map.width, map.height, map.is_linear);
    float least = 1e30;
    for (int k = 0; k < hint_count; ++k) {
      cells[k] = far_cells_of(hints[k], alpha, hint_count * lobes, map.counts, level, map.strength, shift);
      if (cells[k].columns > 0) {
        least = hints[k].turn > FAR_TURN * hints[k].radius ? 0.0 : min(least, min(cells[k].reach1, cells[k].reach2));
      }
    }
    fits = least > (map.is_linear ? FAR_REACH_LINEAR : FAR_REACH_CLOSEST);
  }
  map.fetches += fits;
  return fits && counts_are_intact(map.counts, level);
}

/* Whether cell (i, j) of hint k is selected: it lies in or beside the region, and no earlier hint's cells touch
 * it, or elements would count twice. */
int cell_is_selected(Cells cells[8], int k, int i, int j)
{
  float low1 = cells[k].start1 + i * cells[k].stride1;
  float low2 = cells[k].start2 + j * cells[k].stride2;
  int selected = cell_is_within(cells[k], i, j);
  for (int h = 0; h < k && selected; ++h) {
    selected = cells[h].columns == 0 || low1 >= cells[h].start1 + cells[h].columns * cells[h].stride1 ||
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

/* The groups under a footprint, and what their blocks weigh. */
struct Blocks {
  float u;      /* the hit's texel coordinates */
  float v;
  float side_u; /* of a block */
  float side_v;
  /* The kernel's ellipse quu du^2 + 2 quv du dv + qvv dv^2 < 1. */
  float quu;
  float quv;
  float qvv;
  int first_column;
  int first_row;
  int columns;
  int groups;    /* to visit */
  int is_random; /* groups at random points of the footprint stand for all, because there are too many */
  int is_thin;   /* and of each group only the block at the point, because the footprint is thinner than a group */
};

/* The groups that a sample reads, and the weights of their four blocks, the last apart. */
struct Groups {
  int count;
  int column[MOST_GROUPS];
  int row[MOST_GROUPS];
  color weight[MOST_GROUPS];
  float last[MOST_GROUPS];
  float total; /* of all weights, whichever groups are drawn */
};

/* A block weighs the kernel's mean over it: what the kernel, wider by a block's own spread, is at its middle. */
Blocks blocks_under(Level level, Footprint footprint, float u, float v)
{
  Blocks blocks;
  blocks.u = u;
  blocks.v = v;
  blocks.side_u = 0.5 * level.group_u;
  blocks.side_v = 0.5 * level.group_v;
  float own = 1.0 / (12.0 * KERNEL_VARIANCE);
  float suu = footprint.ux * footprint.ux + footprint.uy * footprint.uy + own * blocks.side_u * blocks.side_u;
  float suv = footprint.ux * footprint.vx + footprint.uy * footprint.vy;
  float svv = footprint.vx * footprint.vx + footprint.vy * footprint.vy + own * blocks.side_v * blocks.side_v;
  float determinant = suu * svv - suv * suv;
  blocks.quu = svv / determinant;
  blocks.quv = -suv / determinant;
  blocks.qvv = suu / determinant;
  float reach_u = sqrt(suu) - 0.5 * blocks.side_u;
  float reach_v = sqrt(svv) - 0.5 * blocks.side_v;
  blocks.first_column = (int)floor((u - reach_u) / level.group_u);
  blocks.first_row = (int)floor((v - reach_v) / level.group_v);
  blocks.columns = (int)floor((u + reach_u) / level.group_u) - blocks.first_column + 1;
  int rows = (int)floor((v + reach_v) / level.group_v) - blocks.first_row + 1;
  /* A product of floats: of very far footprints an int overflows. */
  blocks.is_random = (float)blocks.columns * rows > MOST_GROUPS;
  blocks.is_thin = max(blocks.side_u, blocks.side_v) > footprint.short_axis;
  blocks.groups = !blocks.is_random ? blocks.columns * rows : level.columns * level.rows == 1 ? 1 : FAR_GROUPS;
  return blocks;
}

/* Place of the g-th group, and the weights of its four blocks, the last apart. shift: uniform numbers of this sample. */
color block_weights(Blocks blocks, Level level, Footprint footprint, int g, vector shift, output int column, output int row,
                    output float last)
{
  if (blocks.is_random) {
    float x, y;
    float a = shift[0] + g * PLASTIC_1;
    float b = shift[1] + g * PLASTIC_2;
    footprint_sample(a - floor(a), b - floor(b), x, y);
    float place_u = (blocks.u + footprint.ux * x + footprint.uy * y) / level.group_u;
    float place_v = (blocks.v + footprint.vx * x + footprint.vy * y) / level.group_v;
    column = (int)floor(place_u);
    row = (int)floor(place_v);
    if (blocks.is_thin) {
      int block = (place_u - column < 0.5 ? 0 : 1) + (place_v - row < 0.5 ? 0 : 2);
      last = block == 3;
      return color(block == 0, block == 1, block == 2);
    }
    last = 1.0;
    return color(1.0);
  }
  column = blocks.first_column + g % blocks.columns;
  row = blocks.first_row + g / blocks.columns;
  float left = (column + 0.25) * level.group_u - blocks.u;
  float low = (row + 0.25) * level.group_v - blocks.v;
  float right = left + blocks.side_u;
  float high = low + blocks.side_v;
  float cross_low = 2.0 * blocks.quv * low;
  float cross_high = 2.0 * blocks.quv * high;
  float square_low = blocks.qvv * low * low;
  float square_high = blocks.qvv * high * high;
  last = footprint_kernel(blocks.quu * right * right + cross_high * right + square_high);
  return color(footprint_kernel(blocks.quu * left * left + cross_low * left + square_low),
               footprint_kernel(blocks.quu * right * right + cross_low * right + square_low),
               footprint_kernel(blocks.quu * left * left + cross_high * left + square_high));
}

/* Weight from which on a group is always read, so that DRAWN_GROUPS of `count` are: 0 if there are no more. */
float sure_weight(float weights[MOST_GROUPS], int count, float total)
{
  float sure = count > DRAWN_GROUPS ? total / DRAWN_GROUPS : 0.0;
  int before = 0;
  for (int larger = sure > 0.0; larger > 0;) {
    /* The larger ones are read anyway; the others share what is left. */
    int large = 0;
    float rest = total;
    for (int g = 0; g < count; ++g) {
      large += weights[g] > sure;
      rest -= weights[g] > sure ? weights[g] : 0.0;
    }
    sure = rest / (DRAWN_GROUPS - large);
    larger = large - before;
    before = large;
  }
  return sure;
}

/* Draw the groups to read of those under a footprint. Their weights add up to that of all, so a map that is alike everywhere
 * looks the same whichever are drawn. */
Groups drawn_groups(Blocks blocks, Level level, Footprint footprint, vector shift)
{
  Groups groups;
  groups.count = 0;
  groups.total = 0;
  float weights[MOST_GROUPS];
  for (int g = 0; g < blocks.groups; ++g) {
    int column, row;
    float last;
    color weight = block_weights(blocks, level, footprint, g, shift, column, row, last);
    float sum = weight[0] + weight[1] + weight[2] + last;
    if (sum > 0.0) {
      weights[groups.count] = sum;
      groups.column[groups.count] = column;
      groups.row[groups.count] = row;
      groups.weight[groups.count] = weight;
      groups.last[groups.count] = last;
      groups.count += 1;
      groups.total += sum;
    }
  }
  float sure = blocks.is_random ? 0.0 : sure_weight(weights, groups.count, groups.total);
  float due = shift[2];
  int drawn = 0;
  for (int g = 0; g < groups.count; ++g) {
    float weight = weights[g];
    if (is_drawn(sure, due, weight)) {
      groups.column[drawn] = groups.column[g];
      groups.row[drawn] = groups.row[g];
      groups.weight[drawn] = weight / weights[g] * groups.weight[g];
      groups.last[drawn] = weight / weights[g] * groups.last[g];
      drawn += 1;
    }
  }
  groups.count = drawn;
  return groups;
}

/* Cells blur: a mass stands in its cell's middle, and its closure is spread over the cell. Undo it to second order by moving
 * mass between neighbours towards the heavier: with a sun of 20 degrees and bumps of slope 0.15 the light at the peak of the
 * slopes was 3.3 % too dim. spread: of a cell's closure, see CELL_NARROW; a cell gives no more than LARGEST_GIFT a side, a
 * quarter, so that four leave nothing below 0. Mean of bumps of alpha 0.05, 730 and 1,300 texels a pixel, where cells differ
 * most: -1.06 and -0.62 % with 0.125, -0.71 and -0.36 % with 0.25. */
#define LARGEST_GIFT 0.25
void sharpen_cells(Cells cells[8], int k, int columns, int rows, float spread1, float spread2,
                   output float mass[MOST_CELLS])
{
  float sharp[MOST_CELLS];
  for (int c = 0; c < columns * rows; ++c) {
    sharp[c] = mass[c];
  }
  for (int c = 0; c < columns * rows; ++c) {
    if (cell_is_selected(cells, k, c % columns, c / columns)) {
      for (int side = 0; side < 2; ++side) {
        int d = side == 0 ? c + 1 : c + columns;
        int is_inside = side == 0 ? c % columns + 1 < columns : c / columns + 1 < rows;
        if (is_inside && cell_is_selected(cells, k, d % columns, d / columns)) {
          float share = (1.0 / 12.0 + (side == 0 ? spread1 : spread2)) / 2.0;
          float gift = clamp(share * (mass[c] - mass[d]), -LARGEST_GIFT * mass[c], LARGEST_GIFT * mass[d]);
          sharp[c] += gift;
          sharp[d] -= gift;
        }
      }
    }
  }
  for (int c = 0; c < columns * rows; ++c) {
    mass[c] = sharp[c];
  }
}

/* Cells of one hint, in bins: all of them, or parts of one. */
struct Grid {
  int columns;
  int rows;
  int start1;
  int start2;
  int stride1;
  int stride2;
  int end1;
  int end2;
};

/* What the blocks under a footprint hold in each cell of a grid. */
struct Masses {
  /* Sums over groups of mass, of mass times bin from the half vector, turned, and of mass times its square. */
  float mass[MOST_CELLS];
  float first1[MOST_CELLS];
  float first2[MOST_CELLS];
  float square1[MOST_CELLS];
  float square2[MOST_CELLS];
  float spread_u; /* variance of a group's texels, along u and v */
  float spread_v;
};

/* Read one group: add what it holds in each cell. weight, last: of its four blocks; shift1, shift2: bins by which its cells
 * move; turned1, turned2: what to add to a bin to get the place around the half vector. */
void add_group(Counts counts, Level level, int group, color weight, float last_weight, Grid grid, int shift1, int shift2,
               float turned1, float turned2, float spread1, float spread2, output Masses m)
{
  int is_packed = level.unit > 0.0;
  int texel = level.first + (is_packed ? group / 2 : group) * level.corners * level.corners;
  float below[MOST_CELL_CORNERS];
  int corner_below = 0;
  for (int j = 0; j <= grid.rows; ++j) {
    int corner_row = clamp(min(grid.start2 + j * grid.stride2, grid.end2) + shift2, 0, level.corners - 1);
    int row_texel = texel + corner_row * level.corners;
    float y = 0.5 * (corner_below + corner_row) + turned2;
    float y2 = y * y + spread2 * (corner_row - corner_below) * (corner_row - corner_below);
    float left = 0;
    float left_below = 0;
    int corner_left = 0;
    for (int i = 0; i <= grid.columns; ++i) {
      int corner_column = clamp(min(grid.start1 + i * grid.stride1, grid.end1) + shift1, 0, level.corners - 1);
      float last = 0;
      color corner = counts_texel(counts, level, row_texel + corner_column, last);
      if (is_packed) {
        color second = floor(corner / PACKED_STEP);
        float second_last = floor(last / PACKED_STEP);
        corner = group & 1 ? second : corner - PACKED_STEP * second;
        last = group & 1 ? second_last : last - PACKED_STEP * second_last;
      }
      float value = dot((vector)weight, (vector)corner) + last_weight * last;
      if (i > 0 && j > 0) {
        float found = value - left - below[i] + left_below;
        if (found > 0.0) {
          int c = (j - 1) * grid.columns + i - 1;
          float x = 0.5 * (corner_left + corner_column) + turned1;
          m.mass[c] += found;
          m.first1[c] += found * x;
          m.first2[c] += found * y;
          m.square1[c] += found * (x * x + spread1 * (corner_column - corner_left) * (corner_column - corner_left));
          m.square2[c] += found * y2;
        }
      }
      left_below = below[i];
      below[i] = value;
      left = value;
      corner_left = corner_column;
    }
    corner_below = corner_row;
  }
}

/* Masses of a grid's cells over the groups. */
void grid_masses(output Map map, Level level, HalfVector hint, Cells cells, Blocks blocks, Groups groups, Grid grid,
                 float spread1, float spread2, output Masses m, output int visited)
{
  for (int c = 0; c < grid.columns * grid.rows; ++c) {
    m.mass[c] = 0;
    m.first1[c] = 0;
    m.first2[c] = 0;
    m.square1[c] = 0;
    m.square2[c] = 0;
  }
  m.spread_u = 0;
  m.spread_v = 0;
  float unit = level.unit > 0.0 ? level.unit : 1.0;
  for (int g = 0; g < groups.count; ++g) {
    color weight = groups.weight[g];
    float last = groups.last[g];
    float sum = weight[0] + weight[1] + weight[2] + last;
    float middle_u = (groups.column[g] + 0.5) * level.group_u - blocks.u;
    float middle_v = (groups.row[g] + 0.5) * level.group_v - blocks.v;
    int shift1, shift2;
    cell_shift(hint, cells, middle_u, middle_v, shift1, shift2);
    /* What is seen of the group is turned by the mean of its blocks, and spread around it. */
    float right_share = (weight[1] + last) / sum;
    float up_share = (weight[2] + last) / sum;
    middle_u += (right_share - 0.5) * blocks.side_u;
    middle_v += (up_share - 0.5) * blocks.side_v;
    float turn1 = middle_u * hint.shift_u1 + middle_v * hint.shift_v1;
    float turn2 = middle_u * hint.shift_u2 + middle_v * hint.shift_v2;
    m.spread_u += sum * right_share * (1.0 - right_share);
    m.spread_v += sum * up_share * (1.0 - up_share);
    visited += 1;
    int group = wrapped(groups.row[g], level.rows) * level.columns + wrapped(groups.column[g], level.columns);
    add_group(map.counts, level, group, unit * weight, unit * last, grid, shift1, shift2,
              cells.a11 * turn1 + cells.a12 * turn2 - cells.centre1, cells.a21 * turn1 + cells.a22 * turn2 - cells.centre2,
              spread1, spread2, m);
    map.fetches += (grid.columns + 1) * (grid.rows + 1);
  }
  m.spread_u = (m.spread_u / groups.total + 1.0 / 12.0) * blocks.side_u * blocks.side_u;
  m.spread_v = (m.spread_v / groups.total + 1.0 / 12.0) * blocks.side_v * blocks.side_v;
}

/* The cell that holds so much of all that it is looked at again: there the map is flat, or scratched one way; -1: none. */
int standing_cell(Cells cells[8], int k, Grid grid, Masses m)
{
  int largest = 0;
  float all = 0;
  for (int c = 0; c < grid.columns * grid.rows; ++c) {
    all += m.mass[c];
    largest = m.mass[c] > m.mass[largest] ? c : largest;
  }
  return m.mass[largest] >= PEAK_SHARE * all && cell_is_selected(cells, k, largest % grid.columns, largest / grid.columns) ?
      largest : -1;
}

/* Sum of the closures of all cells, on top of the remainder. parts: of a cell that stands out, along a side (peak_parts);
 * (u, v): the hit's texel coordinates; shift: uniform numbers of this sample. */
closure color counts_closures(string distribution, float alpha, output Map map, Level level, HalfVector hints[8],
                              int hint_count, int parts, Cells cells[8], Footprint footprint, float u, float v,
                              vector shift, closure color remainder, output int visited, output int closures)
{
  Blocks blocks = blocks_under(level, footprint, u, v);
  Groups groups = drawn_groups(blocks, level, footprint, shift);
  closure color sum = remainder;
  for (int k = 0; k < hint_count; ++k) {
    HalfVector hint = hints[k];
    /* Slope around the half vector per bin. */
    float inverse = 1.0 / (cells[k].a11 * cells[k].a22 - cells[k].a12 * cells[k].a21);
    float p11 = cells[k].a22 * inverse;
    float p12 = -cells[k].a12 * inverse;
    float p21 = -cells[k].a21 * inverse;
    float p22 = cells[k].a11 * inverse;

    /* Once over the hint's cells, and once more over parts of the one that holds most, if it stands out. */
    Grid grid;
    grid.columns = cells[k].columns;
    grid.rows = cells[k].rows;
    grid.start1 = cells[k].start1;
    grid.start2 = cells[k].start2;
    grid.stride1 = cells[k].stride1;
    grid.stride2 = cells[k].stride2;
    grid.end1 = grid.start1 + grid.columns * grid.stride1;
    grid.end2 = grid.start2 + grid.rows * grid.stride2;
    int passes = grid.columns > 0;
    for (int pass = 0; pass < passes; ++pass) {
      float width1 = grid.stride1 * hypot(p11, p21) / max(alpha, 1e-6);
      float width2 = grid.stride2 * hypot(p12, p22) / max(alpha, 1e-6);
      float spread1 = cell_spread(width1);
      float spread2 = cell_spread(width2);
      Masses m;
      grid_masses(map, level, hint, cells[k], blocks, groups, grid, spread1, spread2, m, visited);
      int standing = pass == 0 && grid.stride1 * grid.stride2 > 1 && parts > 1 ? standing_cell(cells, k, grid, m) : -1;
      float seen[MOST_CELLS];
      for (int c = 0; c < grid.columns * grid.rows; ++c) {
        seen[c] = m.mass[c];
      }
      if (pass == 0 && standing < 0 && max(spread1, spread2) > -1.0 / 12.0) {
        sharpen_cells(cells, k, grid.columns, grid.rows, spread1, spread2, seen);
      }

      for (int c = 0; c < grid.columns * grid.rows; ++c) {
        float w = seen[c] / (groups.total * blocks.side_u * blocks.side_v);
        if (w > 0.0 && c != standing && (pass > 0 || cell_is_selected(cells, k, c % grid.columns, c / grid.columns))) {
          w = roulette(w, shift[0], shift[1], (2 * k + pass) * MOST_CELLS + c);
          if (w > 0.0) {
            float x = m.first1[c] / m.mass[c];
            float y = m.first2[c] / m.mass[c];
            float xx = m.square1[c] / m.mass[c] - x * x;
            float yy = m.square2[c] / m.mass[c] - y * y;
            float p1 = p11 * x + p12 * y;
            float p2 = p21 * x + p22 * y;
            float c11 = p11 * p11 * xx + p12 * p12 * yy + m.spread_u * hint.shift_u1 * hint.shift_u1 +
                        m.spread_v * hint.shift_v1 * hint.shift_v1;
            float c12 = p11 * p21 * xx + p12 * p22 * yy + m.spread_u * hint.shift_u1 * hint.shift_u2 +
                        m.spread_v * hint.shift_v1 * hint.shift_v2;
            float c22 = p21 * p21 * xx + p22 * p22 * yy + m.spread_u * hint.shift_u2 * hint.shift_u2 +
                        m.spread_v * hint.shift_v2 * hint.shift_v2;
            /* Where a cell is a wide bin, gaps between lobes must not stay where they are: the half vector may. */
            float x_shift = grid.stride1 == 1 && width1 > CELL_NARROW ? shift[0] - 0.5 : 0.0;
            float y_shift = grid.stride2 == 1 && width2 > CELL_NARROW ? shift[1] - 0.5 : 0.0;
            p1 += p11 * x_shift + p12 * y_shift;
            p2 += p21 * x_shift + p22 * y_shift;
            /* In this order: Cycles flattens sum + x only 16 deep and drops the rest. */
            w *= merged_reflection(hint, alpha, p1, p2, c11, c12, c22);
            sum = w * glint_closure(distribution, hint, alpha, p1, p2, c11, c12, c22) + sum;
            closures += 1;
          }
        }
      }
      if (standing >= 0) {
        passes = 2;
        grid.start1 += standing % grid.columns * grid.stride1;
        grid.start2 += standing / grid.columns * grid.stride2;
        grid.end1 = grid.start1 + grid.stride1;
        grid.end2 = grid.start2 + grid.stride2;
        grid.stride1 = (int)ceil(grid.stride1 / (float)parts);
        grid.stride2 = (int)ceil(grid.stride2 / (float)parts);
        grid.columns = (grid.end1 - grid.start1 + grid.stride1 - 1) / grid.stride1;
        grid.rows = (grid.end2 - grid.start2 + grid.stride2 - 1) / grid.stride2;
      }
    }
  }
  return sum;
}
