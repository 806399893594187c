#pragma once
/* Footprints that know the pixel grid. A pixel's samples are distributed as the pixel filter, and the mean of equal
 * kernels around a few of them misses that filter. The shader sees where a camera sample lies in the grid of pixels,
 * not which pixel it belongs to. So the footprint's radius and its total depend on that place: samples in the middle
 * of a cell of the grid count for more and reach farther than those near its border: decision 64.
 *
 * With f the place along either pixel axis, -0.5 to 0.5: radius r0 (1 + r2 f^2) along the axis, total the product over
 * both axes of (1 + t2 f^2 + t4 f^4) over its mean. The first sample of every pixel lies at f = 0 and is recognised by
 * that: its radius is r1, its total 1. The numbers are fitted to Blender's own pixel filter, Blackman-Harris of 1.5
 * pixels. */

#include "footprint.h"

/* Samples a pixel from which on the grid is used, as a power of two; the tables go on in powers of two. */
#define GRID_FIRST 2.0
#define GRID_COUNTS 9
/* Middle of a pixel in raster space, and how near to it lies the first sample of a pixel and no other. */
#define GRID_MIDDLE 0.501
#define GRID_FIRST_SAMPLE 2e-3
/* Means of f^2 and f^4 over samples of the filter. */
#define GRID_MEAN_2 0.081692
#define GRID_MEAN_4 0.012179
/* The round kernel is as wide as the product of two, for which the numbers hold. */
#define GRID_ROUND 1.05
/* Largest distance in pixels between the raster positions of a ray's points: those of a ray through an open lens lie
 * apart. */
#define GRID_STRAY 0.01

/* Largest turn (slope) within the widest footprint: totals do not make up for the light that is lost where a turn is
 * not linear (see LARGEST_FOOTPRINT_TURN). */
#define GRID_TURN 0.25

struct PixelGrid {
  int is_known;
  float radius_x; /* pixels, of the footprint along either pixel axis */
  float radius_y;
  float widest;   /* the largest of all samples */
  float total;
};

/* Value at place x of a table. */
float grid_number(float numbers[GRID_COUNTS], float x)
{
  int k = min((int)x, GRID_COUNTS - 2);
  return mix(numbers[k], numbers[k + 1], x - k);
}

/* Distance -0.5..0.5 of a raster coordinate from the nearest pixel's middle. */
float grid_place(float x)
{
  return x - GRID_MIDDLE - floor(x - GRID_MIDDLE + 0.5);
}

/* The grid for a sample at raster position (x, y). */
PixelGrid pixel_grid(float x, float y, float samples)
{
  float r0s[GRID_COUNTS] = { 1.009, 0.816, 0.675, 0.569, 0.522, 0.452, 0.396, 0.334, 0.286 };
  float r2s[GRID_COUNTS] = { 1.137, 1.074, 0.101, -0.382, -0.751, -0.884, -0.875, -0.883, -0.824 };
  float t2s[GRID_COUNTS] = { -0.107, -0.852, -0.949, -2.248, -2.235, -1.948, -1.248, -0.332, -0.309 };
  float t4s[GRID_COUNTS] = { 0.445, 2.054, 1.156, 5.183, 3.266, 2.912, 0.718, -2.403, -1.445 };
  float r1s[GRID_COUNTS] = { 0.698, 0.644, 0.550, 0.489, 0.478, 0.456, 0.522, 0.508, 0.487 };
  float k = log2(max(samples, 1.0)) - GRID_FIRST;
  PixelGrid grid;
  grid.is_known = k >= 0.0;
  float beyond = exp2(-FOOTPRINT_EXPONENT * max(k - (GRID_COUNTS - 1), 0.0));
  k = clamp(k, 0.0, GRID_COUNTS - 1.0);
  float r0 = GRID_ROUND * beyond * grid_number(r0s, k);
  float r1 = GRID_ROUND * beyond * grid_number(r1s, k);
  float r2 = grid_number(r2s, k);
  float t2 = grid_number(t2s, k);
  float t4 = grid_number(t4s, k);
  float fx = grid_place(x);
  float fy = grid_place(y);
  float fx2 = fx * fx;
  float fy2 = fy * fy;
  int is_first = max(abs(fx), abs(fy)) < GRID_FIRST_SAMPLE;
  grid.radius_x = is_first ? r1 : r0 * (1.0 + r2 * fx2);
  grid.radius_y = is_first ? r1 : r0 * (1.0 + r2 * fy2);
  grid.widest = max(r0 * max(1.0, 1.0 + 0.25 * r2), r1);
  float mean = 1.0 + t2 * GRID_MEAN_2 + t4 * GRID_MEAN_4;
  grid.total = is_first ? 1.0 : (1.0 + fx2 * (t2 + t4 * fx2)) * (1.0 + fy2 * (t2 + t4 * fy2)) / (mean * mean);
  return grid;
}

/* The grid at the shading point; unknown where the sample does not come straight from the camera, whose rays all lie on
 * one raster position each. */
PixelGrid grid_here(float samples)
{
  point at = transform("raster", P);
  point nearer = transform("raster", P + 0.5 * distance(P, transform("camera", "common", point(0))) * I);
  PixelGrid grid = pixel_grid(at[0], at[1], samples);
  grid.is_known = grid.is_known && raytype("camera") && hypot(at[0] - nearer[0], at[1] - nearer[1]) < GRID_STRAY;
  return grid;
}

/* Kernel coordinates -> surface (see cone_on_surface), for radii along the pixel axes. Returns 0 where the surface is
 * seen edge on. */
int grid_on_surface(float radius_x, float radius_y, output Matrix2 surface)
{
  point at = transform("raster", P);
  float xx = Dx(at[0]);
  float xy = Dy(at[0]);
  float yx = Dx(at[1]);
  float yy = Dy(at[1]);
  float determinant = xx * yy - xy * yx;
  surface.xx = radius_x * yy / determinant;
  surface.xy = -radius_y * xy / determinant;
  surface.yx = -radius_x * yx / determinant;
  surface.yy = radius_y * xx / determinant;
  return abs(determinant) > LEAST_COSINE * LEAST_COSINE;
}
