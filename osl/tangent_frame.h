#pragma once
/* Tangent frame from how position and UV change: the twin of tests/reference/tangent_frame.py. Solves deltaPos1 = du1
 * T + dv1 B, deltaPos2 = du2 T + dv2 B. With Dx and Dy of P and UV the result is the frame of the triangle, because
 * both are linear over a triangle. */

/* See LEAST_SINE in the twin. */
#define LEAST_UV_SINE 1e-6

struct TangentFrame {
  vector tangent;   /* position per unit of u, not of unit length */
  vector bitangent; /* position per unit of v */
  vector upright;   /* the unit normal */
  float uv_sign;    /* -1 where the UVs are mirrored, else 1 */
  int degenerate;   /* the UVs have no area: tangent and bitangent are any unit pair beside the normal */
};

/* Two unit vectors that make a right-handed frame with the unit vector n, continuous except at -z. Source: Duff et al.,
 * "Building an Orthonormal Basis, Revisited", Journal of Computer Graphics Techniques 6(1), 2017. */
void basis_around(vector n, output vector first, output vector second)
{
  float s = n[2] < 0.0 ? -1.0 : 1.0;
  float a = -1.0 / (s + n[2]);
  float b = n[0] * n[1] * a;
  first = vector(1.0 + s * n[0] * n[0] * a, s * b, -s * n[0]);
  second = vector(b, s + n[1] * n[1] * a, -n[1]);
}

/* upright: the unit normal by the winding, that is -Ng where backfacing(). */
TangentFrame tangent_frame(vector delta_position1, vector delta_position2, float du1, float dv1, float du2, float dv2,
                           vector upright)
{
  TangentFrame frame;
  frame.upright = upright;
  float determinant = du1 * dv2 - du2 * dv1;
  if (abs(determinant) > LEAST_UV_SINE * hypot(du1, dv1) * hypot(du2, dv2)) {
    frame.degenerate = 0;
    frame.tangent = (dv2 * delta_position1 - dv1 * delta_position2) / determinant;
    frame.bitangent = (du1 * delta_position2 - du2 * delta_position1) / determinant;
    float winding = dot(cross(delta_position1, delta_position2), upright);
    frame.uv_sign = (determinant < 0.0) == (winding < 0.0) ? 1.0 : -1.0;
  }
  else {
    frame.degenerate = 1;
    frame.uv_sign = 1.0;
    basis_around(upright, frame.tangent, frame.bitangent);
  }
  return frame;
}

/* Unit normal of the tangent-space normal n. orthonormal: with a bitangent square to the tangent, as Blender's Normal
 * Map node on flat faces; else with the solved pair scaled to unit length. */
vector tangent_to_world(TangentFrame frame, vector n, int orthonormal)
{
  vector tangent = normalize(frame.tangent);
  vector bitangent = orthonormal ? frame.uv_sign * cross(frame.upright, tangent) : normalize(frame.bitangent);
  return normalize(n[0] * tangent + n[1] * bitangent + n[2] * frame.upright);
}
