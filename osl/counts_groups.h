#pragma once
/* Which groups of blocks a sample reads for its footprint, and with what weights. */

#include "counts_table.h"
#include "query.h"

/* Most groups under a footprint, twice FAR_GROUPS. Where more lie there, FAR_GROUPS groups at random points stand for
 * all. */
#define MOST_GROUPS 32
/* Groups that a sample reads of those under its footprint: most others lie on the kernel's rim and weigh little:
 * decision 22. */
#define DRAWN_GROUPS 4
/* Groups that all hints of a sample read together, about: with several lights, which of them Cycles samples makes more
 * noise: decision 68. */
#define SHARED_GROUPS 6

/* The groups under a footprint, and what their blocks weigh. */
struct Blocks {
  float side_u; /* of a block */
  float side_v;
  Ellipse ellipse; /* of the kernel */
  int first_column;
  int first_row;
  int columns;
  int groups;    /* groups under the footprint */
  int is_random; /* groups at random points of the footprint stand for all, because more than MOST_GROUPS lie there */
  int is_thin;   /* of a random group only the block at its point counts: the footprint is thinner than a group */
};

/* A group that a sample reads, and the weights of its blocks: three in `weight`, that of the fourth in `fourth`. */
struct Group {
  int column; /* in the plane in which the map repeats as in the group's tile, */
  int row;
  int shift_u; /* and texels from there to the plane of the hit point */
  int shift_v;
  color weight;
  float fourth;
};

struct Groups {
  int count;
  Group group[MOST_GROUPS];
  float total; /* sum of the weights of all groups, drawn or not */
};

/* Whether a part of the plane so far around the hit lies in another tile that shows another cut of the map. */
int leaves_tile(Map map, Query query, float reach_u, float reach_v)
{
  float u = query.u - map.cut_u;
  float v = query.v - map.cut_v;
  return map.variation && (u < reach_u || v < reach_v || u + reach_u > map.width || v + reach_v > map.height);
}

/* A block's weight is the kernel's mean over the block, which is the value of a kernel widened by the block's variance
 * in the block's middle: decision 19. */
Blocks blocks_under(Map map, Level level, Query query)
{
  Blocks blocks;
  blocks.side_u = 0.5 * level.group_u;
  blocks.side_v = 0.5 * level.group_v;
  float spread = 1.0 / (12.0 * KERNEL_VARIANCE);
  Ellipse ellipse = footprint_ellipse(query.footprint, spread * blocks.side_u * blocks.side_u,
                                      spread * blocks.side_v * blocks.side_v);
  blocks.ellipse = ellipse;
  float reach_u = ellipse.reach_u - 0.5 * blocks.side_u;
  float reach_v = ellipse.reach_v - 0.5 * blocks.side_v;
  blocks.first_column = (int)floor((query.u - reach_u) / level.group_u);
  blocks.first_row = (int)floor((query.v - reach_v) / level.group_v);
  blocks.columns = (int)floor((query.u + reach_u) / level.group_u) - blocks.first_column + 1;
  int rows = (int)floor((query.v + reach_v) / level.group_v) - blocks.first_row + 1;
  /* Multiply as floats, because an int overflows for very far footprints. */
  int are_many = (float)blocks.columns * rows > MOST_GROUPS;
  blocks.is_random = are_many || leaves_tile(map, query, reach_u, reach_v);
  blocks.is_thin = max(blocks.side_u, blocks.side_v) > query.footprint.short_axis;
  blocks.groups = blocks.columns * rows;
  if (blocks.is_random) {
    /* Over several tiles as many as are read within one: decision 75. */
    blocks.groups = level.columns * level.rows == 1 ? 1 : are_many ? FAR_GROUPS : DRAWN_GROUPS;
  }
  return blocks;
}

/* The group at a random point of the footprint, the g-th. */
Group random_group(Blocks blocks, Map map, Level level, Query query, int g)
{
  float x, y;
  float a = query.random[0] + g * PLASTIC_1;
  float b = query.random[1] + g * PLASTIC_2;
  footprint_sample(a - floor(a), b - floor(b), x, y);
  float point_u = query.u + query.footprint.ux * x + query.footprint.uy * y;
  float point_v = query.v + query.footprint.vx * x + query.footprint.vy * y;
  Group group;
  tile_shift(map, (int)floor(point_u), (int)floor(point_v), group.shift_u, group.shift_v);
  float place_u = (point_u - group.shift_u) / level.group_u;
  float place_v = (point_v - group.shift_v) / level.group_v;
  group.column = (int)floor(place_u);
  group.row = (int)floor(place_v);
  int block = (place_u - group.column < 0.5 ? 0 : 1) + (place_v - group.row < 0.5 ? 0 : 2);
  group.weight = blocks.is_thin ? color(block == 0, block == 1, block == 2) : color(1.0);
  group.fourth = !blocks.is_thin || block == 3;
  return group;
}

/* The g-th group under the footprint. */
Group group_under(Blocks blocks, Level level, Query query, int g)
{
  Group group;
  group.shift_u = 0;
  group.shift_v = 0;
  group.column = blocks.first_column + g % blocks.columns;
  group.row = blocks.first_row + g / blocks.columns;
  float left = (group.column + 0.25) * level.group_u - query.u;
  float low = (group.row + 0.25) * level.group_v - query.v;
  float right = left + blocks.side_u;
  float high = low + blocks.side_v;
  Ellipse ellipse = blocks.ellipse;
  group.weight = color(footprint_kernel(ellipse_square(ellipse, left, low)),
                       footprint_kernel(ellipse_square(ellipse, right, low)),
                       footprint_kernel(ellipse_square(ellipse, left, high)));
  group.fourth = footprint_kernel(ellipse_square(ellipse, right, high));
  return group;
}

/* The weight above which a group is always read, chosen so that `read` of `count` groups are read; 0: all are. */
float sure_weight(float weights[MOST_GROUPS], int count, int read, float total)
{
  float sure = count > read ? total / read : 0.0;
  int before = 0;
  for (int larger = sure > 0.0; larger > 0;) {
    /* Groups of a larger weight are read in any case, and the others share the rest of the weight. */
    int large = 0;
    float rest = total;
    for (int g = 0; g < count; ++g) {
      large += weights[g] > sure;
      rest -= weights[g] > sure ? weights[g] : 0.0;
    }
    sure = rest / (read - large);
    larger = large - before;
    before = large;
  }
  return sure;
}

/* Draw the groups to read from those under a footprint. The weights of the drawn groups add up to the weight of all, so
 * an even map looks the same whichever groups are drawn. */
Groups drawn_groups(Blocks blocks, Map map, Level level, Query query)
{
  Groups groups;
  groups.count = 0;
  groups.total = 0;
  float weights[MOST_GROUPS];
  for (int g = 0; g < blocks.groups; ++g) {
    Group group;
    if (blocks.is_random) {
      group = random_group(blocks, map, level, query, g);
    }
    else {
      group = group_under(blocks, level, query, g);
    }
    float sum = group.weight[0] + group.weight[1] + group.weight[2] + group.fourth;
    if (sum > 0.0) {
      weights[groups.count] = sum;
      groups.group[groups.count] = group;
      groups.count += 1;
      groups.total += sum;
    }
  }
  int read = min(DRAWN_GROUPS, (SHARED_GROUPS + query.hint_count - 1) / query.hint_count);
  float sure = blocks.is_random ? 0.0 : sure_weight(weights, groups.count, read, groups.total);
  float odds = query.random[2];
  int drawn = 0;
  for (int g = 0; g < groups.count; ++g) {
    float weight = weights[g];
    if (is_drawn(sure, odds, weight)) {
      Group group = groups.group[g];
      group.weight *= weight / weights[g];
      group.fourth *= weight / weights[g];
      groups.group[drawn] = group;
      drawn += 1;
    }
  }
  groups.count = drawn;
  return groups;
}
