#pragma once
/* The table of counts: the normal distribution (NDF) of square blocks of the map, counted over bins of slope. Layout:
 * glint_addon/bake/counts.py, which writes the table.
 *
 * A group is 2 x 2 blocks, whose counts share one texel. A texel holds how many elements lie below a corner of the bins
 * (a summed-area table: Crow 1984), so four fetches give the number of elements in any rectangle of bins, for four
 * blocks. */

#include "footprint.h"
#include "map.h"

#define COUNTS_MAGIC 7927.0
/* Up to this side in texels of a block two groups share texels: a stored number is a + PACKED_STEP b. */
#define PACKED 64
#define PACKED_STEP 4096.0

/* Largest side of a block, in short semi-axes of the footprint: a wider block shows more of the map than the footprint
 * covers: decision 18. Blocks of the first level may be as wide as FAR_SIDE_FIRST, because no smaller blocks exist. */
#define FAR_SIDE 0.7
#define FAR_SIDE_FIRST 1.0
/* The same limit where the other answer is a random subset of elements, which is noisier and slower: decision 20. */
#define FAR_SIDE_SUBSET 2.5
/* If more groups than this lie under a footprint, larger blocks are read, up to FAR_SIDE_LONG short semi-axes wide:
 * decision 21. */
#define FAR_GROUPS 16
#define FAR_SIDE_LONG 2.0

/* The level of the counts that a sample reads. */
struct Level {
  int block;    /* side in texels of a block; 0: none */
  int corners;  /* along a side of the summed-area table: one more than bins */
  int columns;  /* groups along u and v */
  int rows;
  int first;    /* texel of its first corner */
  float group_u; /* texels, side of a group */
  float group_v;
  float unit;    /* elements for each step of a packed count; 0: counts are not packed */
  int log_width; /* of the texture, whose sides are powers of two */
  float inverse_width;
  float inverse_height;
};

/* Corners along one side of a level's table. Twin: corners() of glint_addon/bake/counts.py. */
int level_corners(int block, int is_linear)
{
  if (is_linear) {
    return block <= 16 ? 28 : block <= 32 ? 46 : block <= 64 ? 64 : block <= 128 ? 90 : block <= 256 ? 128 :
           block <= 512 ? 160 : 192;
  }
  return block <= 32 ? 56 : block <= 64 ? 88 : block <= 128 ? 120 : block <= 256 ? 168 : block <= 512 ? 192 : 208;
}

/* Groups of blocks of side `block` along `size` texels. */
int level_groups(int size, int block)
{
  return max((size + block) / (2 * block), 1);
}

/* Texels of all levels before the level with blocks of side `block`. */
int texels_before(Counts counts, int block, int width, int height, int is_linear)
{
  int texels = 0;
  for (int side = counts.first; side < block; side *= 2) {
    int corners = level_corners(side, is_linear);
    int groups = level_groups(width, side) * level_groups(height, side);
    texels += (side <= PACKED ? (groups + 1) / 2 : groups) * corners * corners;
  }
  return texels;
}

/* The level with blocks of side `block`. */
Level counts_level(Counts counts, int block, int width, int height, int is_linear)
{
  Level level;
  level.block = block;
  level.first = texels_before(counts, block, width, height, is_linear);
  level.corners = level_corners(block, is_linear);
  level.columns = level_groups(width, block);
  level.rows = level_groups(height, block);
  level.group_u = width / (float)level.columns;
  level.group_v = height / (float)level.rows;
  level.unit = 0.0;
  if (block <= PACKED) {
    int columns = 2 * level.columns;
    int rows = 2 * level.rows;
    level.unit = (width + columns - 1) / columns * ((height + rows - 1) / rows) / (PACKED_STEP - 1.0);
  }
  int texels = texels_before(counts, counts.first << counts.levels, width, height, is_linear) + 1; /* and the header */
  list_shape(texels, level.log_width, level.inverse_width, level.inverse_height);
  return level;
}

/* A texel of the list, whose rows lie from the top down, as in the file. fourth: its alpha channel. */
color counts_texel(Counts counts, Level level, int texel, output float fourth)
{
  return texture(counts.table, ((texel & ((1 << level.log_width) - 1)) + 0.5) * level.inverse_width,
                 1.0 - ((texel >> level.log_width) + 0.5) * level.inverse_height, 0, 0, 0, 0, "alpha", fourth);
}

/* Whether the table's file exists, has the levels that `counts` names, and is whole (see table_is_intact): the header
 * lies at the file's end. */
int counts_are_intact(Counts counts, Level level)
{
  color header = texture(counts.table, 1.0 - 0.5 * level.inverse_width, 0.5 * level.inverse_height, 0, 0, 0, 0);
  return header[0] == COUNTS_MAGIC && header[1] == counts.first && header[2] == counts.levels;
}

/* Side of the blocks to read for a footprint; 0: even the smallest block is wider than `widest` short semi-axes. */
int far_block(Counts counts, Footprint footprint, float widest)
{
  int block = counts.first;
  int largest = counts.first << (counts.levels - 1);
  float u_side = 2.0 * hypot(footprint.ux, footprint.uy);
  float v_side = 2.0 * hypot(footprint.vx, footprint.vy);
  if (block == 0 || block > widest * footprint.short_axis) {
    return 0;
  }
  while (block < largest && (2 * block <= FAR_SIDE * footprint.short_axis ||
                             (2 * block <= FAR_SIDE_LONG * footprint.short_axis &&
                              (u_side / (2 * block) + 1.0) * (v_side / (2 * block) + 1.0) > FAR_GROUPS))) {
    block *= 2;
  }
  return block;
}
