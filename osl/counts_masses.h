#pragma once
/* How many elements lie in the cells of a hint: their mass, over the groups that a sample reads, added before
 * cells are drawn: decision 69. */

#include "counts_cells.h"
#include "counts_groups.h"

/* Widths of a cell, in alpha, between which the spread of its closure goes from -1/12 to 1/12 of the squared width.
 * Facets lie evenly over a cell, at a random place in it, so a closure in the cell's middle shows twice their spread: a
 * narrow cell's closure is made narrower than a facet's lobe by as much. Where cells are wide, gaps between their
 * closures would show: decision 24. */
#define CELL_NARROW 1.1
#define CELL_WIDE 2.0

/* Variance of slopes that a cell's closure adds along one side, relative to the cell's squared width; width: of the
 * cell, in alpha. A GGX lobe has so much light in its tail that the region must hold as much of each cell as of its
 * facets (facet_gain): decision 65. */
float cell_spread(Facet facet, float width)
{
  if (facet_is_ggx(facet)) {
    return 1.0 / 12.0;
  }
  return (clamp(2.0 * (width - CELL_NARROW) / (CELL_WIDE - CELL_NARROW), 0.0, 2.0) - 1.0) / 12.0;
}

/* The mass in each cell of a grid: the number of elements there, weighted by the kernel, and its moments. */
struct Masses {
  /* Sums over groups of the mass, of the mass times its distance from the half vector in bins, and times the squared
   * distance. */
  float mass[MOST_CELLS];
  float first1[MOST_CELLS];
  float first2[MOST_CELLS];
  float square1[MOST_CELLS];
  float square2[MOST_CELLS];
  float width1;  /* of a cell, in alpha */
  float width2;
  float spread1; /* of a cell: see cell_spread */
  float spread2;
  float spread_u; /* variance of the positions of a group's texels, along u and v */
  float spread_v;
};

/* How one group is read: move1, move2: bins by which its cells move (cell_move); turned1, turned2: the number to add to
 * a bin to get its distance from the half vector. */
struct Reading {
  Group group;
  int number; /* of the group in its level */
  int move1;
  int move2;
  float turned1;
  float turned2;
};

/* Elements below a corner of the bins, over the group's four blocks by their weights. */
float weighted_corner(Counts counts, Level level, Reading reading, int texel)
{
  float fourth = 0;
  color corner = counts_texel(counts, level, texel, fourth);
  if (level.unit > 0.0) {
    color second = floor(corner / PACKED_STEP);
    float second_fourth = floor(fourth / PACKED_STEP);
    corner = reading.number & 1 ? second : corner - PACKED_STEP * second;
    fourth = reading.number & 1 ? second_fourth : fourth - PACKED_STEP * second_fourth;
  }
  return dot((vector)reading.group.weight, (vector)corner) + reading.group.fourth * fourth;
}

/* Read one group, and add its mass in each cell to m. */
void add_group(Counts counts, Level level, Reading reading, Grid grid, output Masses m)
{
  int texel = level.first + (level.unit > 0.0 ? reading.number / 2 : reading.number) * level.corners * level.corners;
  float unit = level.unit > 0.0 ? level.unit : 1.0;
  float below[MOST_CELL_CORNERS];
  int corner_below = 0;
  for (int j = 0; j <= grid.rows; ++j) {
    int corner_row = clamp(min(grid.start2 + j * grid.stride2, grid.end2) + reading.move2, 0, level.corners - 1);
    int row_texel = texel + corner_row * level.corners;
    float y = 0.5 * (corner_below + corner_row) + reading.turned2;
    float y2 = y * y + m.spread2 * (corner_row - corner_below) * (corner_row - corner_below);
    float left = 0;
    float left_below = 0;
    int corner_left = 0;
    for (int i = 0; i <= grid.columns; ++i) {
      int corner_column = clamp(min(grid.start1 + i * grid.stride1, grid.end1) + reading.move1, 0, level.corners - 1);
      float value = weighted_corner(counts, level, reading, row_texel + corner_column);
      if (i > 0 && j > 0) {
        float found = unit * (value - left - below[i] + left_below);
        if (found > 0.0) {
          int c = (j - 1) * grid.columns + i - 1;
          float x = 0.5 * (corner_left + corner_column) + reading.turned1;
          m.mass[c] += found;
          m.first1[c] += found * x;
          m.first2[c] += found * y;
          m.square1[c] += found * (x * x + m.spread1 * (corner_column - corner_left) * (corner_column - corner_left));
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

/* No mass in the cells of a grid. */
void clear_masses(Cells cells, Grid grid, Facet facet, output Masses m)
{
  for (int c = 0; c < grid.columns * grid.rows; ++c) {
    m.mass[c] = 0;
    m.first1[c] = 0;
    m.first2[c] = 0;
    m.square1[c] = 0;
    m.square2[c] = 0;
  }
  m.width1 = grid.stride1 * hypot(cells.p11, cells.p21) / max(facet.alpha, 1e-6);
  m.width2 = grid.stride2 * hypot(cells.p12, cells.p22) / max(facet.alpha, 1e-6);
  m.spread1 = cell_spread(facet, m.width1);
  m.spread2 = cell_spread(facet, m.width2);
  m.spread_u = 0;
  m.spread_v = 0;
}

/* Masses of a grid's cells over the groups, for hint k; `cells` are that hint's. */
void grid_masses(output Map map, Level level, Query query, int k, Cells cells, Groups groups, Grid grid,
                 output Masses m)
{
  HalfVector hint = query.hints[k];
  float side_u = 0.5 * level.group_u;
  float side_v = 0.5 * level.group_v;
  clear_masses(cells, grid, query.facet, m);
  for (int g = 0; g < groups.count; ++g) {
    Group group = groups.group[g];
    float sum = group.weight[0] + group.weight[1] + group.weight[2] + group.fourth;
    float middle_u = (group.column + 0.5) * level.group_u + group.shift_u - query.u;
    float middle_v = (group.row + 0.5) * level.group_v + group.shift_v - query.v;
    Reading reading;
    reading.group = group;
    cell_move(hint, cells, middle_u, middle_v, reading.move1, reading.move2);
    /* Turn the group by the mean position of its blocks, weighted by the kernel, and keep the variance around that
     * mean. */
    float right_share = (group.weight[1] + group.fourth) / sum;
    float up_share = (group.weight[2] + group.fourth) / sum;
    middle_u += (right_share - 0.5) * side_u;
    middle_v += (up_share - 0.5) * side_v;
    float turn1 = middle_u * hint.turn_u1 + middle_v * hint.turn_v1;
    float turn2 = middle_u * hint.turn_u2 + middle_v * hint.turn_v2;
    m.spread_u += sum * right_share * (1.0 - right_share);
    m.spread_v += sum * up_share * (1.0 - up_share);
    reading.number = wrapped(group.row, level.rows) * level.columns + wrapped(group.column, level.columns);
    reading.turned1 = cells.a11 * turn1 + cells.a12 * turn2 - cells.centre1;
    reading.turned2 = cells.a21 * turn1 + cells.a22 * turn2 - cells.centre2;
    add_group(map.counts, level, reading, grid, m);
    map.costs.visited += 1;
    map.costs.fetches += (grid.columns + 1) * (grid.rows + 1);
  }
  m.spread_u = (m.spread_u / groups.total + 1.0 / 12.0) * side_u * side_u;
  m.spread_v = (m.spread_v / groups.total + 1.0 / 12.0) * side_v * side_v;
}
