/* Maps that do not repeat: outside such a map, and where a footprint meets its edge, Blender's own nodes are the answer,
 * whatever the Image Texture node does there (Extend, Clip, Mirror). It is noisy, and a footprint wide. */

/* Texels around the footprint that its elements may reach: a bilinear patch reaches half a texel beyond its middle. */
#define EDGE_MARGIN 1.0

/* Whether the footprint at UV coordinates is not all within the map. */
int meets_edge(Map map, point uv, float samples, float du_dx, float du_dy, float dv_dx, float dv_dy)
{
  float u = uv[0] * map.width;
  float v = uv[1] * map.height;
  float reach_u = EDGE_MARGIN;
  float reach_v = EDGE_MARGIN;
  Footprint footprint;
  if (ray_footprint(Dx(P), Dy(P), I, Ng, footprint_radius(samples), du_dx, du_dy, dv_dx, dv_dy, footprint)) {
    reach_u += hypot(footprint.ux, footprint.uy);
    reach_v += hypot(footprint.vx, footprint.vy);
  }
  return u < reach_u || v < reach_v || u > map.width - reach_u || v > map.height - reach_v;
}
