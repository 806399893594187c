/* The part of the texture that one sample answers for: an ellipse around the hit point, in texels. */

/* Footprint radius in pixels = scale / samples^exponent. A wide footprint blurs the pixel filter (error ~ radius^2), a
 * narrow one leaves holes between the samples. Fitted to the radii of least error for Blackman-Harris 1.5 pixels and
 * scrambled Sobol points: 1.1, 0.9, 0.7, 0.5, 0.35, 0.25 pixels at 1, 4, 16, 64, 256, 1024 samples; the error of a
 * single glint is then 10, 42, 23, 13, 7, 3 % of it: benchmarks/footprint_law.py. (Cycles takes its first sample at the
 * pixel's centre, which is why one sample does so well.) */
#define FOOTPRINT_SCALE 1.1
#define FOOTPRINT_EXPONENT 0.21
/* Least sine of the angle between the axes of the UVs: rounding of float32 leaves nothing of a flatter one. */
#define LEAST_AXES_SINE 1e-6
/* Stretch at grazing angles ends where a pixel sees ten thousand times its own width. */
#define LEAST_COSINE 1e-4
/* After a diffuse bounce the light of a whole wall meets in one point. Any footprint on the wall has the same expectation,
 * for elements are judged with the view that each has of that point, so it may be wider than the ray's cone, which Cycles
 * makes no wider than the camera's pixel. Texels of the footprint; worst of 16 pictures of 64 samples, bumps of slope 0.08
 * and roughness 0.1, against 6.2 of Blender's nodes: 2.9 with 16, 2.5 with 64, 2.5 with 256, which takes twice the time. */
#define CAUSTIC_AREA 64.0
/* Its radius as seen from that point, at most: what a linear turn of the view leaves out grows with the square. Measured
 * with texels of 6 cm, 2 m away: light within noise with 0.05 and 0.1, -1.2 % with 0.2, -3 % without a bound. */
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
  float long_axis;   /* texels, semi-axis */
  float short_axis;
};

/* Radius in pixels that one of `samples` samples covers. */
float footprint_radius(float samples)
{
  return FOOTPRINT_SCALE * pow(max(samples, 1.0), -FOOTPRINT_EXPONENT);
}

/* Footprint from the ray cone. texel_dx, texel_dy: change of the texel coordinates per Dx(P), Dy(P).
 * Cycles gives Dx(P), Dy(P) as an orthonormal pair times the cone's radius, without the stretch of a surface seen at
 * an angle; with q = (I - (I.Ng) Ng) / (I.Ng) in that basis the pixel covers r^2 (1 + q q^T).
 * Returns 0 if there is none (no UV derivatives, or UVs without area). */
int ray_footprint(vector dpdx, vector dpdy, vector view, vector geometric_normal, float radius,
                  float du_dx, float du_dy, float dv_dx, float dv_dy, output Footprint footprint)
{
  float determinant = du_dx * dv_dy - du_dy * dv_dx;
  float cone = length(dpdx);
  if (!(cone > 0.0) || !(abs(determinant) > LEAST_AXES_SINE * hypot(du_dx, du_dy) * hypot(dv_dx, dv_dy))) {
    return 0;
  }

  /* Stretch along the view direction: the square root of 1 + q q^T. */
  float cosine = max(abs(dot(view, geometric_normal)), LEAST_COSINE);
  float qx = dot(view, dpdx) / (cone * cosine);
  float qy = dot(view, dpdy) / (cone * cosine);
  float k = 1.0 / (1.0 + sqrt(1.0 + qx * qx + qy * qy));
  float axx = radius * (1.0 + k * qx * qx);
  float axy = radius * k * qx * qy;
  float ayy = radius * (1.0 + k * qy * qy);

  footprint.ux = du_dx * axx + du_dy * axy;
  footprint.uy = du_dx * axy + du_dy * ayy;
  footprint.vx = dv_dx * axx + dv_dy * axy;
  footprint.vy = dv_dx * axy + dv_dy * ayy;

  footprint.xu = dv_dy / determinant;
  footprint.xv = -du_dy / determinant;
  footprint.yu = -dv_dx / determinant;
  footprint.yv = du_dx / determinant;

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

/* The same footprint, `scale` as wide. */
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

/* How much wider a footprint, `radius` metres wide, may be after a diffuse bounce at `distance`, and is to be. */
float caustic_scale(Footprint footprint, float radius, float distance)
{
  return min(sqrt(CAUSTIC_AREA / footprint.area), CAUSTIC_ANGLE * distance / radius);
}

/* Kernel over the unit disk, t = x^2 + y^2: smooth and of finite support. Its integral is pi / 3. */
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

/* Whether an element of that weight is looked at: above `sure` always, below with the odds of its weight, and then with the
 * weight `sure`, so that sums keep their expectation. Systematic sampling (Madow 1949): elements that follow one another share
 * their odds. due: uniform in 0..1 before the first element. */
int is_drawn(float sure, output float due, output float weight)
{
  if (weight < sure) {
    due += weight / sure;
    weight = due >= 1.0 ? sure : 0.0;
    due -= due >= 1.0;
  }
  return weight > 0.0;
}
