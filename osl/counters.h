#pragma once
/* What a sample cost, for tests: the shader's outputs Counters and Costs. OSL leaves it all out unless they are
 * linked. */

/* How a sample was answered. */
#define MODE_PLAIN 0
#define MODE_SINGLE 1
#define MODE_POINTS 2
#define MODE_ALL 3
#define MODE_SUBSET 4
#define MODE_COUNTS 5
#define MODE_INDEX 6

/* Why a sample was answered without a query of the map. */
#define LEFT_NOT 0          /* the map was queried */
#define LEFT_NO_HINT 1      /* no hinted light, no table, or too few closures: known before the render */
#define LEFT_NO_TABLE 2     /* the table is missing, damaged or shrunk */
#define LEFT_NO_TANGENT 3   /* the mesh has no tangents of the UV map */
#define LEFT_SECONDARY 4    /* shadow ray, or after a diffuse bounce without Caustics */
#define LEFT_FLAT 5         /* Strength 0 */
#define LEFT_NO_FOOTPRINT 6 /* the UVs have no derivatives */
#define LEFT_WITHIN_TEXEL 7 /* the footprint lies within a texel (Closest) or patch (Linear) */
#define LEFT_NOT_REACHED 8  /* no normal of the map mirrors a hinted light here */
#define LEFT_EDGE 9         /* the footprint meets the edge of a map that does not repeat, or lies outside */

struct SampleCosts {
  int fetches;  /* texture() calls */
  int visited;  /* elements, or groups of blocks */
  int closures;
  int mode;     /* one of MODE_... */
  int left;     /* one of LEFT_... */
  int hints;    /* that some element of the map can reach */
};

SampleCosts no_costs()
{
  SampleCosts costs = { 0, 0, 1, MODE_PLAIN, LEFT_NOT, 0 };
  return costs;
}
