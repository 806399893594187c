#pragma once
/* The footprint of one sample: the ellipse of texels around the hit point whose glints the sample shows. */

/* Footprint radius in pixels = scale / samples^exponent. A wide footprint blurs the pixel filter (error ~ radius^2),
 * and narrow footprints leave holes between the samples: decision 1. */
#define FOOTPRINT_SCALE 1.1
#define FOOTPRINT_EXPONENT 0.21
/* Least sine of the angle between the axes of the UVs: rounding of float32 leaves nothing of a flatter one. */
#define LEAST_AXES_SINE 1e-6
/* Least cosine of view and normal: a pixel then shows a stretch of surface ten thousand times as long as the pixel is
 * wide. */
#define LEAST_COSINE 1e-4
/* Texels of a footprint after a diffuse bounce: decision 2. There the light of a whole wall meets in one point.
 * Footprints of all sizes on the wall have the same expectation, because each element is tested with its own view of
 * that point. So a footprint may be wider than the ray's cone, which Cycles makes no wider than the camera's pixel. */
#define CAUSTIC_AREA 64.0
/* Largest angular radius [rad] of such a footprint as seen from that point: the view turns linearly over a footprint
 * only to first order, and the light that is lost grows with the square of the radius: decision 3. */
#define CAUSTIC_ANGLE 0.05

struct Footprint {
  /* Texel offset of kernel coordinates (x, y) in the unit disk: (ux x + uy y, vx x + vy y). */
  float ux;
  float uy;
  float vx;
  float vy;
  /* Texel offset -> surface offset in units of Dx(P) and Dy(P). */
  float xu;
  float xv;
  float yu;
  float yv;
  float area;        /* texels */
  float long_axis;   /* texels, semi-axes */
  float short_axis;
};

/* Radius in pixels of the footprint of one of `samples` samples a pixel. */
float footprint_radius(float samples)
{
  return FOOTPRINT_SCALE * pow(max(samples, 1.0), -FOOTPRINT_EXPONENT);
}

/* A linear map of the plane: (x, y) -> (xx x + xy y, yx x + yy y). */
struct Matrix2 {
  float xx;
  float xy;
  float yx;
  float yy;
};

/* Kernel coordinates -> surface, in units of Dx(P), Dy(P), for a ray cone of `radius` pixels. Cycles gives Dx(P), Dy(P)
 * as an orthonormal pair times the cone's radius, without the stretch of a surface seen at an angle; with
 * q = (I - (I.Ng) Ng) / (I.Ng) in that basis the pixel covers r^2 (1 + q q^T), of which this is the square root. */
Matrix2 cone_on_surface(vector dpdx, vector dpdy, vector view, vector geometric_normal, float radius)
{
  float cone = max(length(dpdx), 1e-30);
  float cosine = max(abs(dot(view, geometric_normal)), LEAST_COSINE);
  float qx = dot(view, dpdx) / (cone * cosine);
  float qy = dot(view, dpdy) / (cone * cosine);
  float k = radius / (1.0 + sqrt(1.0 + qx * qx + qy * qy));
  Matrix2 surface = { radius + k * qx * qx, k * qx * qy, k * qx * qy, radius + k * qy * qy };
  return surface;
}

/* The footprint whose kernel covers `surface` (see cone_on_surface). texels: texel coordinates by Dx(P), Dy(P). Returns
 * 0 where the UVs have no derivatives or no area. */
int surface_footprint(Matrix2 surface, Matrix2 texels, output Footprint footprint)
{
  float determinant = texels.xx * texels.yy - texels.xy * texels.yx;
  if (!(abs(determinant) > LEAST_AXES_SINE * hypot(texels.xx, texels.xy) * hypot(texels.yx, texels.yy))) {
    return 0;
  }
  footprint.ux = texels.xx * surface.xx + texels.xy * surface.yx;
  footprint.uy = texels.xx * surface.xy + texels.xy * surface.yy;
  footprint.vx = texels.yx * surface.xx + texels.yy * surface.yx;
  footprint.vy = texels.yx * surface.xy + texels.yy * surface.yy;

  footprint.xu = texels.yy / determinant;
  footprint.xv = -texels.xy / determinant;
  footprint.yu = -texels.yx / determinant;
  footprint.yv = texels.xx / determinant;

  /* Semi-axes are the singular values. */
  float square_sum = footprint.ux * footprint.ux + footprint.uy * footprint.uy + footprint.vx * footprint.vx +
                     footprint.vy * footprint.vy;
  float product = abs(footprint.ux * footprint.vy - footprint.uy * footprint.vx);
  float difference = sqrt(max(square_sum * square_sum - 4.0 * product * product, 0.0));
  footprint.long_axis = sqrt(0.5 * (square_sum + difference));
  footprint.short_axis = product / max(footprint.long_axis, 1e-30);
  footprint.area = M_PI * product;
  return footprint.long_axis < 1e9 && product > 0.0;
}

/* The footprint's ellipse in texel offsets: quu du^2 + 2 quv du dv + qvv dv^2 < 1. */
struct Ellipse {
  float quu;
  float quv;
  float qvv;
  float reach_u; /* texels, half of the bounding box */
  float reach_v;
};

/* wide_u, wide_v: squared texels by which the ellipse's squared axes are widened along u and v. */
Ellipse footprint_ellipse(Footprint footprint, float wide_u, float wide_v)
{
  float suu = footprint.ux * footprint.ux + footprint.uy * footprint.uy;
  float suv = footprint.ux * footprint.vx + footprint.uy * footprint.vy;
  float svv = footprint.vx * footprint.vx + footprint.vy * footprint.vy;
  /* (suu + wide_u) (svv + wide_v) - suv^2, which for thin ellipses would be a difference of large numbers. */
  float product = footprint.ux * footprint.vy - footprint.uy * footprint.vx;
  float determinant = product * product + wide_u * svv + wide_v * suu + wide_u * wide_v;
  Ellipse ellipse;
  ellipse.quu = (svv + wide_v) / determinant;
  ellipse.quv = -suv / determinant;
  ellipse.qvv = (suu + wide_u) / determinant;
  ellipse.reach_u = sqrt(suu + wide_u);
  ellipse.reach_v = sqrt(svv + wide_v);
  return ellipse;
}

/* Squared distance of a texel offset from the middle, where 1 is the ellipse's rim. */
float ellipse_square(Ellipse ellipse, float du, float dv)
{
  return ellipse.quu * du * du + 2.0 * ellipse.quv * du * dv + ellipse.qvv * dv * dv;
}

/* Make a footprint `scale` times as wide. */
void scale_footprint(float scale, output Footprint footprint)
{
  footprint.ux *= scale;
  footprint.uy *= scale;
  footprint.vx *= scale;
  footprint.vy *= scale;
  footprint.area *= scale * scale;
  footprint.long_axis *= scale;
  footprint.short_axis *= scale;
}

/* By how much to widen a footprint of radius `radius` [m] whose view comes from a diffuse bounce at `distance` [m]. */
float caustic_scale(Footprint footprint, float radius, float distance)
{
  return min(sqrt(CAUSTIC_AREA / footprint.area), CAUSTIC_ANGLE * distance / radius);
}

/* Kernel over the unit disk, t = x^2 + y^2: smooth, and 0 from the rim on. Its integral is pi / 3. */
float footprint_kernel(float t)
{
  return t < 1.0 ? (1.0 - t) * (1.0 - t) : 0.0;
}

/* Variance of the kernel along each axis of the unit disk. */
#define KERNEL_VARIANCE 0.125

/* Point of the unit disk distributed as the kernel; a, b uniform in 0..1. */
void footprint_sample(float a, float b, output float x, output float y)
{
  float r = sqrt(max(1.0 - pow(1.0 - a, 1.0 / 3.0), 0.0));
  sincos(M_2PI * b, y, x);
  x *= r;
  y *= r;
}

/* Whether a sample visits an element of weight `weight`: always from the weight `sure` on; lighter elements with the
 * probability weight / sure, and then with the weight `sure`, so that sums keep their expectation. Systematic sampling
 * (Madow 1949): odds sums the probabilities of successive elements, and an element is drawn where the sum reaches 1.
 * odds: uniform in 0..1 before the first element. */
int is_drawn(float sure, output float odds, output float weight)
{
  if (weight < sure) {
    odds += weight / sure;
    weight = odds >= 1.0 ? sure : 0.0;
    odds -= odds >= 1.0;
  }
  return weight > 0.0;
}
