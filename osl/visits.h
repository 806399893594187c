#pragma once
/* Visits of the elements of a footprint. Near footprints: all elements under the footprint are visited while these
 * are no more than map.visits; of more, a random subset of that size stands for all, which is noisier but right in
 * the mean. Footprints in the middle distance use slope_index.h where that is faster (decision 14), and far
 * footprints use counts.h from where a block is about as wide as the footprint. The index is not thinned out at
 * random: decision 10. */

#include "selection.h"

/* Weight of the kernel, 1 in its middle, from which on a patch is always visited. Lighter patches are drawn at random
 * (is_drawn), about a third of them: neighbouring patches are alike, so those drawn stand for the others: decision 9.
 * Texels differ from their neighbours, and a pixel's only sample would show which are drawn: there all are visited. */
#define SURE_WEIGHT 0.75
/* Points per texel of a thin footprint, and the fewest points of all. */
#define POINTS_PER_TEXEL 4.0
#define FEWEST_POINTS 8
/* Standard deviation of a uniform distribution over 0..1: 1 / sqrt(12). */
#define UNIFORM_DEVIATION 0.28867513
/* Largest standard deviation, in texels, of the positions for which one point of a thin footprint stands: that of half
 * a texel. */
#define LARGEST_SPREAD 0.14433757

/* An element to visit, and the hints that may select it: those from `from` to before `to`. */
struct Visit {
  int i; /* texel, or lower left texel of a patch */
  int j;
  float offset_u; /* texels, from the hit to the texel's middle or the patch's lower left corner */
  float offset_v;
  float weight;
  int is_point; /* whether of a patch only the part `place` is visited */
  PatchPart place;
  int from;
  int to;
};

/* A visit of a whole texel or patch by all hints. */
Visit whole_visit(Query query)
{
  Visit visit;
  visit.weight = 1.0;
  visit.is_point = 0;
  visit.from = 0;
  visit.to = query.hint_count;
  return visit;
}

void visit_texel(output Map map, Query query, Visit visit, output Selection s)
{
  SlopeLobe lobe = { visit.weight, 0.0, 0.0, 0.0, 0.0, 0.0, visit.i, visit.j };
  vector n = map_normal(map, visit.i, visit.j);
  int found = selecting_hint(query, n, visit.offset_u, visit.offset_v, lobe.p1, lobe.p2);
  if (found >= visit.from && found < visit.to) {
    select_element(s, found, query.hints[found].radius, lobe);
  }
}

/* Visit one patch, cut into parts. */
void visit_patch(output Map map, Query query, Visit visit, output Selection s)
{
  /* Skip a patch that no hint can select, by one fetch. */
  if (patch_has_bounds(map.width, map.height, visit.i, visit.j)) {
    float ball = 0;
    map.costs.fetches += 1;
    vector centre = strengthened(patch_bounds(map.table, map.inverse_padded_width, map.inverse_padded_height, visit.i,
                                              visit.j, ball), map.strength);
    ball *= max(abs(map.strength), 1.0);
    int reached = 0;
    for (int h = visit.from; h < visit.to && !reached; ++h) {
      reached = hint_reaches_ball(query, h, centre, ball, visit.offset_u + 0.5, visit.offset_v + 0.5);
    }
    if (!reached) {
      return;
    }
  }

  Patch patch = map_patch(map, visit.i, visit.j);
  int columns = visit.is_point ? 1 : patch_columns(patch, query.facet.alpha);
  int rows = visit.is_point ? 1 : patch_rows(patch, query.facet.alpha);
  if (columns * rows > 1) {
    /* Skip the parts of a patch that no hint can select: the turn is that of its middle, give or take patch_turn. */
    vector corners[4] = { patch.n00, patch.n10, patch.n01, patch.n11 };
    int reached = 0;
    for (int h = visit.from; h < visit.to && !reached; ++h) {
      reached = hull_reaches_hint(query.hints[h], corners, visit.offset_u + 0.5, visit.offset_v + 0.5,
                                  query.hints[h].radius + query.hints[h].patch_turn);
    }
    if (!reached) {
      return;
    }
  }
  PatchPart part = visit.place;
  if (!visit.is_point) {
    part.first_a = UNIFORM_DEVIATION / columns;
    part.first_b = 0.0;
    part.second_a = 0.0;
    part.second_b = UNIFORM_DEVIATION / rows;
  }
  for (int k = 0; k < columns * rows; ++k) {
    if (!visit.is_point) {
      part.a = (k % columns + 0.5) / columns;
      part.b = (k / columns + 0.5) / rows;
    }
    SlopeLobe lobe = { visit.weight / (columns * rows), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 };
    int found = selecting_hint(query, patch_normal(patch, part.a, part.b), visit.offset_u + part.a,
                               visit.offset_v + part.b, lobe.p1, lobe.p2);
    if (found >= visit.from && found < visit.to && patch_is_above(query, found, patch)) {
      spread_over_part(query.hints[found], patch, part, lobe);
      select_element(s, found, query.hints[found].radius, lobe);
    }
  }
}

/* The column of the plane at which the tile to the right of texel column `column` begins; an earlier one if all tiles
 * show the same. */
int next_border(Map map, int column)
{
  return map.variation ? map.cut_u + (tile_of(column - map.cut_u, map.width) + 1) * map.width : column;
}

/* Visit all elements of the footprint row by row. Lighter patches than `sure` are drawn at random. Returns the sum of
 * the kernel's weights over all elements: selected weights are relative to this sum. */
float visit_rows(output Map map, Query query, float sure, output Selection s)
{
  float total = 0;
  float odds = query.random[0];
  Visit visit = whole_visit(query);
  float to_corner = map.is_linear ? 0.5 : 0.0;
  Ellipse ellipse = footprint_ellipse(query.footprint, 0.0, 0.0);
  int last_row = (int)floor(query.v + ellipse.reach_v - 0.5);
  for (int row = (int)ceil(query.v - ellipse.reach_v - 0.5); row <= last_row; ++row) {
    float dv = row + 0.5 - query.v;
    float offset = ellipse.quv * dv;
    float half_width = sqrt(max(offset * offset - ellipse.quu * (ellipse.qvv * dv * dv - 1.0), 0.0)) / ellipse.quu;
    float middle = query.u - offset / ellipse.quu - 0.5;
    int last_column = (int)floor(middle + half_width);
    int column = (int)ceil(middle - half_width);
    int border = column; /* where another tile begins */
    visit.offset_v = dv - to_corner;
    for (; column <= last_column; ++column) {
      if (column == border) {
        map_texel(map, column, row, visit.i, visit.j);
        border = next_border(map, column);
      }
      float du = column + 0.5 - query.u;
      visit.weight = footprint_kernel(ellipse_square(ellipse, du, dv));
      total += visit.weight;
      if (is_drawn(sure, odds, visit.weight)) {
        map.costs.visited += 1;
        visit.offset_u = du - to_corner;
        if (map.is_linear) {
          visit_patch(map, query, visit, s);
        }
        else {
          visit_texel(map, query, visit, s);
        }
      }
      visit.i = visit.i + 1 < map.width ? visit.i + 1 : 0;
    }
  }
  return total;
}

/* Visit `points` elements at points drawn from the kernel. Returns the sum of their weights. */
float visit_points(output Map map, Query query, int points, int is_thin, output Selection s)
{
  Footprint footprint = query.footprint;
  Visit visit = whole_visit(query);
  visit.is_point = is_thin;
  /* Find the part of the footprint that one point stands for, no wider than half a patch: another patch has other
   * slopes. */
  float share = min(sqrt(KERNEL_VARIANCE / points), LARGEST_SPREAD / footprint.long_axis);
  visit.place.first_a = share * footprint.ux;
  visit.place.first_b = share * footprint.vx;
  visit.place.second_a = share * footprint.uy;
  visit.place.second_b = share * footprint.vy;
  for (int k = 0; k < points; ++k) {
    float x, y;
    float a = query.random[0] + k * PLASTIC_1;
    float b = query.random[1] + k * PLASTIC_2;
    footprint_sample(a - floor(a), b - floor(b), x, y);
    float point_u = query.u + footprint.ux * x + footprint.uy * y;
    float point_v = query.v + footprint.vx * x + footprint.vy * y;
    float column = floor(point_u);
    float row = floor(point_v);
    map_texel(map, (int)column, (int)row, visit.i, visit.j);
    map.costs.visited += 1;
    if (map.is_linear) {
      visit.place.a = point_u - column;
      visit.place.b = point_v - row;
      visit.offset_u = column - query.u;
      visit.offset_v = row - query.v;
      visit_patch(map, query, visit, s);
    }
    else {
      /* Take the view at the point: the texel's centre may lie far outside a thin footprint. */
      visit.offset_u = point_u - query.u;
      visit.offset_v = point_v - query.v;
      visit_texel(map, query, visit, s);
    }
  }
  return points;
}

/* Visit the footprint's elements in one of the modes POINTS, ALL and SUBSET. sure: see visit_rows. Returns the sum of
 * all weights. */
float visit_elements(output Map map, Query query, int mode, float sure, output Selection s)
{
  if (mode == MODE_ALL) {
    return visit_rows(map, query, sure, s);
  }
  int points = map.visits;
  if (mode == MODE_POINTS) {
    Footprint footprint = query.footprint;
    float wanted = POINTS_PER_TEXEL * 2.0 * footprint.long_axis * max(2.0 * footprint.short_axis, 1.0);
    points = clamp((int)ceil(min(wanted, LARGEST_VISIT)), FEWEST_POINTS, LARGEST_VISIT);
  }
  return visit_points(map, query, points, mode == MODE_POINTS, s);
}
