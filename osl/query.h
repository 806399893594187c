#pragma once
/* The glint query: which elements of the map, within the footprint, can reflect a hinted light into the view.
 *
 * An element is a texel (Closest) or a part of a bilinear patch (Linear). An element is selected by the first hint
 * in whose region its slope lies (selecting_hint): the same question is asked of the elements that a sample visits,
 * of those that the index lists, and of the normal at the hit point, which the remainder leaves out where it is
 * selected. */

#include "facet.h"
#include "footprint.h"
#include "light_hint.h"
#include "map.h"

/* Most elements that a sample visits; fewer leave noise that more samples do not make up for: decision 7. The material
 * may ask for fewer (Choice of glint_addon/choice/ranking.py): decision 41. */
#define LARGEST_VISIT 4096
/* Least semi-axis in texels of a footprint that is queried: a smaller footprint hardly leaves one element. */
#define SINGLE_ELEMENT 0.5
/* Least short semi-axis in texels for visits row by row: a thinner ellipse may contain no centre of an element, so
 * points along the ellipse are visited. */
#define THIN_FOOTPRINT 1.0

/* Additive recurrence with the plastic number: the k-th of a low-discrepancy set of points in the unit square.
 * Source: Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018. */
#define PLASTIC_1 0.7548776662466927
#define PLASTIC_2 0.5698402909980532

struct Query {
  float u; /* the hit's texel coordinates: see Hit */
  float v;
  Footprint footprint;
  int is_on_grid; /* whether the footprint follows the pixel grid (pixel_grid.h) */
  Facet facet;
  HalfVector hints[HINT_COUNT];
  int hint_count;
  vector random; /* uniform numbers of this sample */
};

/* An element's lobe of slopes around the half vector of the hint that selects it. */
struct SlopeLobe {
  float weight;
  float p1; /* mean */
  float p2;
  float c11; /* covariance, besides that of a facet */
  float c12;
  float c22;
  float place1; /* which flakes it shows: see element_color */
  float place2;
};

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

/* The first hint in whose region lies the slope of the tangent-space normal n at a texel offset, and that slope; -1:
 * none. Only fields of a hint are read, because a copy of the whole struct takes a quarter of the time: decision 12. */
int selecting_hint(Query query, vector n, float offset_u, float offset_v, output float p1, output float p2)
{
  for (int k = 0; k < query.hint_count; ++k) {
    float along = dot(n, query.hints[k].f3);
    float turn1 = offset_u * query.hints[k].turn_u1 + offset_v * query.hints[k].turn_v1;
    float turn2 = offset_u * query.hints[k].turn_u2 + offset_v * query.hints[k].turn_v2;
    float x1 = dot(n, query.hints[k].f1) + along * turn1;
    float x2 = dot(n, query.hints[k].f2) + along * turn2;
    float reach = query.hints[k].radius * along;
    if (along > 0.0 && x1 * x1 + x2 * x2 < reach * reach) {
      p1 = x1 / along;
      p2 = x2 / along;
      return k;
    }
  }
  return -1;
}

/* Whether any normal of a ball around `centre` can lie in the region of hint k; in doubt yes. The offset is that of the
 * middle of a patch, whose normals all lie in the ball. */
int hint_reaches_ball(Query query, int k, vector centre, float ball, float offset_u, float offset_v)
{
  float along = dot(centre, query.hints[k].f3);
  float x1 = dot(centre, query.hints[k].f1) +
             along * (offset_u * query.hints[k].turn_u1 + offset_v * query.hints[k].turn_v1);
  float x2 = dot(centre, query.hints[k].f2) +
             along * (offset_u * query.hints[k].turn_u2 + offset_v * query.hints[k].turn_v2);
  float limit = (query.hints[k].radius + query.hints[k].patch_turn) * along + ball * query.hints[k].ball_growth;
  return limit > 0.0 && x1 * x1 + x2 * x2 < limit * limit;
}

/* A place in a patch and the positions around it, given by two offsets of one standard deviation each. */
struct PatchPart {
  float a;
  float b;
  float first_a;
  float first_b;
  float second_a;
  float second_b;
};

/* Give a part's lobe, whose mean slope is known, its covariance J S J^T: J is the change of the slope around the half
 * vector with the place in the patch, S the covariance of the part's positions. A slope is a quotient of linear forms;
 * an interpolation of slopes would lose light: decision 11. */
void spread_over_part(HalfVector hint, Patch patch, PatchPart part, output SlopeLobe lobe)
{
  float along = dot(patch_normal(patch, part.a, part.b), hint.f3);
  vector by_a = mix(patch.n10 - patch.n00, patch.n11 - patch.n01, part.b) / along;
  vector by_b = mix(patch.n01 - patch.n00, patch.n11 - patch.n10, part.a) / along;
  /* The mean slope holds the turn to this place, which does not change with the normal. */
  float s1 = dot(patch_normal(patch, part.a, part.b), hint.f1) / along;
  float s2 = dot(patch_normal(patch, part.a, part.b), hint.f2) / along;
  float a1 = dot(by_a, hint.f1) - s1 * dot(by_a, hint.f3) + hint.turn_u1;
  float a2 = dot(by_a, hint.f2) - s2 * dot(by_a, hint.f3) + hint.turn_u2;
  float b1 = dot(by_b, hint.f1) - s1 * dot(by_b, hint.f3) + hint.turn_v1;
  float b2 = dot(by_b, hint.f2) - s2 * dot(by_b, hint.f3) + hint.turn_v2;
  float e1 = part.first_a * a1 + part.first_b * b1;
  float e2 = part.first_a * a2 + part.first_b * b2;
  float g1 = part.second_a * a1 + part.second_b * b1;
  float g2 = part.second_a * a2 + part.second_b * b2;
  lobe.c11 = e1 * e1 + g1 * g1;
  lobe.c12 = e1 * e2 + g1 * g2;
  lobe.c22 = e2 * e2 + g2 * g2;
}

/* Whether all of a patch lies above the horizon of hint k. Parts of one that crosses it are not selected: there the
 * slope changes too much within a part. */
int patch_is_above(Query query, int k, Patch patch)
{
  vector f3 = query.hints[k].f3;
  return min(min(dot(patch.n00, f3), dot(patch.n10, f3)), min(dot(patch.n01, f3), dot(patch.n11, f3))) > 0.0;
}

/* Whether the query selects the element at the hit point: then the remainder must leave it out. A part of a patch is
 * judged by the normal in its middle, as when it is visited. */
int hit_is_selected(Query query, output Map map, Hit hit, int mode)
{
  vector n = hit.n;
  float offset_u = 0.0;
  float offset_v = 0.0;
  Patch patch;
  if (map.is_linear) {
    patch = map_patch(map, hit.column, hit.row);
  }
  if (map.is_linear && mode != MODE_POINTS) {
    int columns = patch_columns(patch, query.facet.alpha);
    int rows = patch_rows(patch, query.facet.alpha);
    float a = (min(floor((hit.u - hit.i) * columns), columns - 1.0) + 0.5) / columns;
    float b = (min(floor((hit.v - hit.j) * rows), rows - 1.0) + 0.5) / rows;
    n = patch_normal(patch, a, b);
    offset_u = hit.i + a - hit.u;
    offset_v = hit.j + b - hit.v;
  }
  float p1, p2;
  int found = selecting_hint(query, n, offset_u, offset_v, p1, p2);
  return found >= 0 && (!map.is_linear || patch_is_above(query, found, patch));
}
