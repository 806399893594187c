#pragma once
/* The index for the middle distance: the texels of small blocks of the map, sorted by slope (slope_cells.h), so that a
 * sample visits only those near a half vector, the candidates. The answer is exact, because candidates are fetched from
 * the table of normals and tested as in a visit of all: decision 14. Patches have none: decision 71. */

#include "slope_cells.h"
#include "visits.h"

/* Least area in texels of a footprint: in a smaller one most elements of a block lie outside, and visits of all are as
 * fast. */
#define INDEX_AREA 120.0
/* Least short semi-axis in texels: the kernel's integral replaces the sum over all elements, which differs from it at
 * random, without bias. */
#define INDEX_SHORT_AXIS 3.0
/* Largest number of blocks in the footprint's bounding box. */
#define INDEX_BLOCKS 160
/* Costs in nanoseconds that choose between the index and visits of all texels: of a block, of a texel of its lists, of
 * a candidate, and of a texel visited row by row: decision 15. */
#define INDEX_BLOCK_COST 300.0
#define INDEX_LISTED_COST 11.0
#define INDEX_TEXEL_COST 90.0
#define TEXEL_COST 48.0

/* A block of the map under the footprint. */
struct Block {
  Ellipse ellipse;  /* of the kernel */
  int column;       /* first texel of the block in the map */
  int row;
  int plane_column; /* first texel of the block in the plane in which the map repeats */
  int plane_row;
  int columns;      /* texels of the block along u and v */
  int rows;
  /* Texels of the plane that lie in the tile whose cut of the map the block is of, as far as the footprint goes. */
  int first_u;
  int last_u;
  int first_v;
  int last_v;
  int record;       /* texel of the list where the block's record begins */
  int is_listed;    /* whether its elements are listed, or all its texels are taken row by row */
};

/* Whether texel (x, y) of a block is seen, not one of another tile in its place. */
int is_in_tile(Block block, int x, int y)
{
  int column = block.plane_column + x;
  int row = block.plane_row + y;
  return column >= block.first_u && column <= block.last_u && row >= block.first_v && row <= block.last_v;
}

/* Visit the elements `start` to `end` of a block for hint k. */
void visit_listed(output Map map, Index index, Query query, Block block, int k, int start, int end, output Selection s)
{
  Visit visit = whole_visit(query);
  visit.from = k;
  visit.to = k + 1;
  for (int group = start / 8; 8 * group < end; ++group) {
    float fourth = 0;
    color pairs = 0;
    if (block.is_listed) {
      pairs = index_texel(index, block.record + INDEX_FIRST_ELEMENT + group, fourth);
      map.costs.fetches += 1;
    }
    int lane_end = min(end - 8 * group, 8);
    for (int lane = max(start - 8 * group, 0); lane < lane_end; ++lane) {
      int code = (int)(lane < 2 ? pairs[0] : lane < 4 ? pairs[1] : lane < 6 ? pairs[2] : fourth);
      code = !block.is_listed ? 8 * group + lane : lane & 1 ? code >> 10 : code & 1023;
      int x = code & (INDEX_SIDE - 1);
      int y = code >> 5;
      float du = block.plane_column + x + 0.5 - query.u;
      float dv = block.plane_row + y + 0.5 - query.v;
      visit.weight = footprint_kernel(ellipse_square(block.ellipse, du, dv));
      if (visit.weight > 0.0 && x < block.columns && (!map.variation || is_in_tile(block, x, y))) {
        map.costs.visited += 1;
        visit.i = block.column + x;
        visit.j = block.row + y;
        visit.offset_u = du;
        visit.offset_v = dv;
        visit_texel(map, query, visit, s);
      }
    }
  }
}

/* Whether the index can answer for the footprint, and is faster than visits of all elements. */
int index_serves(output Map map, Query query)
{
  Footprint footprint = query.footprint;
  float blocks = (2.0 * hypot(footprint.ux, footprint.uy) / INDEX_SIDE + 1.0) *
                 (2.0 * hypot(footprint.vx, footprint.vy) / INDEX_SIDE + 1.0);
  if (map.is_linear || !map.is_indexed || footprint.area < INDEX_AREA || footprint.short_axis < INDEX_SHORT_AXIS ||
      blocks > INDEX_BLOCKS) {
    return 0;
  }
  Index index = map_index(map.index, map.width, map.height);
  int column, row;
  int first_u = block_start((int)floor(query.u), map.width, column);
  int first_v = block_start((int)floor(query.v), map.height, row);
  int record = INDEX_RECORD * (row * index.columns + column);
  /* Count the candidates of the block around the hit. */
  int side_u = min(map.width - INDEX_SIDE * column, INDEX_SIDE);
  int side_v = min(map.height - INDEX_SIDE * row, INDEX_SIDE);
  int candidates = 0;
  for (int k = 0; k < query.hint_count; ++k) {
    HalfVector hint = query.hints[k];
    SlopeBasis basis = slope_basis(hint);
    if (!region_is_upright(basis, 0, 0, hint.radius + hint.reach + INDEX_SIDE * hint.patch_turn)) {
      return 0;
    }
    CellRange range = block_cells(map, index, record, basis, 0, 0, hint.radius + hint.patch_turn);
    if (!range.is_intact) {
      return 0;
    }
    for (int cells = range.from2; cells <= range.to2; ++cells) {
      int start, end;
      row_elements(map, index, record, range, cells, start, end);
      candidates += end - start;
    }
    candidates += side_u * side_v - range.listed - range.absent;
  }
  float share = candidates / (float)(side_u * side_v);
  float listed = share * INDEX_SIDE * INDEX_SIDE;
  float index_cost = blocks * (INDEX_BLOCK_COST * query.hint_count + listed * INDEX_LISTED_COST) +
                     footprint.area * share * INDEX_TEXEL_COST;
  float visit_cost = footprint.area > map.visits ? map.visits * INDEX_TEXEL_COST :
                                                      footprint.area * TEXEL_COST;
  return index_cost < visit_cost;
}

/* Visit the candidates of one block for hint k: of the rows of its cells that the hint's region meets, then of the
 * tail. */
void visit_block(output Map map, Index index, Query query, output Block block, int k, output Selection s)
{
  HalfVector hint = query.hints[k];
  float du = block.plane_column + 0.5 * block.columns - query.u;
  float dv = block.plane_row + 0.5 * block.rows - query.v;
  float radius = hint.radius + 0.5 * (block.columns * hypot(hint.turn_u1, hint.turn_u2) +
                                      block.rows * hypot(hint.turn_v1, hint.turn_v2));
  CellRange range = block_cells(map, index, block.record, slope_basis(hint), -du * hint.turn_u1 - dv * hint.turn_v1,
                                -du * hint.turn_u2 - dv * hint.turn_v2, radius);
  block.is_listed = range.is_intact;
  /* The loop calls visit_listed at one place only, because OSL compiles each call of a function anew. */
  for (int cells = range.from2; cells <= range.to2 + 1; ++cells) {
    int start = range.listed;
    int end = (range.is_intact ? block.columns : INDEX_SIDE) * block.rows - range.absent;
    if (cells <= range.to2) {
      row_elements(map, index, block.record, range, cells, start, end);
    }
    visit_listed(map, index, query, block, k, start, end, s);
  }
}

/* Visit the candidates of the blocks from first_u, first_v to last_u, last_v; shift_u, shift_v: see tile_shift. */
void visit_blocks(output Map map, Index index, Query query, output Block block, int shift_u, int shift_v,
                  output Selection s)
{
  Ellipse ellipse = block.ellipse;
  for (int k = 0; k < query.hint_count; ++k) {
    int place_v;
    for (int j = block_start(block.first_v - shift_v, map.height, place_v) + shift_v; j <= block.last_v;) {
      block.row = INDEX_SIDE * place_v;
      block.plane_row = j;
      block.rows = min(map.height - block.row, INDEX_SIDE);
      int place_u;
      for (int i = block_start(block.first_u - shift_u, map.width, place_u) + shift_u; i <= block.last_u;) {
        block.column = INDEX_SIDE * place_u;
        block.plane_column = i;
        block.columns = min(map.width - block.column, INDEX_SIDE);
        block.record = INDEX_RECORD * (place_v * index.columns + place_u);
        /* Skip a block whose bounding circle in the kernel's plane does not meet the kernel's disk. */
        float half = 0.5 * (block.columns * sqrt(ellipse.quu) + block.rows * sqrt(ellipse.qvv));
        float square = ellipse_square(ellipse, i + 0.5 * block.columns - query.u, j + 0.5 * block.rows - query.v);
        if (square < (1.0 + half) * (1.0 + half)) {
          visit_block(map, index, query, block, k, s);
        }
        i += block.columns;
        place_u = place_u + 1 < index.columns ? place_u + 1 : 0;
      }
      j += block.rows;
      place_v = place_v + 1 < index.rows ? place_v + 1 : 0;
    }
  }
}

/* As visit_elements, but visits only the candidates of the index. */
float index_query(output Map map, Query query, output Selection s)
{
  Index index = map_index(map.index, map.width, map.height);
  Block block;
  Ellipse ellipse = footprint_ellipse(query.footprint, 0.0, 0.0);
  block.ellipse = ellipse;
  int first_u = (int)floor(query.u - ellipse.reach_u);
  int first_v = (int)floor(query.v - ellipse.reach_v);
  int last_u = (int)floor(query.u + ellipse.reach_u);
  int last_v = (int)floor(query.v + ellipse.reach_v);
  /* Go through the tiles under the footprint, which are all one where they do not differ. */
  int left = map.variation ? tile_of(first_u - map.cut_u, map.width) : 0;
  int right = map.variation ? tile_of(last_u - map.cut_u, map.width) : 0;
  int low = map.variation ? tile_of(first_v - map.cut_v, map.height) : 0;
  int high = map.variation ? tile_of(last_v - map.cut_v, map.height) : 0;
  for (int up = low; up <= high; ++up) {
    for (int along = left; along <= right; ++along) {
      int column = map.cut_u + along * map.width;
      int row = map.cut_v + up * map.height;
      int shift_u, shift_v;
      tile_shift(map, column, row, shift_u, shift_v);
      block.first_u = map.variation ? max(first_u, column) : first_u;
      block.first_v = map.variation ? max(first_v, row) : first_v;
      block.last_u = map.variation ? min(last_u, column + map.width - 1) : last_u;
      block.last_v = map.variation ? min(last_v, row + map.height - 1) : last_v;
      visit_blocks(map, index, query, block, shift_u, shift_v, s);
    }
  }
  /* Return the kernel's integral, which is the expectation of its sum over the elements. */
  return query.footprint.area / 3.0;
}
