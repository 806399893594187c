/* The selected elements: kept one by one while their closures fit the budget, else merged by moments. */

/* Cycles keeps 64 closures of a shading point and drops all others without a word. Of these 4 are left for the
 * remainder and for other shaders that a Mix Shader adds. */
#define CLOSURE_BUDGET 60
#define LARGEST_CLOSURES 64
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
  int count;       /* elements kept one by one; meaningless once merged */
  int limit;       /* most elements that are kept one by one */
  int merged;      /* whether elements are merged into cells */
  int cells;       /* merged cells of each hint, see hint_cells */
  float alpha;     /* of a facet */
  float middle_1;  /* middle of the cells in a wide region of radius 1, see cells_off */
  float middle_2;
  float weight[CLOSURE_BUDGET];
  float p1[CLOSURE_BUDGET];
  float p2[CLOSURE_BUDGET];
  float c11[CLOSURE_BUDGET];
  float c12[CLOSURE_BUDGET];
  float c22[CLOSURE_BUDGET];
  int hint[CLOSURE_BUDGET];
  /* Sums over the elements of a cell of weight, weight * p, and weight * (p p^T + covariance). */
  float cell_weight[CLOSURE_BUDGET];
  float cell_p1[CLOSURE_BUDGET];
  float cell_p2[CLOSURE_BUDGET];
  float cell_c11[CLOSURE_BUDGET];
  float cell_c12[CLOSURE_BUDGET];
  float cell_c22[CLOSURE_BUDGET];
};

/* Most closures of each of `lobes` lobes that one shading point sums, without the remainder. */
int closure_limit(int lobes)
{
  return min(CLOSURE_BUDGET, LARGEST_CLOSURES / lobes - 1);
}

/* Merged cells of each hint: a disk around the half vector and rings of sectors, of which the cells of all hints (of
 * all lobes of the shading point) fit the budget: decision 33. */
int hint_cells(int hints)
{
  return hints == 1 ? 37 : hints <= 3 ? 19 : hints == 4 ? 14 : 7;
}

/* In the wide region of a wide light, cells are wider than a facet's lobe, and the sum of their Gaussians has hills and
 * valleys. A narrow light, a tube or a wire, would lie at the same place among them in all samples. So the cells are
 * laid around a random point, up to CELLS_OFF radii off the half vector: decision 34. Regions up to CELLS_STILL alpha
 * wide keep the half vector as their middle, and regions from CELLS_MOVED alpha on use all of CELLS_OFF. */
#define CELLS_OFF 0.2
#define CELLS_STILL 3.5
#define CELLS_MOVED 5.0

/* The part of CELLS_OFF that a region of radius `radius` uses, 0..1. */
float cells_off(float radius, float alpha)
{
  return clamp((radius / max(alpha, 1e-6) - CELLS_STILL) / (CELLS_MOVED - CELLS_STILL), 0.0, 1.0);
}

/* Number of the cell that contains a slope; x, y: in radii of the region from the middle of the cells; cells: of each
 * hint. */
int cell_index(int cells, int hint, float x, float y)
{
  float r = sqrt(x * x + y * y);
  int first = 0;
  int sectors = 1;
  if (cells == 37) {
    first = r < 0.18 ? 0 : r < 0.45 ? 1 : r < 0.72 ? 7 : 19;
    sectors = r < 0.18 ? 1 : r < 0.45 ? 6 : r < 0.72 ? 12 : 18;
  }
  else if (cells == 19) {
    first = r < 0.25 ? 0 : r < 0.6 ? 1 : 7;
    sectors = r < 0.25 ? 1 : r < 0.6 ? 6 : 12;
  }
  else if (cells == 14) {
    first = r < 0.25 ? 0 : r < 0.6 ? 1 : 6;
    sectors = r < 0.25 ? 1 : r < 0.6 ? 5 : 8;
  }
  else {
    first = r < 0.37 ? 0 : 1;
    sectors = r < 0.37 ? 1 : 6;
  }
  int sector = (int)floor((atan2(y, x) / M_2PI + 0.5) * sectors);
  return hint * cells + first + clamp(sector, 0, sectors - 1);
}

/* Add one element to its cell; radius: of the hint's region. */
void add_to_cell(output Selection s, int hint, float radius, float weight, SlopeMoments m)
{
  float off = cells_off(radius, s.alpha);
  int cell = cell_index(s.cells, hint, m.p1 / radius - off * s.middle_1, m.p2 / radius - off * s.middle_2);
  s.cell_weight[cell] += weight;
  s.cell_p1[cell] += weight * m.p1;
  s.cell_p2[cell] += weight * m.p2;
  s.cell_c11[cell] += weight * (m.p1 * m.p1 + m.c11);
  s.cell_c12[cell] += weight * (m.p1 * m.p2 + m.c12);
  s.cell_c22[cell] += weight * (m.p2 * m.p2 + m.c22);
}

/* Keep one selected element: by itself while the budget lasts, else merged into its cell. */
void select_element(output Selection s, HalfVector hints[8], int hint, float weight, SlopeMoments m)
{
  if (!s.merged && s.count < s.limit) {
    s.weight[s.count] = weight;
    s.p1[s.count] = m.p1;
    s.p2[s.count] = m.p2;
    s.c11[s.count] = m.c11;
    s.c12[s.count] = m.c12;
    s.c22[s.count] = m.c22;
    s.hint[s.count] = hint;
    s.count += 1;
    return;
  }
  if (!s.merged) {
    /* The budget is full: merge the elements kept so far into cells. */
    s.merged = 1;
    for (int k = 0; k < CLOSURE_BUDGET; ++k) {
      s.cell_weight[k] = 0;
      s.cell_p1[k] = 0;
      s.cell_p2[k] = 0;
      s.cell_c11[k] = 0;
      s.cell_c12[k] = 0;
      s.cell_c22[k] = 0;
    }
    for (int k = 0; k < s.limit; ++k) {
      SlopeMoments kept = { s.p1[k], s.p2[k], s.c11[k], s.c12[k], s.c22[k] };
      add_to_cell(s, s.hint[k], hints[s.hint[k]].radius, s.weight[k], kept);
    }
  }
  add_to_cell(s, hint, hints[hint].radius, weight, m);
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

/* Least squared width of a closure, in alpha^2: cells of counts.h may have a negative covariance. */
#define LEAST_SHARE 0.5

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
