#pragma once
/* Far footprints: the normal distribution (NDF) of blocks of the map, counted over bins of slope (counts_table.h). A
 * sample reads how many elements lie in a few cells of bins around each half vector (counts_cells.h), in a few
 * groups of blocks (counts_groups.h, counts_masses.h), so its cost does not grow with the footprint: decisions 16,
 * 17 and 29. */

#include "counts_masses.h"
#include "selection.h"

/* Fewest bins from the middle of a hint's region to its rim: a bin is then no wider than 1.4 lobes (Closest) or 2.2
 * lobes (Linear, whose slopes spread evenly over a bin); wider bins lose light: decision 23. */
#define FAR_REACH_CLOSEST 1.75
#define FAR_REACH_LINEAR 1.15
/* A cell that holds more than this share of all elements near a hint is a peak, as of a flat map or of scratches along
 * one direction, and is read a second time in parts. */
#define PEAK_SHARE 0.3
#define PEAK_PARTS 5
/* A cell loses no more than this share of its mass to each of its four neighbours (sharpen_cells), so no mass falls
 * below 0. */
#define LARGEST_MOVE 0.25

/* Cells blur the distribution of slopes, because the closure of each is spread over the cell. Undo the blur to second
 * order by moving mass from each cell to heavier neighbours: decision 28. */
void sharpen_cells(Cells cells[HINT_COUNT], int k, Masses m, output float mass[MOST_CELLS])
{
  int columns = cells[k].grid.columns;
  int rows = cells[k].grid.rows;
  for (int c = 0; c < columns * rows; ++c) {
    if (cell_is_selected(cells, k, c % columns, c / columns)) {
      for (int side = 0; side < 2; ++side) {
        int d = side == 0 ? c + 1 : c + columns;
        int is_inside = side == 0 ? c % columns + 1 < columns : c / columns + 1 < rows;
        if (is_inside && cell_is_selected(cells, k, d % columns, d / columns)) {
          float share = (1.0 / 12.0 + (side == 0 ? m.spread1 : m.spread2)) / 2.0;
          float moved = clamp(share * (m.mass[c] - m.mass[d]), -LARGEST_MOVE * m.mass[c], LARGEST_MOVE * m.mass[d]);
          mass[c] += moved;
          mass[d] -= moved;
        }
      }
    }
  }
}

/* The cell that is a peak (PEAK_SHARE); -1: none. */
int peak_cell(Cells cells[HINT_COUNT], int k, Masses m)
{
  Cells own = cells[k];
  Grid grid = own.grid;
  int largest = 0;
  float all = 0;
  for (int c = 0; c < grid.columns * grid.rows; ++c) {
    all += m.mass[c];
    largest = m.mass[c] > m.mass[largest] ? c : largest;
  }
  return grid.stride1 * grid.stride2 > 1 && m.mass[largest] >= PEAK_SHARE * all &&
                 cell_is_selected(cells, k, largest % grid.columns, largest / grid.columns) ?
             largest : -1;
}

/* The parts of a cell of a grid. */
Grid cell_parts(Grid grid, int cell)
{
  Grid parts;
  parts.start1 = grid.start1 + cell % grid.columns * grid.stride1;
  parts.start2 = grid.start2 + cell / grid.columns * grid.stride2;
  parts.end1 = parts.start1 + grid.stride1;
  parts.end2 = parts.start2 + grid.stride2;
  parts.stride1 = (int)ceil(grid.stride1 / (float)PEAK_PARTS);
  parts.stride2 = (int)ceil(grid.stride2 / (float)PEAK_PARTS);
  parts.columns = (grid.stride1 + parts.stride1 - 1) / parts.stride1;
  parts.rows = (grid.stride2 + parts.stride2 - 1) / parts.stride2;
  return parts;
}

/* The lobe of cell c, of weight `weight`; bins: of the level, along each slope. */
SlopeLobe cell_lobe(Query query, int k, Cells cells, float bins, Grid grid, Masses m, int c, float weight)
{
  HalfVector hint = query.hints[k];
  float x = m.first1[c] / m.mass[c];
  float y = m.first2[c] / m.mass[c];
  float xx = m.square1[c] / m.mass[c] - x * x;
  float yy = m.square2[c] / m.mass[c] - y * y;
  /* Move the lobes of wide bins at random, or the gaps between them would lie at the same slopes in all samples. */
  x += grid.stride1 == 1 && m.width1 > CELL_NARROW ? query.random[0] - 0.5 : 0.0;
  y += grid.stride2 == 1 && m.width2 > CELL_NARROW ? query.random[1] - 0.5 : 0.0;
  SlopeLobe lobe;
  lobe.weight = weight;
  lobe.place1 = (cells.centre1 + x) / bins;
  lobe.place2 = (cells.centre2 + y) / bins;
  float l1 = cells.p11 * x + cells.p12 * y;
  float l2 = cells.p21 * x + cells.p22 * y;
  float quotient = 1.0 / max(1.0 - l1 * cells.tilt1 - l2 * cells.tilt2, 0.1);
  lobe.p1 = quotient * l1;
  lobe.p2 = quotient * l2;
  lobe.c11 = cells.p11 * cells.p11 * xx + cells.p12 * cells.p12 * yy + m.spread_u * hint.turn_u1 * hint.turn_u1 +
             m.spread_v * hint.turn_v1 * hint.turn_v1;
  lobe.c12 = cells.p11 * cells.p21 * xx + cells.p12 * cells.p22 * yy + m.spread_u * hint.turn_u1 * hint.turn_u2 +
             m.spread_v * hint.turn_v1 * hint.turn_v2;
  lobe.c22 = cells.p21 * cells.p21 * xx + cells.p22 * cells.p22 * yy + m.spread_u * hint.turn_u2 * hint.turn_u2 +
             m.spread_v * hint.turn_v2 * hint.turn_v2;
  return lobe;
}

/* Select the cells around each half vector, as many elements each as its counts say. Cells answer, not elements that
 * they propose: decision 72. */
void counts_query(output Map map, Level level, Query query, Cells cells[HINT_COUNT], output Selection s)
{
  Blocks blocks = blocks_under(map, level, query);
  Groups groups = drawn_groups(blocks, map, level, query);
  for (int k = 0; k < query.hint_count; ++k) {
    /* Read the hint's cells once, and the parts of the peak in a second pass if there is one. */
    Cells own = cells[k];
    Grid grid = own.grid;
    int passes = grid.columns > 0;
    for (int pass = 0; pass < passes; ++pass) {
      Masses m;
      grid_masses(map, level, query, k, own, groups, grid, m);
      int peak = pass == 0 ? peak_cell(cells, k, m) : -1;
      float mass[MOST_CELLS];
      mass = m.mass;
      if (pass == 0 && peak < 0 && max(m.spread1, m.spread2) > -1.0 / 12.0) {
        sharpen_cells(cells, k, m, mass);
      }
      for (int c = 0; c < grid.columns * grid.rows; ++c) {
        float w = mass[c] / (groups.total * blocks.side_u * blocks.side_v);
        if (w > 0.0 && c != peak && (pass > 0 || cell_is_selected(cells, k, c % grid.columns, c / grid.columns))) {
          select_element(s, k, query.hints[k].radius, cell_lobe(query, k, own, level.corners - 1.0, grid, m, c, w));
        }
      }
      if (peak >= 0) {
        passes = 2;
        grid = cell_parts(grid, peak);
      }
    }
  }
}

/* Whether the counts select the normal at the hit point: then the remainder must leave it out. */
int hit_is_counted(Query query, Cells cells[HINT_COUNT], Level level, Map map, Hit hit)
{
  vector slope = hit.unscaled / hit.unscaled[2];
  vector bin = (slope - map.counts.low) / (map.counts.high - map.counts.low) * (level.corners - 1.0);
  int bin1 = (int)floor(bin[0]);
  int bin2 = (int)floor(bin[1]);
  if (!(hit.unscaled[2] > 0.0) || bin1 < 0 || bin2 < 0 || bin1 >= level.corners - 1 || bin2 >= level.corners - 1) {
    return 0;
  }
  /* Take the turn in the middle of the hit's group: the counts turn all of a group alike. */
  float offset_u = (((hit.column + 1) * level.columns - 1) / map.width + 0.5) * level.group_u - hit.column -
                   (hit.u - hit.i);
  float offset_v = (((hit.row + 1) * level.rows - 1) / map.height + 0.5) * level.group_v - hit.row - (hit.v - hit.j);
  for (int k = 0; k < query.hint_count; ++k) {
    /* Copy in two steps: OSL's compiler misreads a struct within an array's element. */
    Cells own = cells[k];
    Grid grid = own.grid;
    if (grid.columns > 0) {
      int move1, move2;
      cell_move(query.hints[k], own, offset_u, offset_v, move1, move2);
      int column = (int)floor((bin1 - move1 - grid.start1) / (float)grid.stride1);
      int row = (int)floor((bin2 - move2 - grid.start2) / (float)grid.stride2);
      if (column >= 0 && row >= 0 && column < grid.columns && row < grid.rows &&
          cell_is_selected(cells, k, column, row)) {
        return 1;
      }
    }
  }
  return 0;
}

/* Whether the counts can answer for the footprint; if so, `level` is the finest level, from the one for the footprint's
 * size on, whose bins are narrow enough for all hints, and `cells` are the cells of each hint there. widest: see
 * far_block. */
int counts_serve(output Map map, Query query, float widest, output Level level, output Cells cells[HINT_COUNT])
{
  int from = far_block(map.counts, query.footprint, widest);
  /* Larger blocks have narrower bins: sharp facets on smooth maps are counted in them, at the price of some blur:
   * decision 21. */
  int to = from;
  int largest = map.counts.first << (map.counts.levels - 1);
  float limit = (widest == FAR_SIDE_FIRST ? FAR_SIDE_LONG : 2.0 * widest) * query.footprint.short_axis;
  while (from > 0 && to < largest && 2 * to <= limit) {
    to *= 2;
  }
  int fits = 0;
  for (int block = from; block > 0 && block <= to && !fits; block *= 2) {
    level = counts_level(map.counts, block, map.width, map.height, map.is_linear);
    float least = 1e30;
    for (int k = 0; k < query.hint_count; ++k) {
      cells[k] = hint_cells(query, k, map, level);
      if (cells[k].grid.columns > 0) {
        float turn = query.hints[k].turn;
        least = turn > FAR_TURN * query.hints[k].radius ? 0.0 : min(least, min(cells[k].reach1, cells[k].reach2));
      }
    }
    fits = least > (map.is_linear ? FAR_REACH_LINEAR : FAR_REACH_CLOSEST);
  }
  map.costs.fetches += fits;
  return fits && counts_are_intact(map.counts, level);
}
