/* The elements that can send light, kept one by one while they fit the closures, merged by moments when they do not. */

/* Cycles takes 64 closures a shading point and drops the rest in silence; 3 are left for the remainder and the
 * material's neighbours in a Mix Shader. */
#define CLOSURE_BUDGET 60
#define LARGEST_CLOSURES 64
/* Cycles drops closures whose weight is below 1e-5; lighter ones are kept at this weight by Russian roulette. */
#define LEAST_WEIGHT 2e-5

/* The weight of a closure, 0 or LEAST_WEIGHT for one that Cycles would drop; seeds: of this sample and this closure. */
float roulette(float w, float seed_1, float seed_2, int k)
{
  if (w >= LEAST_WEIGHT) {
    return w;
  }
  return (float)hashnoise(point(seed_1, seed_2, k)) * LEAST_WEIGHT < w ? LEAST_WEIGHT : 0.0;
}

struct Selection {
  int count;       /* elements kept one by one; meaningless once merged */
  int limit;       /* how many may be */
  int merged;      /* whether the cells are in use */
  int cells;       /* cells of each hint, see hint_cells */
  float alpha;     /* of a facet */
  float middle_1;  /* where the middle of the cells lies in a wide region of radius 1, see cells_off */
  float middle_2;
  float weight[CLOSURE_BUDGET];
  float p1[CLOSURE_BUDGET];
  float p2[CLOSURE_BUDGET];
  float c11[CLOSURE_BUDGET];
  float c12[CLOSURE_BUDGET];
  float c22[CLOSURE_BUDGET];
  int hint[CLOSURE_BUDGET];
  /* Sums over a cell of weight, weight * p, weight * (p p^T + covariance). */
  float cell_weight[CLOSURE_BUDGET];
  float cell_p1[CLOSURE_BUDGET];
  float cell_p2[CLOSURE_BUDGET];
  float cell_c11[CLOSURE_BUDGET];
  float cell_c12[CLOSURE_BUDGET];
  float cell_c22[CLOSURE_BUDGET];
};

/* Closures of each of several lobes that one shading point sums, the remainder apart. */
int closure_limit(int lobes)
{
  return min(CLOSURE_BUDGET, LARGEST_CLOSURES / lobes - 1);
}

/* Cells of each hint, so that all hints' (of all lobes of the shading point) fit the budget: a disk around the half
 * vector and rings of sectors. Measured by benchmarks/merge_cells.py, random elements, a light 0.2 alpha off the middle;
 * relative rms and bias for 30 and for 400 elements, Beckmann | GGX:
 *   1 + 6 + 12 + 18 cells   0.2 %, 0.0 % and 0.2 %, -0.1 %   | 1.5 %,  0.0 % and 0.6 %, -0.3 %
 *   1 + 6 + 12              0.8 %, 0.2 % and 0.4 %, -0.2 %   | 3.6 %,  0.6 % and 1.6 %,  0.5 %
 *   1 + 5 + 8               1.0 %, 0.3 % and 0.4 %,  0.1 %   | 3.6 %,  0.1 % and 1.5 %, -0.2 %
 *   1 + 6                   3.4 %, -0.2 % and 1.9 %, -1.6 %  | 9.9 %,  4.0 % and 6.5 %,  4.7 %
 * Squares do worse: 6 x 6 0.3 % | 1.5 %, 3 x 3 3.7 % | 11 %, 2 x 2 15 % and -14 % (the light shines on their corner). */
int hint_cells(int hints)
{
  return hints == 1 ? 37 : hints <= 3 ? 19 : hints == 4 ? 14 : 7;
}

/* In wide regions, those of wide lights, cells are wider than a facet's lobe. The Gaussian that stands for one has its own
 * hills and valleys, and a narrow light, a tube or a wire, would always lie at the same place among them: cells are laid
 * around a random point, up to CELLS_OFF radii off the half vector. Mean error under a tube 2.5, 5, 10, 17 alpha long to
 * each side, random slopes, by numpy: -0.5, -3.3, -13, -13 % in the middle, -0.1, -0.5, -0.1, -0.2 % with 0.2.
 * Narrow regions stay as they are: up to the first width, in alpha; all of it from the second on. */
#define CELLS_OFF 0.2
#define CELLS_STILL 3.5
#define CELLS_MOVED 5.0

/* How much of that way the cells of a region are off; radius: of the region. */
float cells_off(float radius, float alpha)
{
  return clamp((radius / max(alpha, 1e-6) - CELLS_STILL) / (CELLS_MOVED - CELLS_STILL), 0.0, 1.0);
}

/* Which of `cells` around each hint has the slope (x, y), in radii of the region from the middle of the cells. */
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

void add_to_cell(output Selection s, int hint, float radius, float weight, float p1, float p2, float c11, float c12,
                 float c22)
{
  float off = cells_off(radius, s.alpha);
  int cell = cell_index(s.cells, hint, p1 / radius - off * s.middle_1, p2 / radius - off * s.middle_2);
  s.cell_weight[cell] += weight;
  s.cell_p1[cell] += weight * p1;
  s.cell_p2[cell] += weight * p2;
  s.cell_c11[cell] += weight * (p1 * p1 + c11);
  s.cell_c12[cell] += weight * (p1 * p2 + c12);
  s.cell_c22[cell] += weight * (p2 * p2 + c22);
}

/* Keep one element: as it is while the budget lasts, else in its cell. */
void select_element(output Selection s, HalfVector hints[8], int hint, float weight, float p1, float p2, float c11,
                    float c12, float c22)
{
  if (!s.merged && s.count < s.limit) {
    s.weight[s.count] = weight;
    s.p1[s.count] = p1;
    s.p2[s.count] = p2;
    s.c11[s.count] = c11;
    s.c12[s.count] = c12;
    s.c22[s.count] = c22;
    s.hint[s.count] = hint;
    s.count += 1;
    return;
  }
  if (!s.merged) {
    /* The budget is full: move what is there into cells. */
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
      add_to_cell(s, s.hint[k], hints[s.hint[k]].radius, s.weight[k], s.p1[k], s.p2[k], s.c11[k], s.c12[k], s.c22[k]);
    }
  }
  add_to_cell(s, hint, hints[hint].radius, weight, p1, p2, c11, c12, c22);
}

/* Facets of a normal n reflect by 1 / (n.I), which at grazing views changes across a merged cell: relative to that of the
 * cell's own normal (slope p, covariance c), the reflection of those facets in it that mirror the hinted light. Their mean
 * slope is p alpha^2/2 (alpha^2/2 + c)^-1: the product of the cell's spread and the lobe. Without it a view at 8 degrees
 * gains 8 % where a cell is as wide as 1.25 alpha. 1 for a single facet, and on average over cells around the light. */
float merged_reflection(HalfVector hint, float alpha, float p1, float p2, float c11, float c12, float c22)
{
  float s = 0.5 * alpha * alpha;
  float m1 = p1;
  float m2 = p2;
  if (min(c11, c22) > 0.0) {
    float determinant = (s + c11) * (s + c22) - c12 * c12;
    m1 = s * ((s + c22) * p1 - c12 * p2) / determinant;
    m2 = s * ((s + c11) * p2 - c12 * p1) / determinant;
  }
  float a1 = dot(hint.t1, I);
  float a2 = dot(hint.t2, I);
  float height = dot(hint.h, I);
  float own = (height + a1 * p1 + a2 * p2) / sqrt(1.0 + p1 * p1 + p2 * p2);
  float met = (height + a1 * m1 + a2 * m2) / sqrt(1.0 + m1 * m1 + m2 * m2);
  return own > 0.0 && met > 0.0 ? own / met : 1.0;
}

/* Of a closure's alpha^2, where its covariance is negative (counts.h). */
#define LEAST_SHARE 0.5

/* Anisotropic closure of one element or cell: mean slope p and slope covariance c around the half vector. */
closure color glint_closure(string distribution, HalfVector hint, float alpha, float p1, float p2, float c11, float c12,
                            float c22)
{
  normal n = normalize(hint.h + p1 * hint.t1 + p2 * hint.t2);

  /* A slope around h is foreshortened seen from n: by 1 / (1 + p^2) along p, by its square root across. */
  float shrink = pow(1.0 + p1 * p1 + p2 * p2, -1.5);
  float mean = 0.5 * (c11 + c22) * shrink;
  float half_difference = 0.5 * (c11 - c22) * shrink;
  float off = c12 * shrink;
  float radius = sqrt(half_difference * half_difference + off * off);
  float alpha2 = alpha * alpha;

  /* Spare the anisotropic code where the difference of the axes cannot be seen (1 % of the width). */
  if (radius < 0.01 * alpha2) {
    float a = sqrt(max(alpha2 + 2.0 * mean, LEAST_SHARE * alpha2));
    return microfacet(distribution, n, vector(0), a, a, 0.0, 0);
  }
  float angle = 0.5 * atan2(off, half_difference);
  vector axis = cos(angle) * hint.t1 + sin(angle) * hint.t2;
  return microfacet(distribution, n, axis, sqrt(max(alpha2 + 2.0 * (mean + radius), LEAST_SHARE * alpha2)),
                    sqrt(max(alpha2 + 2.0 * (mean - radius), LEAST_SHARE * alpha2)), 0.0, 0);
}
