#pragma once
/* The table of the index: the texels of small blocks of the map, sorted by slope into cells. Layout:
 * glint_addon/bake/slope_index.py, which writes the table. */

#include "light_hint.h"
#include "map.h"

#define INDEX_MAGIC 7951.0
#define INDEX_SIDE 32
#define INDEX_COLUMNS 36
#define INDEX_ROWS 14
#define INDEX_RECORD 256
#define INDEX_FIRST_PREFIX 2
#define INDEX_FIRST_ELEMENT 128

/* Least n.z within a region: below it slopes grow without bounds. */
#define INDEX_HEIGHT 0.02
/* By how many cells a range of slopes is widened, for the rounding of the baker and of the shader. */
#define INDEX_ROUNDING 0.01

struct Index {
  string table;
  int columns; /* blocks along u and v */
  int rows;
  int log_width; /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

/* A texel of the list. fourth: its alpha channel. */
color index_texel(Index index, int texel, output float fourth)
{
  return texture(index.table, ((texel & ((1 << index.log_width) - 1)) + 0.5) * index.inverse_width,
                 ((texel >> index.log_width) + 0.5) * index.inverse_height, 0, 0, 0, 0, "alpha", fourth);
}

Index map_index(string table, int width, int height)
{
  Index index;
  index.table = table;
  index.columns = (width + INDEX_SIDE - 1) / INDEX_SIDE;
  index.rows = (height + INDEX_SIDE - 1) / INDEX_SIDE;
  list_shape(INDEX_RECORD * index.columns * index.rows, index.log_width, index.inverse_width, index.inverse_height);
  return index;
}

/* First texel of the block that contains texel i along a side of `size` texels, where the map repeats. place: the
 * block's number within the map. */
int block_start(int i, int size, output int place)
{
  int within = wrapped(i, size);
  place = within / INDEX_SIDE;
  return i - within % INDEX_SIDE;
}

/* Directions n(p) = p1 g1 + p2 g2 + g3 of the slopes p around a half vector. */
struct SlopeBasis {
  vector g1;
  vector g2;
  vector g3;
};

SlopeBasis slope_basis(HalfVector hint)
{
  SlopeBasis basis;
  basis.g1 = cross(hint.f2, hint.f3);
  float inverse = 1.0 / dot(hint.f1, basis.g1);
  basis.g1 *= inverse;
  basis.g2 = inverse * cross(hint.f3, hint.f1);
  basis.g3 = inverse * cross(hint.f1, hint.f2);
  return basis;
}

/* Whether all normals within `radius` of slope c = (c1, c2) around the half vector lie above the surface. */
int region_is_upright(SlopeBasis basis, float c1, float c2, float radius)
{
  return basis.g3[2] + c1 * basis.g1[2] + c2 * basis.g2[2] > radius * hypot(basis.g1[2], basis.g2[2]) + INDEX_HEIGHT;
}

/* Bounds of n[axis] / n.z over the normals n within `radius` of middle, whose slope axes are g1 and g2: the s for which
 * the plane n[axis] = s n.z touches the disk. */
void region_bounds(vector middle, vector g1, vector g2, float radius, int axis, output float low, output float high)
{
  float r2 = radius * radius;
  float a = middle[2] * middle[2] - r2 * (g1[2] * g1[2] + g2[2] * g2[2]);
  float b = middle[axis] * middle[2] - r2 * (g1[axis] * g1[2] + g2[axis] * g2[2]);
  float c = middle[axis] * middle[axis] - r2 * (g1[axis] * g1[axis] + g2[axis] * g2[axis]);
  float root = sqrt(max(b * b - a * c, 0.0));
  low = (b - root) / a;
  high = (b + root) / a;
}

/* Bounds of slopes with Strength -> bounds of the map's slopes without Strength, if no normal's z is below `least_z`
 * (see strengthened). */
void unscaled_bounds(float strength, float least_z, output float low, output float high)
{
  float share = clamp(strength, 0.0, 1.0);
  float one = ((1.0 - share) + share) / strength;
  float other = ((1.0 - share) / least_z + share) / strength;
  float from = min(min(low * one, low * other), min(high * one, high * other));
  high = max(max(low * one, low * other), max(high * one, high * other));
  low = from;
}

/* The cells of a block that can contain slopes of a hint's region. */
struct CellRange {
  int from1;
  int to1;
  int from2;
  int to2;
  int listed; /* texels in all cells of the block; the other flakes, the tail, are always visited */
  int absent; /* texels of the block that are no flakes: they are in neither */
  int is_intact; /* whether the block's record is whole (see table_is_intact); else the range has no cells */
};

/* The cells of a block for a hint; c1, c2, radius: a region that holds the hint's regions at all texels of the
 * block. */
CellRange block_cells(output Map map, Index index, int record, SlopeBasis basis, float c1, float c2, float radius)
{
  float scale2 = 0;
  color cells = index_texel(index, record, scale2);
  float magic = 0;
  color extent = index_texel(index, record + 1, magic);
  map.costs.fetches += 2;
  vector middle = basis.g3 + c1 * basis.g1 + c2 * basis.g2;
  float low1, low2, high1, high2;
  region_bounds(middle, basis.g1, basis.g2, radius, 0, low1, high1);
  region_bounds(middle, basis.g1, basis.g2, radius, 1, low2, high2);
  if (map.strength != 1.0) {
    unscaled_bounds(map.strength, extent[1], low1, high1);
    unscaled_bounds(map.strength, extent[1], low2, high2);
  }
  CellRange range;
  range.from1 = (int)clamp((low1 - cells[0]) * cells[2] - INDEX_ROUNDING, 0.0, INDEX_COLUMNS - 1.0);
  range.to1 = (int)clamp((high1 - cells[0]) * cells[2] + INDEX_ROUNDING, 0.0, INDEX_COLUMNS - 1.0);
  range.from2 = (int)clamp((low2 - cells[1]) * scale2 - INDEX_ROUNDING, 0.0, INDEX_ROWS - 1.0);
  range.to2 = (int)clamp((high2 - cells[1]) * scale2 + INDEX_ROUNDING, 0.0, INDEX_ROWS - 1.0);
  range.listed = (int)extent[2];
  range.absent = (int)extent[0] - 1;
  /* Test one number of each channel, because a damaged file may lose any of them. */
  range.is_intact = magic == INDEX_MAGIC && extent[0] > 0.0 && extent[1] > 0.0 && cells[2] > 0.0 &&
                    extent[2] == floor(extent[2]);
  if (!range.is_intact) {
    range.to2 = range.from2 - 1;
    range.listed = 0;
    range.absent = 0;
  }
  return range;
}

/* First element of the range's cells in one row of cells, and the element after them. */
void row_elements(output Map map, Index index, int record, CellRange range, int row, output int start, output int end)
{
  int bounds[2] = { row * INDEX_COLUMNS + range.from1, row * INDEX_COLUMNS + range.to1 + 1 };
  int texel = -1;
  color before = 0;
  float fourth = 0;
  for (int side = 0; side < 2; ++side) {
    int cell = bounds[side];
    bounds[side] = range.listed;
    if (cell < INDEX_COLUMNS * INDEX_ROWS) {
      if (cell / 4 != texel) {
        texel = cell / 4;
        before = index_texel(index, record + INDEX_FIRST_PREFIX + texel, fourth);
        map.costs.fetches += 1;
      }
      int lane = cell & 3;
      bounds[side] = (int)(lane == 0 ? before[0] : lane == 1 ? before[1] : lane == 2 ? before[2] : fourth);
    }
  }
  start = bounds[0];
  end = bounds[1];
}
