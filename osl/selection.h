#pragma once
/* The selected elements, of which a few are drawn: each stands for others, and no light is lost.
 *
 * Elements are shared out in turn among reservoirs, and each reservoir keeps one of its own with odds of its
 * importance: about what the element shows of the hinted light. With S the sum of a reservoir's importances, the
 * element that it keeps has the weight w S / importance. The expectation is the sum of all elements under any light;
 * where no more elements are selected than there are reservoirs, each is kept as it is. Chao: A General Purpose
 * Unequal Probability Sampling Plan, Biometrika 1982. */

#include "query.h"

/* Most reservoirs of a lobe: more gain nothing, and leave less room for the shaders that a Mix Shader adds: decision
 * 63. */
#define CLOSURE_BUDGET 24
/* Importance, relative to that of an element in the middle of a region, below which none falls: it bounds the weight of
 * elements that other lights than the hinted ones show, and is as small as those at a region's rim: decision 73. */
#define LEAST_IMPORTANCE 0.002
/* Successive multiples modulo 1 are spread evenly: one for the odds of each reservoir. */
#define GOLDEN_RATIO 0.6180339887
/* Least squared width of a closure, in alpha^2: cells of counts.h may have a negative covariance. */
#define LEAST_SHARE 0.5

struct Selection {
  int count;     /* elements so far */
  int limit;     /* reservoirs */
  int is_merged; /* whether an element stands for many already: see merged_reflection */
  Facet facet;
  float random;  /* uniform number of this sample */
  /* Of each reservoir: the sum of importances, a number in 0..1 that says whether the next element replaces the one
   * that is kept, and that element. */
  float sum[CLOSURE_BUDGET];
  float odds[CLOSURE_BUDGET];
  float importance[CLOSURE_BUDGET];
  SlopeLobe lobe[CLOSURE_BUDGET];
  int hint[CLOSURE_BUDGET];
};

/* An empty selection for one of `lobes` lobes of a material that may return `closures` closures together, two each at
 * least: one is the remainder. */
Selection new_selection(int closures, int lobes, Facet facet)
{
  Selection s;
  s.count = 0;
  s.limit = clamp(closures / lobes - 1, 1, CLOSURE_BUDGET);
  s.is_merged = 0;
  s.facet = facet;
  s.random = 0.0;
  return s;
}

/* About what an element shows of a hinted light whose region has the radius `radius`: its lobe at the half vector,
 * widened by the light: decision 70. */
float element_importance(Facet facet, float radius, SlopeLobe lobe)
{
  float light = radius - REGION * facet.alpha;
  float alpha2 = facet.alpha * facet.alpha;
  float width = max(alpha2 + lobe.c11 + lobe.c22, LEAST_SHARE * alpha2) + 0.5 * light * light;
  return lobe.weight * (LEAST_IMPORTANCE + facet_lobe(facet, lobe.p1 * lobe.p1 + lobe.p2 * lobe.p2, width));
}

/* Offer one selected element to the reservoir whose turn it is; radius: of its hint's region. */
void select_element(output Selection s, int hint, float radius, SlopeLobe lobe)
{
  float importance = element_importance(s.facet, radius, lobe);
  if (!(importance > 0.0)) {
    return;
  }
  int k = s.count % s.limit;
  int is_kept = 1;
  if (s.count < s.limit) {
    float odds = s.random + GOLDEN_RATIO * k;
    s.odds[k] = odds - floor(odds);
    s.sum[k] = importance;
  }
  else {
    /* One number decides again and again: whatever it said last, what is left of it is uniform. */
    s.sum[k] += importance;
    float share = importance / s.sum[k];
    is_kept = s.odds[k] < share;
    s.odds[k] = is_kept ? s.odds[k] / share : (s.odds[k] - share) / max(1.0 - share, 1e-7); /* both may round to 1 */
  }
  s.count += 1;
  if (is_kept) {
    s.importance[k] = importance;
    s.lobe[k] = lobe;
    s.hint[k] = hint;
  }
}
