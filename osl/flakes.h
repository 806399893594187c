#pragma once
/* Flakes: which part of the surface they cover around the hit point, and what colour each has. The table's layout:
 * glint_addon/bake/flakes.py, which writes it.
 *
 * Between flakes the surface shows its base. The part of flakes is that of the block of texels around the hit point:
 * its mean over hit points is the map's presence, and the base does not flicker from sample to sample as single flakes
 * would make it. */

#include "map.h"
#include "view.h"

#define FLAKES_MAGIC 1949.0
#define FLAKES_BINS 64
#define FLAKES_REGION 128
#define FLAKES_MOST_REGIONS 8

/* Side of a block, in semi-axes of the footprint: a square so wide has the variance of the kernel:
 * decision 74. */
#define COVERAGE_SIDE 1.22
/* Most blocks in a row along the long axis of a footprint that stand for it; of a longer one wider blocks. */
#define COVERAGE_TAPS 4

/* Regions along `size` texels. Twin: regions() of glint_addon/bake/flakes.py. */
int flakes_regions(int size)
{
  return clamp(size / FLAKES_REGION, 1, FLAKES_MOST_REGIONS);
}

/* Blocks of 2^level texels along `size` texels. */
int level_blocks(int size, int level)
{
  return (size + (1 << level) - 1) >> level;
}

/* Texels of the list before a level; level `levels` + 1: before its last texel, or some before that. */
int texels_before_level(Map map, int level)
{
  int texels = 0;
  if (map.flakes.have_colors) {
    texels = flakes_regions(map.width) * flakes_regions(map.height) * FLAKES_BINS * FLAKES_BINS;
  }
  for (int finer = map.flakes.have_colors ? 0 : 1; finer < level; ++finer) {
    texels += level_blocks(map.width, finer) * level_blocks(map.height, finer);
  }
  return texels;
}

/* Find where the texels of the table lie. */
void lay_flakes(output Map map)
{
  map.flakes.levels = 1;
  while ((1 << map.flakes.levels) < max(map.width, map.height)) {
    map.flakes.levels += 1;
  }
  list_shape(texels_before_level(map, map.flakes.levels + 1) + 1, map.flakes.log_width, map.flakes.inverse_width,
             map.flakes.inverse_height);
}

/* A texel of the list, whose rows lie from the top down, as in the file. fourth: its alpha channel. */
color flakes_texel(output Map map, int texel, output float fourth)
{
  map.costs.fetches += 1;
  int column = texel & ((1 << map.flakes.log_width) - 1);
  return texture(map.flakes.table, (column + 0.5) * map.flakes.inverse_width,
                 1.0 - ((texel >> map.flakes.log_width) + 0.5) * map.flakes.inverse_height, 0, 0, 0, 0, "alpha",
                 fourth);
}

/* Whether the table's file exists and is whole (see table_is_intact): its header lies at the file's end. */
int flakes_are_intact(output Map map)
{
  map.costs.fetches += 1;
  color header = texture(map.flakes.table, 1.0 - 0.5 * map.flakes.inverse_width, 0.5 * map.flakes.inverse_height, 0, 0,
                         0, 0);
  return header[0] == FLAKES_MAGIC && header[1] == map.flakes.have_colors;
}

/* Colour of the flake at texel (i, j). */
color flake_color(output Map map, int i, int j)
{
  float part = 0;
  return flakes_texel(map, texels_before_level(map, 0) + j * map.width + i, part);
}

/* The level whose blocks show the footprint, and how many of them in a row along its long axis. */
int coverage_level(Footprint footprint, int levels, output int taps)
{
  float along = COVERAGE_SIDE * footprint.long_axis;
  float side = max(COVERAGE_SIDE * footprint.short_axis, along / COVERAGE_TAPS);
  int level = (int)clamp(floor(log2(max(side, 1.0)) + 0.5), 0.0, (float)levels);
  taps = (int)clamp(floor(along / (1 << level) + 0.5), 1.0, (float)COVERAGE_TAPS);
  return level;
}

/* The footprint's long semi-axis in texels. */
void long_axis(Footprint footprint, output float along_u, output float along_v)
{
  float suu = footprint.ux * footprint.ux + footprint.uy * footprint.uy;
  float suv = footprint.ux * footprint.vx + footprint.uy * footprint.vy;
  float svv = footprint.vx * footprint.vx + footprint.vy * footprint.vy;
  float angle = 0.5 * atan2(2.0 * suv, suu - svv);
  along_u = footprint.long_axis * cos(angle);
  along_v = footprint.long_axis * sin(angle);
}

/* The flakes around a hit point, as wide as the footprint. The places of the blocks do not depend on what lies there,
 * so the mean of the coverage over hit points is the map's presence. */
FlakesAround flakes_around(output Map map, Hit hit, Footprint footprint)
{
  FlakesAround around;
  int taps;
  int level = coverage_level(footprint, map.flakes.levels, taps);
  float along_u, along_v;
  long_axis(footprint, along_u, along_v);
  int before = level > 0 ? texels_before_level(map, level) : 0;
  int columns = level_blocks(map.width, level);
  around.coverage = 0.0;
  around.mean = 0.0;
  float weights = 0.0;
  for (int tap = 0; tap < taps; ++tap) {
    float place = COVERAGE_SIDE * ((tap + 0.5) / taps - 0.5);
    int i, j;
    map_texel(map, (int)floor(hit.u + place * along_u), (int)floor(hit.v + place * along_v), i, j);
    float part = 0;
    color mean = 1.0;
    if (level > 0) {
      mean = flakes_texel(map, before + (j >> level) * columns + (i >> level), part);
    }
    else if (taps == 1) {
      part = hit.is_flake;
    }
    else {
      part = is_flake(map, unscaled_normal(map, i, j));
    }
    /* Take the colour of blocks without flakes where there are no others. */
    float weight = max(part, 1e-6);
    around.coverage += part / taps;
    around.mean += weight * mean;
    weights += weight;
  }
  around.mean /= weights;
  return around;
}

/* Give a hit point the flakes around it, as wide as the sample's footprint. */
void add_flakes(View view, output Map map, output Hit hit)
{
  hit.flakes.coverage = 1.0;
  hit.flakes.mean = 1.0;
  if (map.flakes.are_there) {
    Footprint footprint;
    if (!round_footprint(view, footprint)) {
      /* Take the texel at the hit point alone. */
      footprint.ux = 0.0;
      footprint.uy = 0.0;
      footprint.vx = 0.0;
      footprint.vy = 0.0;
      footprint.long_axis = 0.0;
      footprint.short_axis = 0.0;
    }
    FlakesAround around = flakes_around(map, hit, footprint);
    hit.flakes.coverage = around.coverage;
    hit.flakes.mean = around.mean;
  }
}

/* Colour of the flakes of one slope around a hit point; slope1, slope2: 0..1 across the box of counted slopes. It is
 * right in the mean where the colour depends on the slope in the same way all over a region of the map. */
color merged_color(output Map map, Hit hit, float slope1, float slope2)
{
  int columns = flakes_regions(map.width);
  int region_u = hit.column * columns / map.width;
  int region_v = hit.row * flakes_regions(map.height) / map.height;
  int bin1 = (int)clamp(slope1 * FLAKES_BINS, 0.0, FLAKES_BINS - 1.0);
  int bin2 = (int)clamp(slope2 * FLAKES_BINS, 0.0, FLAKES_BINS - 1.0);
  int region = region_v * columns + region_u;
  float unused = 0;
  return hit.flakes.mean * flakes_texel(map, (region * FLAKES_BINS + bin2) * FLAKES_BINS + bin1, unused);
}

/* Colour of a selected element: place1, place2: its texel, or where it is merged of many, its slope (merged_color). */
color element_color(output Map map, Hit hit, int is_merged, float place1, float place2)
{
  color own;
  if (is_merged) {
    own = merged_color(map, hit, place1, place2);
  }
  else {
    own = flake_color(map, (int)place1, (int)place2);
  }
  return own;
}
