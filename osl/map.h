/* The normal map: texels, bilinear patches, and their slopes around a half vector. */

/* The table of counts of the map's slopes: see counts.h. */
struct Counts {
  string table;
  int first;  /* side in texels of the smallest block; 0: there are no counts */
  int levels;
  vector low;  /* slopes of the lowest corner of the bins */
  vector high; /* slopes of the highest corner */
};

struct Map {
  string table;
  int width;
  int height;
  float inverse_padded_width;
  float inverse_padded_height;
  float strength;
  int is_linear;
  Counts counts;
  string index; /* table of slope_index.h */
  int is_indexed; /* whether the index exists */
  int visits;     /* most elements that a sample visits (query.h), up to LARGEST_VISIT */
  /* Right corners of the patch that was fetched before, which are the left corners of the next patch in its row. */
  int kept;    /* row times map width plus column of these corners plus 1; 0: no corners are kept */
  vector kept_low;
  vector kept_high;
  int fetches; /* texture() calls so far; OSL leaves the count out unless the shader's output Costs is linked */
};

/* The map at the hit point. */
struct Hit {
  float u;         /* texel coordinates; for Linear less half a texel, so that patches start at whole numbers */
  float v;
  float i;         /* whole parts of u and v: the texel or patch */
  float j;
  vector n;        /* tangent-space normal, not normalised */
  vector unscaled; /* tangent-space normal as the map stores it, without Strength */
};

int map_is_intact(output Map map)
{
  map.fetches += 1;
  return table_is_intact(map.table, map.inverse_padded_width, map.inverse_padded_height);
}

/* The normal of texel (i, j) as the map stores it, without Strength. */
vector unscaled_normal(output Map map, int i, int j)
{
  map.fetches += 1;
  return table_texel(map.table, map.inverse_padded_width, map.inverse_padded_height, i, j);
}

vector map_normal(output Map map, int i, int j)
{
  vector n = unscaled_normal(map, i, j);
  return map.strength == 1.0 ? n : strengthened(n, map.strength);
}

/* The bilinear patch between texel (i, j) and its right and upper neighbours: their normals. */
struct Patch {
  vector n00;
  vector n10;
  vector n01;
  vector n11;
};

Patch map_patch(output Map map, int i, int j)
{
  int i1 = i + 1 < map.width ? i + 1 : 0;
  int j1 = j + 1 < map.height ? j + 1 : 0;
  Patch patch;
  int is_kept = map.kept == j * map.width + i + 1;
  patch.n00 = is_kept ? map.kept_low : map_normal(map, i, j);
  patch.n01 = is_kept ? map.kept_high : map_normal(map, i, j1);
  patch.n10 = map_normal(map, i1, j);
  patch.n11 = map_normal(map, i1, j1);
  map.kept = j * map.width + i1 + 1;
  map.kept_low = patch.n10;
  map.kept_high = patch.n11;
  return patch;
}

/* Normal at (a, b) in 0..1 of the patch, as an Image Texture node interpolates it; not normalised. */
vector patch_normal(Patch patch, float a, float b)
{
  return (1.0 - b) * ((1.0 - a) * patch.n00 + a * patch.n10) + b * ((1.0 - a) * patch.n01 + a * patch.n11);
}

/* The three forms of slope_forms over a patch: their value at (0, 0) and their change with a, with b, and with a b. A
 * slope is a quotient of forms; an interpolation of slopes would lose light: decision 11. */
struct PatchSlopes {
  vector origin;
  vector by_a;
  vector by_b;
  vector by_ab;
};

/* Forms (n.f1, n.f2, n.f3) of a normal at a texel offset, with the turn of surface and half vector to that place. */
vector slope_forms(HalfVector hint, vector n, float offset_u, float offset_v)
{
  float along = dot(n, hint.f3);
  return vector(dot(n, hint.f1) + along * (offset_u * hint.turn_u1 + offset_v * hint.turn_v1),
                dot(n, hint.f2) + along * (offset_u * hint.turn_u2 + offset_v * hint.turn_v2), along);
}

/* Forms of a patch; offset_u, offset_v: texel offset of its lower left corner. Returns 0 if the patch crosses the half
 * vector's horizon, or lies beyond one side of the square around the region. */
int patch_slopes(HalfVector hint, Patch patch, float offset_u, float offset_v, output PatchSlopes s)
{
  vector c00 = slope_forms(hint, patch.n00, offset_u, offset_v);
  vector c10 = slope_forms(hint, patch.n10, offset_u + 1.0, offset_v);
  vector c01 = slope_forms(hint, patch.n01, offset_u, offset_v + 1.0);
  vector c11 = slope_forms(hint, patch.n11, offset_u + 1.0, offset_v + 1.0);
  s.origin = c00;
  s.by_a = c10 - c00;
  s.by_b = c01 - c00;
  s.by_ab = c11 - c10 - s.by_b;
  float r = hint.radius;
  return min(min(c00[2], c10[2]), min(c01[2], c11[2])) > 0.0 &&
         min(min(c00[0] - r * c00[2], c10[0] - r * c10[2]), min(c01[0] - r * c01[2], c11[0] - r * c11[2])) < 0.0 &&
         max(max(c00[0] + r * c00[2], c10[0] + r * c10[2]), max(c01[0] + r * c01[2], c11[0] + r * c11[2])) > 0.0 &&
         min(min(c00[1] - r * c00[2], c10[1] - r * c10[2]), min(c01[1] - r * c01[2], c11[1] - r * c11[2])) < 0.0 &&
         max(max(c00[1] + r * c00[2], c10[1] + r * c10[2]), max(c01[1] + r * c01[2], c11[1] + r * c11[2])) > 0.0;
}

/* Whether the patch's normal at (a, b) lies in the region around the half vector, and its slope there. */
int patch_slope(HalfVector hint, PatchSlopes s, float a, float b, output float p1, output float p2)
{
  vector form = s.origin + a * s.by_a + b * (s.by_b + a * s.by_ab);
  p1 = form[0] / form[2];
  p2 = form[1] / form[2];
  return p1 * p1 + p2 * p2 < hint.radius * hint.radius;
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

/* Slopes of an element or a cell around a half vector: their mean and covariance. */
struct SlopeMoments {
  float p1;
  float p2;
  float c11;
  float c12;
  float c22;
};

/* Covariance J S J^T of the slopes in a part of a patch, whose positions have the covariance S. */
void patch_covariance(PatchSlopes s, PatchPart part, output SlopeMoments m)
{
  vector form = s.origin + part.a * s.by_a + part.b * (s.by_b + part.a * s.by_ab);
  vector by_a = s.by_a + part.b * s.by_ab;
  vector by_b = s.by_b + part.a * s.by_ab;
  float p1 = form[0] / form[2];
  float p2 = form[1] / form[2];
  vector first = (part.first_a * by_a + part.first_b * by_b) / form[2];
  vector second = (part.second_a * by_a + part.second_b * by_b) / form[2];
  float e1 = first[0] - p1 * first[2];
  float e2 = first[1] - p2 * first[2];
  float g1 = second[0] - p1 * second[2];
  float g2 = second[1] - p2 * second[2];
  m.c11 = e1 * e1 + g1 * g1;
  m.c12 = e1 * e2 + g1 * g2;
  m.c22 = e2 * e2 + g2 * g2;
}

/* A patch is cut until a part spans no more than this many alpha: a uniform spread that narrow, convolved with the lobe
 * (deviation alpha / sqrt(2)), cannot be told from a Gaussian. */
#define PART_SPAN 1.5
#define MOST_PARTS 8

/* Square of the angle between two normals of any length, in radians, or a little more. */
float square_turn(vector from, vector to)
{
  vector across = to - from;
  return dot(across, across) / max(min(dot(from, from), dot(to, to)), 1e-12);
}

/* Parts of a patch along one side; the arguments are the normals at the ends of the patch's two edges along that
 * side. */
int patch_parts(vector from_a, vector to_a, vector from_b, vector to_b, float alpha)
{
  float span = sqrt(max(square_turn(from_a, to_a), square_turn(from_b, to_b)));
  return (int)clamp(ceil(span / (PART_SPAN * max(alpha, 1e-6))), 1.0, float(MOST_PARTS));
}

int patch_columns(Patch patch, float alpha)
{
  return patch_parts(patch.n00, patch.n10, patch.n01, patch.n11, alpha);
}

int patch_rows(Patch patch, float alpha)
{
  return patch_parts(patch.n00, patch.n01, patch.n10, patch.n11, alpha);
}
