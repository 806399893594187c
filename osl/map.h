#pragma once
/* The normal map: its tables, texels and bilinear patches. */

#include "counters.h"
#include "table.h"
#include "tiles.h"

/* The table of counts of the map's slopes: see counts_table.h. */
struct Counts {
  string table;
  int first;  /* side in texels of the smallest block; 0: there are no counts */
  int levels;
  vector low;  /* slopes of the lowest corner of the bins */
  vector high; /* slopes of the highest corner */
};

/* The table of the map's flakes: see flakes.h. Texels that are no flakes have the normal 0. */
struct MapFlakes {
  string table;
  int are_there;   /* else all texels are facets of the surface, and the table is never read */
  int have_colors; /* of their own, else all are 1 */
  int levels;      /* above the level of single texels */
  int log_width;   /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

struct Map {
  string table;
  int width;
  int height;
  float inverse_padded_width;
  float inverse_padded_height;
  float strength;
  int is_linear;
  vector low;   /* bounds of the slopes, without Strength; high is above low nowhere: unknown */
  vector high;
  Counts counts;
  string index; /* table of slope_index.h */
  int is_indexed; /* whether the index exists */
  MapFlakes flakes;
  int variation; /* one of VARIATION_..., 0: the map repeats as it is */
  /* Number of the tile of the hit point, and its cut: see tiles.h. */
  int tile_u;
  int tile_v;
  int cut_u;
  int cut_v;
  int visits;     /* most elements that a sample visits (query.h), up to LARGEST_VISIT */
  /* Right corners of the patch that was fetched before, which are the left corners of the next patch in its row. */
  int kept;    /* row times map width plus column of these corners plus 1; 0: no corners are kept */
  vector kept_low;
  vector kept_high;
  SampleCosts costs; /* of this sample so far */
};

/* The flakes around a hit point. */
struct FlakesAround {
  float coverage; /* part of the area, 0..1 */
  color mean;     /* colour, of blocks of more than one texel */
};

/* The map at the hit point. */
struct Hit {
  /* Texel coordinates in a plane in which the map repeats as the tile of the hit point shows it, but for other tiles;
   * for Linear less half a texel, so that patches start at whole numbers. */
  float u;
  float v;
  float i;         /* whole parts of u and v: the texel or patch */
  float j;
  int column;      /* that texel in the table */
  int row;
  vector n;        /* tangent-space normal, not normalised */
  vector unscaled; /* tangent-space normal as the map stores it, without Strength */
  int is_flake;    /* else n and unscaled are 0 */
  FlakesAround flakes;
};

int map_is_intact(output Map map)
{
  map.costs.fetches += 1;
  return table_is_intact(map.table, map.inverse_padded_width, map.inverse_padded_height);
}

/* The normal of texel (i, j) as the map stores it, without Strength. */
vector unscaled_normal(output Map map, int i, int j)
{
  map.costs.fetches += 1;
  return table_texel(map.table, map.inverse_padded_width, map.inverse_padded_height, i, j);
}

/* Whether a texel is a flake, by its normal without Strength; maps without flakes have facets everywhere. */
int is_flake(Map map, vector unscaled)
{
  return !map.flakes.are_there || unscaled != vector(0);
}

vector map_normal(output Map map, int i, int j)
{
  vector n = unscaled_normal(map, i, j);
  return map.strength == 1.0 || !is_flake(map, n) ? n : strengthened(n, map.strength);
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

/* Texels from the plane in which the map repeats as in the tile of texel (column, row) to the plane of the hit point
 * (see Hit). */
void tile_shift(Map map, int column, int row, output int shift_u, output int shift_v)
{
  shift_u = 0;
  shift_v = 0;
  if (map.variation) {
    int right = tile_of(column - map.cut_u, map.width);
    int up = tile_of(row - map.cut_v, map.height);
    if (right || up) {
      int cut_u, cut_v;
      tile_cut(map.tile_u + right, map.tile_v + up, map.width, map.height, cut_u, cut_v);
      shift_u = map.cut_u - cut_u;
      shift_v = map.cut_v - cut_v;
    }
  }
}

/* The texel (i, j) of the table that texel (column, row) of the plane of the hit point shows. */
void map_texel(Map map, int column, int row, output int i, output int j)
{
  int shift_u, shift_v;
  tile_shift(map, column, row, shift_u, shift_v);
  i = wrapped(column - shift_u, map.width);
  j = wrapped(row - shift_v, map.height);
}

/* The map at UV coordinates, which are reduced to one repeat first, because large UVs would lose precision. */
Hit map_hit(output Map map, point uv)
{
  map.tile_u = (int)floor(uv[0]);
  map.tile_v = (int)floor(uv[1]);
  map.cut_u = 0;
  map.cut_v = 0;
  if (map.variation) {
    tile_cut(map.tile_u, map.tile_v, map.width, map.height, map.cut_u, map.cut_v);
  }
  Hit hit;
  hit.u = map.cut_u + (uv[0] - floor(uv[0])) * map.width - (map.is_linear ? 0.5 : 0.0);
  hit.v = map.cut_v + (uv[1] - floor(uv[1])) * map.height - (map.is_linear ? 0.5 : 0.0);
  hit.i = floor(hit.u);
  hit.j = floor(hit.v);
  hit.column = wrapped((int)hit.i, map.width);
  hit.row = wrapped((int)hit.j, map.height);
  if (!map.is_linear) {
    hit.unscaled = unscaled_normal(map, hit.column, hit.row);
  }
  else if (hit.i >= 0 && hit.j >= 0 && hit.i + 1 < map.width && hit.j + 1 < map.height) {
    map.costs.fetches += 1;
    hit.unscaled = table_between(map.table, map.inverse_padded_width, map.inverse_padded_height, hit.u + 0.5,
                                 hit.v + 0.5);
  }
  else {
    /* Interpolate across the map's edge from four texels, because the padded table continues with other values. */
    Map plain = map;
    plain.strength = 1.0;
    plain.kept = 0;
    hit.unscaled = patch_normal(map_patch(plain, hit.column, hit.row), hit.u - hit.i, hit.v - hit.j);
    map.costs.fetches = plain.costs.fetches;
  }
  hit.is_flake = is_flake(map, hit.unscaled);
  hit.n = hit.is_flake ? strengthened(hit.unscaled, map.strength) : vector(0);
  return hit;
}
