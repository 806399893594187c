#pragma once
/* Maps that do not repeat (Extend, Clip, Mirror): outside such a map, and where a footprint meets the map's edge, the
 * answer is that of Blender's own nodes, with their noise. */

#include "footprint.h"
#include "map.h"

/* Texels by which elements of a footprint may reach beyond it: a bilinear patch reaches half a texel beyond its
 * middle. */
#define EDGE_MARGIN 1.0

/* Whether a part of the footprint at UV coordinates lies outside the map. */
int meets_edge(Map map, point uv, float samples, Matrix2 texels)
{
  float u = uv[0] * map.width;
  float v = uv[1] * map.height;
  float reach_u = EDGE_MARGIN;
  float reach_v = EDGE_MARGIN;
  Footprint footprint;
  if (surface_footprint(cone_on_surface(Dx(P), Dy(P), I, Ng, footprint_radius(samples)), texels, footprint)) {
    reach_u += hypot(footprint.ux, footprint.uy);
    reach_v += hypot(footprint.vx, footprint.vy);
  }
  return u < reach_u || v < reach_v || u > map.width - reach_u || v > map.height - reach_v;
}
