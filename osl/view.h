#pragma once
/* How the shading point is seen, and the footprint of a sample there. */

#include "footprint.h"

/* How the shading point is seen. */
struct View {
  float samples; /* a pixel */
  int on_grid;   /* whether the pixel filter is that of pixel_grid.h, and the camera rests */
  float diffuse_distance; /* metres to the diffuse bounce before this point; 0: there was none */
  Matrix2 texels; /* texel coordinates by Dx(P), Dy(P) */
};

/* The round footprint of a sample. Returns 0 where the UVs have no derivatives. */
int round_footprint(View view, output Footprint footprint)
{
  float radius = footprint_radius(view.samples);
  vector towards = view.diffuse_distance > 0.0 ? vector(Ng) : I;
  if (!surface_footprint(cone_on_surface(Dx(P), Dy(P), towards, Ng, radius), view.texels, footprint)) {
    return 0;
  }
  if (view.diffuse_distance > 0.0) {
    scale_footprint(caustic_scale(footprint, radius * length(Dx(P)), view.diffuse_distance), footprint);
  }
  return 1;
}
