#pragma once
/* Closures of what is selected. */

#include "flakes.h"
#include "selection.h"

/* Cycles drops closures whose weight is below 1e-5, so Russian roulette keeps some of the lighter ones at this
 * weight. */
#define LEAST_WEIGHT 2e-5

/* The weight for a closure of weight w: w, or for small weights 0 or LEAST_WEIGHT at random. seed_1, seed_2: of this
 * sample; k: of this closure. */
float roulette(float w, float seed_1, float seed_2, int k)
{
  if (w >= LEAST_WEIGHT) {
    return w;
  }
  return (float)hashnoise(point(seed_1, seed_2, k)) * LEAST_WEIGHT < w ? LEAST_WEIGHT : 0.0;
}

/* A facet of normal n reflects by 1 / (n.I), which at a grazing view changes across a merged cell. This is the
 * reflection of those facets of the cell that mirror the hinted light, relative to the reflection of the cell's mean
 * normal (slope p, covariance c). The mean slope of these facets is p alpha^2/2 (alpha^2/2 + c)^-1: the mean of the
 * product of the cell's distribution and the lobe. Returns 1 for a single facet, and 1 on average over cells around the
 * light. Without it wide cells are too bright: decision 35. */
float merged_reflection(HalfVector hint, float alpha, SlopeLobe lobe)
{
  float s = 0.5 * alpha * alpha;
  float m1 = lobe.p1;
  float m2 = lobe.p2;
  if (min(lobe.c11, lobe.c22) > 0.0) {
    float determinant = (s + lobe.c11) * (s + lobe.c22) - lobe.c12 * lobe.c12;
    m1 = s * ((s + lobe.c22) * lobe.p1 - lobe.c12 * lobe.p2) / determinant;
    m2 = s * ((s + lobe.c11) * lobe.p2 - lobe.c12 * lobe.p1) / determinant;
  }
  float a1 = dot(hint.t1, I);
  float a2 = dot(hint.t2, I);
  float height = dot(hint.h, I);
  float at_mean = (height + a1 * lobe.p1 + a2 * lobe.p2) / sqrt(1.0 + lobe.p1 * lobe.p1 + lobe.p2 * lobe.p2);
  float at_light = (height + a1 * m1 + a2 * m2) / sqrt(1.0 + m1 * m1 + m2 * m2);
  return at_mean > 0.0 && at_light > 0.0 ? at_mean / at_light : 1.0;
}

/* `weight` times the anisotropic closure of one element or cell; tint: see surface_closure. */
closure color glint_closure(Facet facet, float weight, color tint, HalfVector hint, SlopeLobe lobe)
{
  normal n = normalize(hint.h + lobe.p1 * hint.t1 + lobe.p2 * hint.t2);

  /* Foreshorten slopes around h as seen from n: by 1 / (1 + p^2) along p, by its square root across. */
  float shrink = pow(1.0 + lobe.p1 * lobe.p1 + lobe.p2 * lobe.p2, -1.5);
  float alpha2 = facet.alpha * facet.alpha;
  float gain = facet_gain(facet, hint.radius) * shrink;
  float mean = 0.5 * gain * (lobe.c11 + lobe.c22);
  float half_difference = 0.5 * gain * (lobe.c11 - lobe.c22);
  float off = gain * lobe.c12;
  float radius = sqrt(half_difference * half_difference + off * off);

  /* Leave the closure isotropic where the axes differ by less than 1 % of the width. */
  vector axis = vector(0);
  if (radius < 0.01 * alpha2) {
    radius = 0.0;
  }
  else {
    float angle = 0.5 * atan2(off, half_difference);
    axis = cos(angle) * hint.t1 + sin(angle) * hint.t2;
  }
  return surface_closure(facet, weight, tint, n, axis, sqrt(max(alpha2 + mean + radius, LEAST_SHARE * alpha2)),
                         sqrt(max(alpha2 + mean - radius, LEAST_SHARE * alpha2)));
}

/* Sum of the closures of a selection and of the remainder. total: the sum to which the selection's weights are
 * relative. */
closure color selection_closures(Query query, output Map map, Hit hit, Selection s, float total,
                                 closure color remainder)
{
  closure color sum = remainder;
  for (int k = 0; k < min(s.count, s.limit); ++k) {
    SlopeLobe lobe = s.lobe[k];
    float w = total > 0.0 ? roulette(lobe.weight * s.sum[k] / (s.importance[k] * total), query.u, query.v, k) : 0.0;
    if (w > 0.0) {
      HalfVector hint = query.hints[s.hint[k]];
      if (s.is_merged) {
        w *= merged_reflection(hint, query.facet.alpha, lobe);
      }
      /* Add in this order: Cycles flattens sum + x only 16 deep and drops the rest. */
      color tint = 1.0;
      if (map.flakes.have_colors) {
        tint = element_color(map, hit, s.is_merged, lobe.place1, lobe.place2);
      }
      sum = glint_closure(query.facet, w, tint, hint, lobe) + sum;
      map.costs.closures += 1;
    }
  }
  return sum;
}
