#pragma once
/* Variation of a map that repeats: each tile of the plane shows another cut of the map, so that no repeat looks like
 * the next. Nothing is stored for it: the cut follows from the tile's number. Twins: glint_addon/nodes/tiles.py, which
 * makes the same cuts by Blender's nodes, and tests/reference/tiles.py. */

#include "table.h"

/* Kinds of variation, as Variation of glint.osl. */
#define VARIATION_SHUFFLE 1

/* A prime below 4096, so that products of two remainders are exact in the nodes' float32. The arrangement repeats after
 * so many tiles. */
#define TILES_PRIME 4093

/* A permutation of the numbers 0..TILES_PRIME - 1 that leaves no pattern: t^5, because 5 does not divide
 * TILES_PRIME - 1. */
int stirred(int t)
{
  int square = t * t % TILES_PRIME;
  return square * square % TILES_PRIME * t % TILES_PRIME;
}

/* Texels by which the cut of the map that tile (tile_u, tile_v) shows is moved, 0 up to width and height. */
void tile_cut(int tile_u, int tile_v, int width, int height, output int cut_u, output int cut_v)
{
  int u = wrapped(tile_u, TILES_PRIME);
  int v = wrapped(tile_v, TILES_PRIME);
  int column = stirred((u + 1013) % TILES_PRIME);
  int tile = stirred((column + v) % TILES_PRIME);
  /* The column is stirred in once more, or columns would be equal but for a move. */
  int first = stirred((tile + 3 * u + 499) % TILES_PRIME);
  int second = stirred((first + column + 1) % TILES_PRIME);
  cut_u = (int)floor(first * (width / (float)TILES_PRIME));
  cut_v = (int)floor(second * (height / (float)TILES_PRIME));
}

/* Number of the tile of `size` texels that texel i lies in, where texel 0 begins tile 0. */
int tile_of(int i, int size)
{
  return (int)floor(i / (float)size);
}
