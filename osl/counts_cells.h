#pragma once
/* Which rectangles of bins a sample reads around each half vector: the cells. The selection is the cells of all half
 * vectors, and the remainder leaves out exactly their bins (hit_is_counted), so no element is lost, wherever the cells
 * lie. Where the cells of two near lamps overlap and turn apart, a strip of bins may count twice. */

#include "counts_table.h"
#include "query.h"

/* Largest turn within the footprint, relative to a hint's region: with more, the slopes of one block turn so far that
 * its closure loses light: decision 25. */
#define FAR_TURN 2.0
/* A footprint of more than LARGEST_VISIT elements is made smaller until it turns no more than this, because a turn
 * blurs the highlight of flat parts of the map: decision 5. A pixel's only sample is left as wide as the pixel's
 * filter. */
#define SPARE_TURN 0.25
/* Least height of a half vector above the surface (cosine) for which slopes are counted. */
#define LEAST_HEIGHT 0.05
/* Least width of a cell, in alpha: narrower cells give the same picture. */
#define CELL_FINE 0.9
/* Cells across a region along each slope, most along one slope, most cells of a hint, and most corners along a side
 * of its cells: lay_row lays up to two cells more than lie across the region, and lay_grid no more than 10 x 5 or 7
 * x 7: decision 66. */
#define FAR_ACROSS 5.0
#define MOST_ACROSS 8.0
#define MOST_CELLS 50
#define MOST_CELL_CORNERS 11

/* A lattice of rectangles of whole bins: all cells of a hint, or the parts of one of them. */
struct Grid {
  int columns; /* along the first slope */
  int rows;    /* along the second slope */
  int start1;  /* lowest bin along the first slope */
  int start2;
  int stride1; /* bins along a side of a rectangle */
  int stride2;
  int end1;    /* bin after the highest */
  int end2;
};

/* The cells of one hint around its half vector. */
struct Cells {
  Grid grid;     /* no columns: the half vector lies below the surface's horizon */
  float centre1; /* bin coordinates of the half vector */
  float centre2;
  float reach1;  /* bins, semi-axes of the selected ellipse's bounding box */
  float reach2;
  /* Bins per slope p around the half vector, and the inverse: slope per bin. */
  float a11;
  float a12;
  float a21;
  float a22;
  float p11;
  float p12;
  float p21;
  float p22;
  /* A slope is a quotient: p = l / (1 - l . tilt) for l by these linear maps: decision 67. */
  float tilt1;
  float tilt2;
};

/* The bins around a hint's half vector, by the dual basis of its three forms. Returns 0 if the half vector lies too low
 * for counts. */
int bins_around(HalfVector hint, Counts counts, Level level, float strength, output Cells cells)
{
  vector g1 = cross(hint.f2, hint.f3);
  vector g2 = cross(hint.f3, hint.f1);
  vector g3 = cross(hint.f1, hint.f2);
  float determinant = dot(hint.f1, g1);
  /* Find the half vector's slope in tangent space without Strength. A Strength below 1 changes z too (see
   * strengthened). */
  float z = g3[2] / determinant / max(length(g3 / determinant), 1e-30);
  if (!(z > LEAST_HEIGHT) || strength == 0.0) {
    return 0;
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
  float inverse = 1.0 / (cells.a11 * cells.a22 - cells.a12 * cells.a21);
  cells.p11 = cells.a22 * inverse;
  cells.p12 = -cells.a12 * inverse;
  cells.p21 = -cells.a21 * inverse;
  cells.p22 = cells.a11 * inverse;
  cells.tilt1 = g1[2] / g3[2];
  cells.tilt2 = g2[2] / g3[2];
  return 1;
}

/* Give cells the region that they cover: an ellipse, because half vectors differ by half the angle between two lights
 * in the plane of incidence, and by more across it (see half_vector). */
void cover_region(HalfVector hint, float alpha, output Cells cells)
{
  float region = REGION * alpha;
  float inward = region + (hint.radius - region) * dot(hint.h, I);
  float x = dot(hint.t1, I);
  float y = dot(hint.t2, I);
  /* Where the light stands behind the eye all directions are in the plane of incidence. */
  float across = hypot(x, y);
  x = across > 1e-6 ? x / across : 1.0;
  y = across > 1e-6 ? y / across : 0.0;
  cells.reach1 = hypot(inward * (x * cells.a11 + y * cells.a12), hint.radius * (x * cells.a12 - y * cells.a11));
  cells.reach2 = hypot(inward * (x * cells.a21 + y * cells.a22), hint.radius * (x * cells.a22 - y * cells.a21));
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
void lay_row(int lowest, int highest, int stride, float random, output int count, output int start, output int end)
{
  start = lowest - (int)(random * stride);
  count = (highest - start) / stride + 1;
  end = start + count * stride;
}

/* Lay a hint's cells over its region. Their number along each slope is no more than there are bins, and no cell is
 * narrower than CELL_FINE. Cells that one slope does not need go to the other, or streaks at a grazing view blur:
 * decision 26. */
void lay_grid(HalfVector hint, float alpha, Level level, vector random, output Cells cells)
{
  float alphas = CELL_FINE * max(alpha, 1e-6) * abs(cells.a11 * cells.a22 - cells.a12 * cells.a21);
  float bins1 = max(alphas / hypot(cells.a21, cells.a22), 1.0);
  float bins2 = max(alphas / hypot(cells.a11, cells.a12), 1.0);
  int lowest1, highest1, lowest2, highest2;
  float turn1 = hint.turn * hypot(cells.a11, cells.a12) + 1.0;
  float turn2 = hint.turn * hypot(cells.a21, cells.a22) + 1.0;
  float span1 = region_span(cells.centre1, cells.reach1, turn1, level.corners, lowest1, highest1);
  float span2 = region_span(cells.centre2, cells.reach2, turn2, level.corners, lowest2, highest2);
  float across1 = min(FAR_ACROSS, span1 / bins1);
  float across2 = min(FAR_ACROSS, span2 / bins2);
  float all = (FAR_ACROSS + 1.0) * (FAR_ACROSS + 1.0);
  Grid grid = cells.grid;
  grid.stride1 = (int)ceil(max(span1 / min(all / (across2 + 1.0) - 1.0, MOST_ACROSS), bins1));
  grid.stride2 = (int)ceil(max(span2 / min(all / (across1 + 1.0) - 1.0, MOST_ACROSS), bins2));
  if (span1 > 0.0 && span2 > 0.0) {
    lay_row(lowest1, highest1, grid.stride1, random[0], grid.columns, grid.start1, grid.end1);
    lay_row(lowest2, highest2, grid.stride2, random[1], grid.rows, grid.start2, grid.end2);
  }
  cells.grid = grid;
}

/* The cells around one hint. */
Cells hint_cells(Query query, int k, Map map, Level level)
{
  HalfVector hint = query.hints[k];
  Cells cells;
  Grid none = { 0, 0, 0, 0, 1, 1, 0, 0 };
  cells.grid = none;
  cells.reach1 = 0.0;
  cells.reach2 = 0.0;
  if (bins_around(hint, map.counts, level, map.strength, cells)) {
    cover_region(hint, query.facet.alpha, cells);
    lay_grid(hint, query.facet.alpha, level, query.random, cells);
  }
  return cells;
}

/* Whether the middle of cell (i, j) lies within half a cell of the region. */
int cell_is_within(Cells cells, int i, int j)
{
  Grid grid = cells.grid;
  float x = (grid.start1 + (i + 0.5) * grid.stride1 - cells.centre1) / (cells.reach1 + 0.5 * grid.stride1);
  float y = (grid.start2 + (j + 0.5) * grid.stride2 - cells.centre2) / (cells.reach2 + 0.5 * grid.stride2);
  return x * x + y * y < 1.0;
}

/* Whether cell (i, j) of hint k is selected: it lies in or beside the region, and no cell of an earlier hint overlaps
 * it, because elements in both would count twice. */
int cell_is_selected(Cells cells[HINT_COUNT], int k, int i, int j)
{
  int low1 = cells[k].grid.start1 + i * cells[k].grid.stride1;
  int low2 = cells[k].grid.start2 + j * cells[k].grid.stride2;
  int selected = cell_is_within(cells[k], i, j);
  for (int h = 0; h < k && selected; ++h) {
    selected = cells[h].grid.columns == 0 || low1 >= cells[h].grid.end1 ||
               low1 + cells[k].grid.stride1 <= cells[h].grid.start1 || low2 >= cells[h].grid.end2 ||
               low2 + cells[k].grid.stride2 <= cells[h].grid.start2;
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
