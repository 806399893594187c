/* Far footprints: the normal distribution (NDF) of square blocks of the map, counted over bins of slope. A sample reads
 * how many elements lie in a few cells of bins around each half vector, so its cost does not grow with the footprint:
 * decisions 16, 17 and 29. Layout: glint_addon/bake/counts.py, which writes the table.
 *
 * A group is 2 x 2 blocks, whose counts share one texel. A texel holds how many elements lie below a corner of the bins
 * (a summed-area table: Crow 1984), so four fetches give the number of elements in any rectangle of bins, for four
 * blocks. A cell is a rectangle of whole bins. The selection is the cells of all half vectors, and the remainder leaves
 * out exactly their bins (hit_is_counted), so no element is lost or counted twice, wherever the cells lie.
 */

#define COUNTS_MAGIC 7927.0
/* Up to this side in texels of a block two groups share texels: a stored number is a + PACKED_STEP b. */
#define PACKED 64
#define PACKED_STEP 4096.0

/* Largest side of a block, in short semi-axes of the footprint: a wider block shows more of the map than the footprint
 * covers: decision 18. Blocks of the first level may be as wide as FAR_SIDE_FIRST, because no smaller blocks exist. */
#define FAR_SIDE 0.7
#define FAR_SIDE_FIRST 1.0
/* The same limit where the other answer is a random subset of elements, which is noisier and slower: decision 20. */
#define FAR_SIDE_SUBSET 2.5
/* If more groups than this lie under a footprint, larger blocks are read, up to FAR_SIDE_LONG short semi-axes wide. */
#define FAR_GROUPS 16
#define FAR_SIDE_LONG 2.0
/* Most groups under a footprint, twice FAR_GROUPS. Where more lie there, FAR_GROUPS groups at random points stand for
 * all. */
#define MOST_GROUPS 32
/* Groups that a sample reads of those under its footprint: most others lie on the kernel's rim and weigh little:
 * decision 22. */
#define DRAWN_GROUPS 4
/* Fewest bins from the middle of a hint's region to its rim: a bin is then no wider than 1.4 lobes (Closest) or 2.2
 * lobes (Linear, whose slopes spread evenly over a bin); wider bins lose light: decision 23. */
#define FAR_REACH_CLOSEST 1.75
#define FAR_REACH_LINEAR 1.15
/* Widths of a cell, in alpha, between which the spread of its closure goes from -1/12 to 1/12 of the squared width.
 * Facets lie evenly over a cell, at a random place in it, so a closure in the cell's middle shows twice their spread: a
 * narrow cell's closure is made narrower than a facet's lobe by as much. Where cells are wide, gaps between their
 * closures would show: decision 24. */
#define CELL_NARROW 1.1
#define CELL_WIDE 2.0
/* Largest turn within the footprint, relative to a hint's region: with more, the slopes of one block turn so far that
 * its closure loses light: decision 25. */
#define FAR_TURN 2.0
/* A footprint of more than LARGEST_VISIT elements is made smaller until it turns no more than this, because a turn
 * blurs the highlight of flat parts of the map: decision 5. A pixel's only sample is left as wide as the pixel's
 * filter. */
#define SPARE_TURN 0.25
/* A cell that holds more than this share of all elements near a hint is a peak, and is read a second time in parts. */
#define PEAK_SHARE 0.3
/* Least height of a half vector above the surface (cosine) for which slopes are counted. */
#define LEAST_HEIGHT 0.05

/* Least width of a cell, in alpha: narrower cells give the same picture. */
#define CELL_FINE 0.9
/* Most cells across a region along one slope, most cells of a hint, and most corners along a side of its cells:
 * lay_cells lays up to two cells more than lie across the region, and far_cells_of no more than 10 x 5 or 7 x 7. */
#define MOST_ACROSS 8.0
#define MOST_CELLS 50
#define MOST_CELL_CORNERS 11

/* The level of the counts that a sample reads. */
struct Level {
  int block;    /* side in texels of a block; 0: none */
  int corners;  /* along a side of the summed-area table: one more than bins */
  int columns;  /* groups along u and v */
  int rows;
  int first;    /* texel of its first corner */
  float group_u; /* texels, side of a group */
  float group_v;
  float unit;    /* elements for each step of a packed count; 0: counts are not packed */
  int log_width; /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

/* Corners along one side of a level's table. Twin: corners() of glint_addon/bake/counts.py. */
int level_corners(int block, int is_linear)
{
  if (is_linear) {
    return block <= 16 ? 28 : block <= 32 ? 46 : block <= 64 ? 64 : block <= 128 ? 90 : block <= 256 ? 128 : block <= 512 ? 160 : 192;
  }
  return block <= 32 ? 56 : block <= 64 ? 88 : block <= 128 ? 120 : block <= 256 ? 168 : block <= 512 ? 192 : 208;
}

/* Groups of blocks of side `block` along `size` texels. */
int level_groups(int size, int block)
{
  return max((size + block) / (2 * block), 1);
}

/* Texels of all levels before the level with blocks of side `block`. */
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

/* The level with blocks of side `block`. */
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

/* A texel of the list, whose rows lie from the top down, as in the file. fourth: its alpha channel. */
color counts_texel(Counts counts, Level level, int texel, output float fourth)
{
  return texture(counts.table, ((texel & ((1 << level.log_width) - 1)) + 0.5) * level.inverse_width,
                 1.0 - ((texel >> level.log_width) + 0.5) * level.inverse_height, 0, 0, 0, 0, "alpha", fourth);
}

/* Whether the table's file exists, has the levels that `counts` names, and is whole (see table_is_intact): the header
 * lies at the file's end. */
int counts_are_intact(Counts counts, Level level)
{
  color header = texture(counts.table, 1.0 - 0.5 * level.inverse_width, 0.5 * level.inverse_height, 0, 0, 0, 0);
  return header[0] == COUNTS_MAGIC && header[1] == counts.first && header[2] == counts.levels;
}

/* Side of the blocks to read for a footprint; 0: even the smallest block is wider than `widest` short semi-axes. */
int far_block(Counts counts, Footprint footprint, float widest)
{
  int block = counts.first;
  int largest = counts.first << (counts.levels - 1);
  float u_side = 2.0 * hypot(footprint.ux, footprint.uy);
  float v_side = 2.0 * hypot(footprint.vx, footprint.vy);
  if (block == 0 || block > widest * footprint.short_axis) {
    return 0;
  }
  while (block < largest && (2 * block <= FAR_SIDE * footprint.short_axis ||
                             (2 * block <= FAR_SIDE_LONG * footprint.short_axis &&
                              (u_side / (2 * block) + 1.0) * (v_side / (2 * block) + 1.0) > FAR_GROUPS))) {
    block *= 2;
  }
  return block;
}

/* The cells of one hint: a lattice of equal rectangles of whole bins around its half vector. */
struct Cells {
  int columns; /* cells along the first slope; 0: the half vector lies below the surface's horizon */
  int rows;    /* cells along the second slope */
  int start1;  /* lowest bin along the first slope */
  int start2;
  int stride1; /* bins along a side of a cell */
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

/* Cells across the region of each of `hints` hints, which share the closures that are drawn from all (cell_limit). */
float far_cells(int hints)
{
  return hints == 1 ? 5.0 : hints == 2 ? 4.0 : hints == 3 ? 3.0 : hints == 4 ? 2.5 : hints <= 6 ? 1.9 : 1.5;
}

/* Most cells of each of `hints` hints: so many points of a lattice of spacing d lie within a circle of diameter (D + 1)
 * d, where D = far_cells(hints). */
int cell_limit(int hints)
{
  return hints == 1 ? 32 : hints == 2 ? 24 : hints == 3 ? 16 : hints == 4 ? 14 : hints == 5 ? 10 : hints == 6 ? 9 : 7;
}

/* Variance of slopes that a cell's closure adds along one side, relative to the cell's squared width; width: of the
 * cell, in alpha. */
float cell_spread(float width)
{
  return (clamp(2.0 * (width - CELL_NARROW) / (CELL_WIDE - CELL_NARROW), 0.0, 2.0) - 1.0) / 12.0;
}

/* Into how many parts along each side a peak (PEAK_SHARE) is cut; with 1 the peak stays one cell. So all cells and
 * parts together are 31 + 25 for one hint, 2 (23 + 4) for two, 3 (15 + 4) for three, of which a few are drawn
 * (selection.h). */
int peak_parts(int hints)
{
  return hints == 1 ? 5 : hints <= 3 ? 2 : 1;
}

/* The part of a region, from centre - reach to centre + reach in bins of a level, that lies in the box of all slopes
 * after these have turned by up to `turn` bins: its lowest and highest bin. Returns its length in bins. */
float region_span(float centre, float reach, float turn, int corners, output int lowest, output int highest)
{
  float from = max(centre - reach, -turn);
  float to = min(centre + reach, corners - 1.0 + turn);
  lowest = (int)floor(from);
  highest = (int)floor(to);
  return max(to - from, 0.0);
}

/* Lay the cells of a hint along one slope, over the bins `lowest` to `highest`. random: uniform in 0..1, where in the
 * first cell the lowest bin lies, because the sum of the cells' lobes is higher at their middles: decision 27. */
void lay_cells(int lowest, int highest, int cell, float random, output int count, output int start)
{
  start = lowest - (int)(random * cell);
  count = (highest - start) / cell + 1;
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
Cells far_cells_of(HalfVector hint, float alpha, int hint_count, Counts counts, Level level, float strength,
                   vector random)
{
  Cells cells;
  vector g1 = cross(hint.f2, hint.f3);
  vector g2 = cross(hint.f3, hint.f1);
  vector g3 = cross(hint.f1, hint.f2);
  float determinant = dot(hint.f1, g1);
  /* Find the half vector's slope in tangent space without Strength. A Strength below 1 changes z too (see
   * strengthened). */
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
  /* The region is an ellipse: half vectors differ by half the angle between two lights in the plane of incidence, and
   * by more across it (see half_vector). */
  float inward = region_inward(hint, alpha);
  float x = dot(hint.t1, I);
  float y = dot(hint.t2, I);
  float scale = 1.0 / max(hypot(x, y), 1e-6);
  x *= scale;
  y *= scale;
  cells.reach1 = hypot(inward * (x * cells.a11 + y * cells.a12), hint.radius * (x * cells.a12 - y * cells.a11));
  cells.reach2 = hypot(inward * (x * cells.a21 + y * cells.a22), hint.radius * (x * cells.a22 - y * cells.a21));
  /* Choose the number of cells along each slope: no more than there are bins, and no cell narrower than CELL_FINE.
   * Cells that one slope does not need go to the other, or streaks at a grazing view blur: decision 26. */
  float alphas = CELL_FINE * max(alpha, 1e-6) * abs(cells.a11 * cells.a22 - cells.a12 * cells.a21);
  float bins1 = max(alphas / hypot(cells.a21, cells.a22), 1.0);
  float bins2 = max(alphas / hypot(cells.a11, cells.a12), 1.0);
  int lowest1, highest1, lowest2, highest2;
  float turn1 = hint.turn * hypot(cells.a11, cells.a12) + 1.0;
  float turn2 = hint.turn * hypot(cells.a21, cells.a22) + 1.0;
  float span1 = region_span(cells.centre1, cells.reach1, turn1, level.corners, lowest1, highest1);
  float span2 = region_span(cells.centre2, cells.reach2, turn2, level.corners, lowest2, highest2);
  float across = far_cells(hint_count);
  float across1 = min(across, span1 / bins1);
  float across2 = min(across, span2 / bins2);
  float all = (across + 1.0) * (across + 1.0);
  cells.stride1 = (int)ceil(max(span1 / min(all / (across2 + 1.0) - 1.0, MOST_ACROSS), bins1));
  cells.stride2 = (int)ceil(max(span2 / min(all / (across1 + 1.0) - 1.0, MOST_ACROSS), bins2));
  if (span1 > 0.0 && span2 > 0.0) {
    int limit = cell_limit(hint_count);
    for (int selected = limit + 1; selected > limit;) {
      lay_cells(lowest1, highest1, cells.stride1, random[0], cells.columns, cells.start1);
      lay_cells(lowest2, highest2, cells.stride2, random[1], cells.rows, cells.start2);
      selected = cells_within(cells);
      /* Where the box of slopes cuts the region, the cells are smaller and too many: widen them along the longer
       * side. */
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

/* Whether the counts can answer for the footprint; if so, `level` is the finest level, from the one for the footprint's
 * size on, whose bins are narrow enough for all hints, and `cells` are the cells of each hint there. widest: see
 * far_block. */
int counts_serve(output Map map, HalfVector hints[HINT_COUNT], int hint_count, int lobes, float alpha,
                 Footprint footprint, float widest, vector random, output Level level, output Cells cells[HINT_COUNT])
{
  int from = far_block(map.counts, footprint, widest);
  /* Larger blocks have narrower bins: sharp facets on smooth maps are counted in them, at the price of some blur:
   * decision 21. */
  int to = from;
  int largest = map.counts.first << (map.counts.levels - 1);
  float limit = (widest == FAR_SIDE_FIRST ? FAR_SIDE_LONG : 2.0 * widest) * footprint.short_axis;
  while (from > 0 && to < largest && 2 * to <= limit) {
    to *= 2;
  }
  int fits = 0;
  for (int block = from; block > 0 && block <= to && !fits; block *= 2) {
    level = counts_level(map.counts, block, map.width, map.height, map.is_linear);
    float least = 1e30;
    for (int k = 0; k < hint_count; ++k) {
      cells[k] = far_cells_of(hints[k], alpha, hint_count * lobes, map.counts, level, map.strength, random);
      if (cells[k].columns > 0) {
        least = hints[k].turn > FAR_TURN * hints[k].radius ? 0.0 : min(least, min(cells[k].reach1, cells[k].reach2));
      }
    }
    fits = least > (map.is_linear ? FAR_REACH_LINEAR : FAR_REACH_CLOSEST);
  }
  map.fetches += fits;
  return fits && counts_are_intact(map.counts, level);
}

/* Whether cell (i, j) of hint k is selected: it lies in or beside the region, and no cell of an earlier hint overlaps
 * it, because elements in both would count twice. */
int cell_is_selected(Cells cells[HINT_COUNT], int k, int i, int j)
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

/* By how many bins the cells move for elements at a texel offset: there the surface and the half vector have turned. */
void cell_move(HalfVector hint, Cells cells, float offset_u, float offset_v, output int move1, output int move2)
{
  float p1 = offset_u * hint.turn_u1 + offset_v * hint.turn_v1;
  float p2 = offset_u * hint.turn_u2 + offset_v * hint.turn_v2;
  move1 = (int)floor(0.5 - cells.a11 * p1 - cells.a12 * p2);
  move2 = (int)floor(0.5 - cells.a21 * p1 - cells.a22 * p2);
}

/* Whether the counts select the normal at the hit point: then the remainder must leave it out. */
int hit_is_counted(HalfVector hints[HINT_COUNT], int hint_count, Cells cells[HINT_COUNT], Level level, Map map, Hit hit)
{
  vector slope = hit.unscaled / hit.unscaled[2];
  vector bin = (slope - map.counts.low) / (map.counts.high - map.counts.low) * (level.corners - 1.0);
  int bin1 = (int)floor(bin[0]);
  int bin2 = (int)floor(bin[1]);
  if (!(hit.unscaled[2] > 0.0) || bin1 < 0 || bin2 < 0 || bin1 >= level.corners - 1 || bin2 >= level.corners - 1) {
    return 0;
  }
  /* Take the turn in the middle of the hit's group: the counts turn all of a group alike. */
  int i = wrapped((int)hit.i, map.width);
  int j = wrapped((int)hit.j, map.height);
  float offset_u = (((i + 1) * level.columns - 1) / map.width + 0.5) * level.group_u - i - (hit.u - hit.i);
  float offset_v = (((j + 1) * level.rows - 1) / map.height + 0.5) * level.group_v - j - (hit.v - hit.j);
  for (int k = 0; k < hint_count; ++k) {
    if (cells[k].columns > 0) {
      int move1, move2;
      cell_move(hints[k], cells[k], offset_u, offset_v, move1, move2);
      int column = (int)floor((bin1 - move1 - cells[k].start1) / (float)cells[k].stride1);
      int row = (int)floor((bin2 - move2 - cells[k].start2) / (float)cells[k].stride2);
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
  Ellipse ellipse; /* of the kernel */
  int first_column;
  int first_row;
  int columns;
  int groups;    /* groups under the footprint */
  int is_random; /* groups at random points of the footprint stand for all, because more than MOST_GROUPS lie there */
  int is_thin;   /* of a random group only the block at its point counts, because the footprint is thinner than a group */
};

/* The groups that a sample reads, and the weights of their blocks: three in `weight`, that of the fourth in
 * `fourth`. */
struct Groups {
  int count;
  int column[MOST_GROUPS];
  int row[MOST_GROUPS];
  color weight[MOST_GROUPS];
  float fourth[MOST_GROUPS];
  float total; /* sum of the weights of all groups, drawn or not */
};

/* A block's weight is the kernel's mean over the block, which is the value of a kernel widened by the block's variance
 * in the block's middle: decision 19. */
Blocks blocks_under(Level level, Footprint footprint, float u, float v)
{
  Blocks blocks;
  blocks.u = u;
  blocks.v = v;
  blocks.side_u = 0.5 * level.group_u;
  blocks.side_v = 0.5 * level.group_v;
  float spread = 1.0 / (12.0 * KERNEL_VARIANCE);
  Ellipse ellipse = footprint_ellipse(footprint, spread * blocks.side_u * blocks.side_u,
                                      spread * blocks.side_v * blocks.side_v);
  blocks.ellipse = ellipse;
  float reach_u = ellipse.reach_u - 0.5 * blocks.side_u;
  float reach_v = ellipse.reach_v - 0.5 * blocks.side_v;
  blocks.first_column = (int)floor((u - reach_u) / level.group_u);
  blocks.first_row = (int)floor((v - reach_v) / level.group_v);
  blocks.columns = (int)floor((u + reach_u) / level.group_u) - blocks.first_column + 1;
  int rows = (int)floor((v + reach_v) / level.group_v) - blocks.first_row + 1;
  /* Multiply as floats, because an int overflows for very far footprints. */
  blocks.is_random = (float)blocks.columns * rows > MOST_GROUPS;
  blocks.is_thin = max(blocks.side_u, blocks.side_v) > footprint.short_axis;
  blocks.groups = !blocks.is_random ? blocks.columns * rows : level.columns * level.rows == 1 ? 1 : FAR_GROUPS;
  return blocks;
}

/* Column and row of the g-th group, and the weights of its four blocks, the fourth in `fourth`. random: uniform numbers
 * of this sample. */
color block_weights(Blocks blocks, Level level, Footprint footprint, int g, vector random, output int column,
                    output int row, output float fourth)
{
  if (blocks.is_random) {
    float x, y;
    float a = random[0] + g * PLASTIC_1;
    float b = random[1] + g * PLASTIC_2;
    footprint_sample(a - floor(a), b - floor(b), x, y);
    float place_u = (blocks.u + footprint.ux * x + footprint.uy * y) / level.group_u;
    float place_v = (blocks.v + footprint.vx * x + footprint.vy * y) / level.group_v;
    column = (int)floor(place_u);
    row = (int)floor(place_v);
    if (blocks.is_thin) {
      int block = (place_u - column < 0.5 ? 0 : 1) + (place_v - row < 0.5 ? 0 : 2);
      fourth = block == 3;
      return color(block == 0, block == 1, block == 2);
    }
    fourth = 1.0;
    return color(1.0);
  }
  column = blocks.first_column + g % blocks.columns;
  row = blocks.first_row + g / blocks.columns;
  float left = (column + 0.25) * level.group_u - blocks.u;
  float low = (row + 0.25) * level.group_v - blocks.v;
  float right = left + blocks.side_u;
  float high = low + blocks.side_v;
  Ellipse ellipse = blocks.ellipse;
  fourth = footprint_kernel(ellipse_square(ellipse, right, high));
  return color(footprint_kernel(ellipse_square(ellipse, left, low)),
               footprint_kernel(ellipse_square(ellipse, right, low)),
               footprint_kernel(ellipse_square(ellipse, left, high)));
}

/* The weight above which a group is always read, chosen so that DRAWN_GROUPS of `count` groups are read; 0: all are. */
float sure_weight(float weights[MOST_GROUPS], int count, float total)
{
  float sure = count > DRAWN_GROUPS ? total / DRAWN_GROUPS : 0.0;
  int before = 0;
  for (int larger = sure > 0.0; larger > 0;) {
    /* Groups of a larger weight are read in any case, and the others share the rest of the weight. */
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

/* Draw the groups to read from those under a footprint. The weights of the drawn groups add up to the weight of all, so
 * an even map looks the same whichever groups are drawn. */
Groups drawn_groups(Blocks blocks, Level level, Footprint footprint, vector random)
{
  Groups groups;
  groups.count = 0;
  groups.total = 0;
  float weights[MOST_GROUPS];
  for (int g = 0; g < blocks.groups; ++g) {
    int column, row;
    float fourth;
    color weight = block_weights(blocks, level, footprint, g, random, column, row, fourth);
    float sum = weight[0] + weight[1] + weight[2] + fourth;
    if (sum > 0.0) {
      weights[groups.count] = sum;
      groups.column[groups.count] = column;
      groups.row[groups.count] = row;
      groups.weight[groups.count] = weight;
      groups.fourth[groups.count] = fourth;
      groups.count += 1;
      groups.total += sum;
    }
  }
  float sure = blocks.is_random ? 0.0 : sure_weight(weights, groups.count, groups.total);
  float odds = random[2];
  int drawn = 0;
  for (int g = 0; g < groups.count; ++g) {
    float weight = weights[g];
    if (is_drawn(sure, odds, weight)) {
      groups.column[drawn] = groups.column[g];
      groups.row[drawn] = groups.row[g];
      groups.weight[drawn] = weight / weights[g] * groups.weight[g];
      groups.fourth[drawn] = weight / weights[g] * groups.fourth[g];
      drawn += 1;
    }
  }
  groups.count = drawn;
  return groups;
}

/* Cells blur the distribution of slopes, because the closure of each is spread over the cell. Undo the blur to second
 * order by moving mass from each cell to heavier neighbours: decision 28. spread1, spread2: see cell_spread. A cell
 * loses no more than LARGEST_MOVE of its mass to each of its four neighbours, so no mass falls below 0. */
#define LARGEST_MOVE 0.25
void sharpen_cells(Cells cells[HINT_COUNT], int k, int columns, int rows, float spread1, float spread2,
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
          float moved = clamp(share * (mass[c] - mass[d]), -LARGEST_MOVE * mass[c], LARGEST_MOVE * mass[d]);
          sharp[c] += moved;
          sharp[d] -= moved;
        }
      }
    }
  }
  for (int c = 0; c < columns * rows; ++c) {
    mass[c] = sharp[c];
  }
}

/* A lattice of rectangles of bins: all cells of a hint, or the parts of its peak. */
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

/* The mass in each cell of a grid: the number of elements there, weighted by the kernel, and its moments. */
struct Masses {
  /* Sums over groups of the mass, of the mass times its distance from the half vector in bins, and times the squared
   * distance. */
  float mass[MOST_CELLS];
  float first1[MOST_CELLS];
  float first2[MOST_CELLS];
  float square1[MOST_CELLS];
  float square2[MOST_CELLS];
  float spread_u; /* variance of the positions of a group's texels, along u and v */
  float spread_v;
};

/* Read one group, and add its mass in each cell to m. weight, fourth_weight: of its four blocks; move1, move2: bins by
 * which its cells move (cell_move); turned1, turned2: the number to add to a bin to get its distance from the half
 * vector. */
void add_group(Counts counts, Level level, int group, color weight, float fourth_weight, Grid grid, int move1,
               int move2, float turned1, float turned2, float spread1, float spread2, output Masses m)
{
  int is_packed = level.unit > 0.0;
  int texel = level.first + (is_packed ? group / 2 : group) * level.corners * level.corners;
  float below[MOST_CELL_CORNERS];
  int corner_below = 0;
  for (int j = 0; j <= grid.rows; ++j) {
    int corner_row = clamp(min(grid.start2 + j * grid.stride2, grid.end2) + move2, 0, level.corners - 1);
    int row_texel = texel + corner_row * level.corners;
    float y = 0.5 * (corner_below + corner_row) + turned2;
    float y2 = y * y + spread2 * (corner_row - corner_below) * (corner_row - corner_below);
    float left = 0;
    float left_below = 0;
    int corner_left = 0;
    for (int i = 0; i <= grid.columns; ++i) {
      int corner_column = clamp(min(grid.start1 + i * grid.stride1, grid.end1) + move1, 0, level.corners - 1);
      float fourth = 0;
      color corner = counts_texel(counts, level, row_texel + corner_column, fourth);
      if (is_packed) {
        color second = floor(corner / PACKED_STEP);
        float second_fourth = floor(fourth / PACKED_STEP);
        corner = group & 1 ? second : corner - PACKED_STEP * second;
        fourth = group & 1 ? second_fourth : fourth - PACKED_STEP * second_fourth;
      }
      float value = dot((vector)weight, (vector)corner) + fourth_weight * fourth;
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
    float fourth = groups.fourth[g];
    float sum = weight[0] + weight[1] + weight[2] + fourth;
    float middle_u = (groups.column[g] + 0.5) * level.group_u - blocks.u;
    float middle_v = (groups.row[g] + 0.5) * level.group_v - blocks.v;
    int move1, move2;
    cell_move(hint, cells, middle_u, middle_v, move1, move2);
    /* Turn the group by the mean position of its blocks, weighted by the kernel, and keep the variance around that
     * mean. */
    float right_share = (weight[1] + fourth) / sum;
    float up_share = (weight[2] + fourth) / sum;
    middle_u += (right_share - 0.5) * blocks.side_u;
    middle_v += (up_share - 0.5) * blocks.side_v;
    float turn1 = middle_u * hint.turn_u1 + middle_v * hint.turn_v1;
    float turn2 = middle_u * hint.turn_u2 + middle_v * hint.turn_v2;
    m.spread_u += sum * right_share * (1.0 - right_share);
    m.spread_v += sum * up_share * (1.0 - up_share);
    visited += 1;
    int group = wrapped(groups.row[g], level.rows) * level.columns + wrapped(groups.column[g], level.columns);
    add_group(map.counts, level, group, unit * weight, unit * fourth, grid, move1, move2,
              cells.a11 * turn1 + cells.a12 * turn2 - cells.centre1,
              cells.a21 * turn1 + cells.a22 * turn2 - cells.centre2, spread1, spread2, m);
    map.fetches += (grid.columns + 1) * (grid.rows + 1);
  }
  m.spread_u = (m.spread_u / groups.total + 1.0 / 12.0) * blocks.side_u * blocks.side_u;
  m.spread_v = (m.spread_v / groups.total + 1.0 / 12.0) * blocks.side_v * blocks.side_v;
}

/* The cell that is a peak (PEAK_SHARE), as of a flat map or of scratches along one direction; -1: none. */
int peak_cell(Cells cells[HINT_COUNT], int k, Grid grid, Masses m)
{
  int largest = 0;
  float all = 0;
  for (int c = 0; c < grid.columns * grid.rows; ++c) {
    all += m.mass[c];
    largest = m.mass[c] > m.mass[largest] ? c : largest;
  }
  return m.mass[largest] >= PEAK_SHARE * all &&
                 cell_is_selected(cells, k, largest % grid.columns, largest / grid.columns) ?
             largest : -1;
}

/* Select the cells around each half vector, as many elements each as its counts say. parts: of a peak along each side
 * (peak_parts); (u, v): the hit's texel coordinates; random: uniform numbers of this sample. */
void counts_query(float alpha, output Map map, Level level, HalfVector hints[HINT_COUNT], int hint_count, int parts,
                  Cells cells[HINT_COUNT], Footprint footprint, float u, float v, vector random, output Selection s,
                  output int visited)
{
  Blocks blocks = blocks_under(level, footprint, u, v);
  Groups groups = drawn_groups(blocks, level, footprint, random);
  for (int k = 0; k < hint_count; ++k) {
    HalfVector hint = hints[k];
    /* Find the slope around the half vector per bin. */
    float inverse = 1.0 / (cells[k].a11 * cells[k].a22 - cells[k].a12 * cells[k].a21);
    float p11 = cells[k].a22 * inverse;
    float p12 = -cells[k].a12 * inverse;
    float p21 = -cells[k].a21 * inverse;
    float p22 = cells[k].a11 * inverse;

    /* Read the hint's cells once, and the parts of the peak in a second pass if there is one. */
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
      int peak = pass == 0 && grid.stride1 * grid.stride2 > 1 && parts > 1 ? peak_cell(cells, k, grid, m) : -1;
      float sharpened[MOST_CELLS];
      for (int c = 0; c < grid.columns * grid.rows; ++c) {
        sharpened[c] = m.mass[c];
      }
      if (pass == 0 && peak < 0 && max(spread1, spread2) > -1.0 / 12.0) {
        sharpen_cells(cells, k, grid.columns, grid.rows, spread1, spread2, sharpened);
      }

      for (int c = 0; c < grid.columns * grid.rows; ++c) {
        float w = sharpened[c] / (groups.total * blocks.side_u * blocks.side_v);
        if (w > 0.0 && c != peak && (pass > 0 || cell_is_selected(cells, k, c % grid.columns, c / grid.columns))) {
          float x = m.first1[c] / m.mass[c];
          float y = m.first2[c] / m.mass[c];
          float xx = m.square1[c] / m.mass[c] - x * x;
          float yy = m.square2[c] / m.mass[c] - y * y;
          SlopeMoments slopes;
          slopes.p1 = p11 * x + p12 * y;
          slopes.p2 = p21 * x + p22 * y;
          slopes.c11 = p11 * p11 * xx + p12 * p12 * yy + m.spread_u * hint.turn_u1 * hint.turn_u1 +
                       m.spread_v * hint.turn_v1 * hint.turn_v1;
          slopes.c12 = p11 * p21 * xx + p12 * p22 * yy + m.spread_u * hint.turn_u1 * hint.turn_u2 +
                       m.spread_v * hint.turn_v1 * hint.turn_v2;
          slopes.c22 = p21 * p21 * xx + p22 * p22 * yy + m.spread_u * hint.turn_u2 * hint.turn_u2 +
                       m.spread_v * hint.turn_v2 * hint.turn_v2;
          /* Move the lobes of wide bins at random, or the gaps between them would lie at the same slopes in all
           * samples. */
          float jitter1 = grid.stride1 == 1 && width1 > CELL_NARROW ? random[0] - 0.5 : 0.0;
          float jitter2 = grid.stride2 == 1 && width2 > CELL_NARROW ? random[1] - 0.5 : 0.0;
          slopes.p1 += p11 * jitter1 + p12 * jitter2;
          slopes.p2 += p21 * jitter1 + p22 * jitter2;
          select_element(s, hints, k, w, slopes);
        }
      }
      if (peak >= 0) {
        passes = 2;
        grid.start1 += peak % grid.columns * grid.stride1;
        grid.start2 += peak / grid.columns * grid.stride2;
        grid.end1 = grid.start1 + grid.stride1;
        grid.end2 = grid.start2 + grid.stride2;
        grid.stride1 = (int)ceil(grid.stride1 / (float)parts);
        grid.stride2 = (int)ceil(grid.stride2 / (float)parts);
        grid.columns = (grid.end1 - grid.start1 + grid.stride1 - 1) / grid.stride1;
        grid.rows = (grid.end2 - grid.start2 + grid.stride2 - 1) / grid.stride2;
      }
    }
  }
}
