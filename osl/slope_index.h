/* The index for the middle distance: the elements of small blocks of the map, sorted by slope, so that a sample visits
 * only those near a half vector, the candidates. The answer is exact, because candidates are fetched from the table of
 * normals and tested as in glint_query: decision 14. Layout: glint_addon/bake/slope_index.py, which writes the table.
 */

#define INDEX_MAGIC 7951.0
#define INDEX_SIDE 32
#define INDEX_COLUMNS 36
#define INDEX_ROWS 14
#define INDEX_RECORD 256
#define INDEX_FIRST_PREFIX 2
#define INDEX_FIRST_ELEMENT 128

/* Least area in texels of a footprint: in a smaller one most elements of a block lie outside, and visits of all are as
 * fast. */
#define INDEX_AREA 120.0
/* Least short semi-axis in texels: the kernel's integral replaces the sum over all elements, which differs from it at
 * random, without bias. */
#define INDEX_SHORT_AXIS 3.0
/* Largest number of blocks in the footprint's bounding box. */
#define INDEX_BLOCKS 160
/* Costs in nanoseconds that choose between the index and visits of all elements: of a block, of an element of its
 * lists, of a candidate that is a texel or a patch, and of a texel or a patch visited row by row: decision 15. A
 * candidate patch fetches all its corners, and a patch in a row only the new ones. */
#define INDEX_BLOCK_COST 300.0
#define INDEX_LISTED_COST 11.0
#define INDEX_TEXEL_COST 90.0
#define INDEX_PATCH_COST 220.0
#define TEXEL_COST 48.0
#define PATCH_COST 85.0
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

/* A query over the index: what is the same for all blocks, and the block in turn. */
struct Search {
  float u; /* the hit's texel coordinates */
  float v;
  Ellipse ellipse; /* of the kernel */
  int column; /* first texel of the block in the map */
  int row;
  int plane_column; /* first texel of the block in the plane in which the map repeats */
  int plane_row;
  int columns; /* texels of the block along u */
  int first; /* texel of the list with the block's first eight elements */
};

/* Visit the elements `start` to `end` of a block for the k-th hint: of the block's list, or of its texels row by
 * row. */
void visit_listed(output Map map, Index index, Search search, HalfVector hint, HalfVector hints[HINT_COUNT], int k,
                  float alpha, int is_listed, int start, int end, output Selection s, output int visited)
{
  PatchPart whole = { 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 };
  for (int group = start / 8; 8 * group < end; ++group) {
    float fourth = 0;
    color pairs = 0;
    if (is_listed) {
      pairs = index_texel(index, search.first + group, fourth);
      map.fetches += 1;
    }
    int lane_end = min(end - 8 * group, 8);
    for (int lane = max(start - 8 * group, 0); lane < lane_end; ++lane) {
      int code = (int)(lane < 2 ? pairs[0] : lane < 4 ? pairs[1] : lane < 6 ? pairs[2] : fourth);
      code = !is_listed ? 8 * group + lane : lane & 1 ? code >> 10 : code & 1023;
      int x = code & (INDEX_SIDE - 1);
      int y = code >> 5;
      float du = search.plane_column + x + 0.5 - search.u;
      float dv = search.plane_row + y + 0.5 - search.v;
      float weight = footprint_kernel(ellipse_square(search.ellipse, du, dv));
      if (weight > 0.0 && x < search.columns) {
        visited += 1;
        if (map.is_linear) {
          visit_patch(map, hints, k, k + 1, alpha, MODE_INDEX, search.column + x, search.row + y, du - 0.5, dv - 0.5,
                      whole, weight, s);
        }
        else {
          visit_texel(map, hint, hints, k, k + 1, search.column + x, search.row + y, du, dv, weight, s);
        }
      }
    }
  }
}

/* The cells of a block that can contain slopes of a hint's region. */
struct CellRange {
  int from1;
  int to1;
  int from2;
  int to2;
  int listed; /* elements in all cells of the block; the others, the tail, are always visited */
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
  map.fetches += 2;
  vector middle = basis.g3 + c1 * basis.g1 + c2 * basis.g2;
  float low1, low2, high1, high2;
  region_bounds(middle, basis.g1, basis.g2, radius, 0, low1, high1);
  region_bounds(middle, basis.g1, basis.g2, radius, 1, low2, high2);
  if (map.strength != 1.0) {
    unscaled_bounds(map.strength, extent[1], low1, high1);
    unscaled_bounds(map.strength, extent[1], low2, high2);
  }
  CellRange range;
  float margin = extent[0];
  range.from1 = (int)clamp((low1 - margin - cells[0]) * cells[2] - INDEX_ROUNDING, 0.0, INDEX_COLUMNS - 1.0);
  range.to1 = (int)clamp((high1 + margin - cells[0]) * cells[2] + INDEX_ROUNDING, 0.0, INDEX_COLUMNS - 1.0);
  range.from2 = (int)clamp((low2 - margin - cells[1]) * scale2 - INDEX_ROUNDING, 0.0, INDEX_ROWS - 1.0);
  range.to2 = (int)clamp((high2 + margin - cells[1]) * scale2 + INDEX_ROUNDING, 0.0, INDEX_ROWS - 1.0);
  range.listed = (int)extent[2];
  /* Test one number of each channel, because a damaged file may lose any of them. */
  range.is_intact = magic == INDEX_MAGIC && extent[0] > 0.0 && extent[1] > 0.0 && cells[2] > 0.0 &&
                    extent[2] == floor(extent[2]);
  if (!range.is_intact) {
    range.to2 = range.from2 - 1;
    range.listed = 0;
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
        map.fetches += 1;
      }
      int lane = cell & 3;
      bounds[side] = (int)(lane == 0 ? before[0] : lane == 1 ? before[1] : lane == 2 ? before[2] : fourth);
    }
  }
  start = bounds[0];
  end = bounds[1];
}

/* Whether the index can answer for the footprint, and is faster than visits of all elements. */
int index_serves(output Map map, Footprint footprint, HalfVector hints[HINT_COUNT], int hint_count, float u, float v)
{
  float blocks = (2.0 * hypot(footprint.ux, footprint.uy) / INDEX_SIDE + 1.0) *
                 (2.0 * hypot(footprint.vx, footprint.vy) / INDEX_SIDE + 1.0);
  if (!map.is_indexed || footprint.area < INDEX_AREA || footprint.short_axis < INDEX_SHORT_AXIS ||
      blocks > INDEX_BLOCKS) {
    return 0;
  }
  Index index = map_index(map.index, map.width, map.height);
  int column, row;
  int first_u = block_start((int)floor(u), map.width, column);
  int first_v = block_start((int)floor(v), map.height, row);
  int record = INDEX_RECORD * (row * index.columns + column);
  /* Count the candidates of the block around the hit. */
  int side_u = min(map.width - INDEX_SIDE * column, INDEX_SIDE);
  int side_v = min(map.height - INDEX_SIDE * row, INDEX_SIDE);
  int candidates = 0;
  for (int k = 0; k < hint_count; ++k) {
    HalfVector hint = hints[k];
    SlopeBasis basis = slope_basis(hint);
    if (!region_is_upright(basis, 0, 0, hint.radius + hint.reach + INDEX_SIDE * hint.patch_turn)) {
      return 0;
    }
    CellRange range = block_cells(map, index, record, basis, 0, 0, hint.radius + hint.patch_turn);
    if (!range.is_intact) {
      return 0;
    }
    for (int cells = range.from2; cells <= range.to2; ++cells) {
      int start, end;
      row_elements(map, index, record, range, cells, start, end);
      candidates += end - start;
    }
    candidates += side_u * side_v - range.listed;
  }
  float share = candidates / (float)(side_u * side_v);
  float found_cost = map.is_linear ? INDEX_PATCH_COST : INDEX_TEXEL_COST;
  float index_cost = blocks * (INDEX_BLOCK_COST * hint_count + share * INDEX_SIDE * INDEX_SIDE * INDEX_LISTED_COST) +
                     footprint.area * share * found_cost;
  float visit_cost = footprint.area > map.visits ? map.visits * found_cost :
                                                      footprint.area * (map.is_linear ? PATCH_COST : TEXEL_COST);
  return index_cost < visit_cost;
}

/* As glint_query, but visits only the candidates of the index. */
float index_query(output Map map, HalfVector hints[HINT_COUNT], int hint_count, float alpha, Footprint footprint,
                  float u, float v, output Selection s, output int visited)
{
  Index index = map_index(map.index, map.width, map.height);
  Search search;
  search.u = u;
  search.v = v;
  Ellipse ellipse = footprint_ellipse(footprint, 0.0, 0.0);
  search.ellipse = ellipse;
  float reach_u = ellipse.reach_u;
  float reach_v = ellipse.reach_v;
  for (int k = 0; k < hint_count; ++k) {
    HalfVector hint = hints[k];
    SlopeBasis basis = slope_basis(hint);
    int place_v;
    for (int j = block_start((int)floor(v - reach_v), map.height, place_v); j <= v + reach_v;) {
      int side_v = min(map.height - INDEX_SIDE * place_v, INDEX_SIDE);
      float dv = j + 0.5 * side_v - v;
      int place_u;
      for (int i = block_start((int)floor(u - reach_u), map.width, place_u); i <= u + reach_u;) {
        int side_u = min(map.width - INDEX_SIDE * place_u, INDEX_SIDE);
        float du = i + 0.5 * side_u - u;
        /* Skip a block whose bounding circle in the kernel's plane does not meet the kernel's disk. */
        float half = 0.5 * (side_u * sqrt(ellipse.quu) + side_v * sqrt(ellipse.qvv));
        if (ellipse_square(ellipse, du, dv) < (1.0 + half) * (1.0 + half)) {
          search.column = INDEX_SIDE * place_u;
          search.row = INDEX_SIDE * place_v;
          search.plane_column = i;
          search.plane_row = j;
          search.columns = side_u;
          int record = INDEX_RECORD * (place_v * index.columns + place_u);
          search.first = record + INDEX_FIRST_ELEMENT;
          float radius = hint.radius + 0.5 * (side_u * hypot(hint.turn_u1, hint.turn_u2) +
                                              side_v * hypot(hint.turn_v1, hint.turn_v2));
          CellRange range = block_cells(map, index, record, basis, -du * hint.turn_u1 - dv * hint.turn_v1,
                                        -du * hint.turn_u2 - dv * hint.turn_v2, radius);
          /* Visit the rows of cells, then the tail. The loop calls visit_listed at one place only, because OSL compiles
           * each call of a function anew. */
          for (int cells = range.from2; cells <= range.to2 + 1; ++cells) {
            int start = range.listed;
            int end = (range.is_intact ? side_u : INDEX_SIDE) * side_v;
            if (cells <= range.to2) {
              row_elements(map, index, record, range, cells, start, end);
            }
            visit_listed(map, index, search, hint, hints, k, alpha, range.is_intact, start, end, s, visited);
          }
        }
        i += side_u;
        place_u = place_u + 1 < index.columns ? place_u + 1 : 0;
      }
      j += side_v;
      place_v = place_v + 1 < index.rows ? place_v + 1 : 0;
    }
  }
  /* Return the kernel's integral, which is the expectation of its sum over the elements. */
  return footprint.area / 3.0;
}
