/* The selected elements, of which a few are drawn: each stands for others, and no light is lost.
 *
 * Elements are shared out in turn among reservoirs, and each reservoir keeps one of its own with odds of its importance:
 * about what the element shows of the hinted light. With S the sum of a reservoir's importances, the element that it
 * keeps has the weight w S / importance. The expectation is the sum of all elements under any light; where no more
 * elements are selected than there are reservoirs, each is kept as it is. Chao: A General Purpose Unequal Probability
 * Sampling Plan, Biometrika 1982. */

/* Cycles keeps 64 closures of a shading point and drops all others without a word. */
#define LARGEST_CLOSURES 64
/* Most reservoirs, which leaves room for the remainder, and for other shaders that a Mix Shader adds: decision 63. */
#define CLOSURE_BUDGET 24
/* Importance, relative to that of an element in the middle of a region, below which none falls: it bounds the weight of
 * elements that other lights than the hinted ones show. */
#define LEAST_IMPORTANCE 0.02
/* Successive multiples modulo 1 are spread evenly: one for the odds of each reservoir. */
#define GOLDEN_RATIO 0.6180339887
/* Least squared width of a closure, in alpha^2: cells of counts.h may have a negative covariance. */
#define LEAST_SHARE 0.5
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

struct Selection {
  int count;     /* elements so far */
  int limit;     /* reservoirs */
  int is_merged; /* whether an element stands for many already: see merged_reflection */
  int is_ggx;
  float alpha;   /* of a facet */
  float random;  /* uniform number of this sample */
  /* Of each reservoir: the sum of importances, a number in 0..1 that says whether the next element replaces the one
   * that is kept, and that element. */
  float sum[CLOSURE_BUDGET];
  float odds[CLOSURE_BUDGET];
  float importance[CLOSURE_BUDGET];
  float weight[CLOSURE_BUDGET];
  float p1[CLOSURE_BUDGET];
  float p2[CLOSURE_BUDGET];
  float c11[CLOSURE_BUDGET];
  float c12[CLOSURE_BUDGET];
  float c22[CLOSURE_BUDGET];
  int hint[CLOSURE_BUDGET];
};

/* An empty selection for one of `lobes` lobes of a shading point that may return `closures` closures besides the
 * remainder. */
Selection new_selection(int closures, int lobes, int is_ggx, float alpha, float random)
{
  Selection s;
  s.count = 0;
  s.limit = max(min(min(closures, CLOSURE_BUDGET), LARGEST_CLOSURES / lobes - 1), 1);
  s.is_merged = 0;
  s.is_ggx = is_ggx;
  s.alpha = alpha;
  s.random = random;
  return s;
}

/* About what an element shows of a hinted light whose region has the radius `radius`: its lobe at the half vector,
 * widened by the light. */
float element_importance(Selection s, float radius, float weight, SlopeMoments m)
{
  float light = radius - REGION * s.alpha;
  float alpha2 = s.alpha * s.alpha;
  float width = max(alpha2 + m.c11 + m.c22, LEAST_SHARE * alpha2) + 0.5 * light * light;
  float square = (m.p1 * m.p1 + m.p2 * m.p2) / max(width, 1e-30);
  float lobe = s.is_ggx ? 1.0 / ((1.0 + square) * (1.0 + square)) : exp(-square);
  return weight * (LEAST_IMPORTANCE + lobe);
}

/* Offer one selected element to the reservoir whose turn it is. */
void select_element(output Selection s, HalfVector hints[HINT_COUNT], int hint, float weight, SlopeMoments m)
{
  float importance = element_importance(s, hints[hint].radius, weight, m);
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
    s.weight[k] = weight;
    s.p1[k] = m.p1;
    s.p2[k] = m.p2;
    s.c11[k] = m.c11;
    s.c12[k] = m.c12;
    s.c22[k] = m.c22;
    s.hint[k] = hint;
  }
}

/* A facet of normal n reflects by 1 / (n.I), which at a grazing view changes across a merged cell. This is the
 * reflection of those facets of the cell that mirror the hinted light, relative to the reflection of the cell's mean
 * normal (slope p, covariance c). The mean slope of these facets is p alpha^2/2 (alpha^2/2 + c)^-1: the mean of the
 * product of the cell's distribution and the lobe. Returns 1 for a single facet, and 1 on average over cells around the
 * light. Without it wide cells are too bright: decision 35. */
float merged_reflection(HalfVector hint, float alpha, SlopeMoments m)
{
  float s = 0.5 * alpha * alpha;
  float m1 = m.p1;
  float m2 = m.p2;
  if (min(m.c11, m.c22) > 0.0) {
    float determinant = (s + m.c11) * (s + m.c22) - m.c12 * m.c12;
    m1 = s * ((s + m.c22) * m.p1 - m.c12 * m.p2) / determinant;
    m2 = s * ((s + m.c11) * m.p2 - m.c12 * m.p1) / determinant;
  }
  float a1 = dot(hint.t1, I);
  float a2 = dot(hint.t2, I);
  float height = dot(hint.h, I);
  float at_mean = (height + a1 * m.p1 + a2 * m.p2) / sqrt(1.0 + m.p1 * m.p1 + m.p2 * m.p2);
  float at_light = (height + a1 * m1 + a2 * m2) / sqrt(1.0 + m1 * m1 + m2 * m2);
  return at_mean > 0.0 && at_light > 0.0 ? at_mean / at_light : 1.0;
}

/* Anisotropic closure of one element or cell. */
closure color glint_closure(string distribution, HalfVector hint, float alpha, SlopeMoments m)
{
  normal n = normalize(hint.h + m.p1 * hint.t1 + m.p2 * hint.t2);

  /* Foreshorten slopes around h as seen from n: by 1 / (1 + p^2) along p, by its square root across. */
  float shrink = pow(1.0 + m.p1 * m.p1 + m.p2 * m.p2, -1.5);
  float mean = 0.5 * (m.c11 + m.c22) * shrink;
  float half_difference = 0.5 * (m.c11 - m.c22) * shrink;
  float off = m.c12 * shrink;
  float radius = sqrt(half_difference * half_difference + off * off);
  float alpha2 = alpha * alpha;

  /* Use an isotropic closure where the axes differ by less than 1 % of the width. */
  if (radius < 0.01 * alpha2) {
    float a = sqrt(max(alpha2 + 2.0 * mean, LEAST_SHARE * alpha2));
    return microfacet(distribution, n, vector(0), a, a, 0.0, 0);
  }
  float angle = 0.5 * atan2(off, half_difference);
  vector axis = cos(angle) * hint.t1 + sin(angle) * hint.t2;
  return microfacet(distribution, n, axis, sqrt(max(alpha2 + 2.0 * (mean + radius), LEAST_SHARE * alpha2)),
                    sqrt(max(alpha2 + 2.0 * (mean - radius), LEAST_SHARE * alpha2)), 0.0, 0);
}
