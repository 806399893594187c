#pragma once
/* The 3D checker sin(x) sin(y) sin(z) < 0, and its mean over an elliptic Gaussian on the surface. */

/* A footprint below this many radians (largest standard deviation along x, y, z) is averaged over points, and a larger
 * footprint by the Fourier series, which then has few terms. */
#define POINTS_LIMIT 1.25
/* A coordinate that varies less than this many radians meets one edge at most, and that edge is blurred by itself. */
#define CONSTANT_LIMIT 0.08
/* An edge is ignored beyond this many standard deviations: 0.6 % of the Gaussian lie farther away. */
#define EDGE_REACH 2.5
/* Terms damped by more than exp(-REACH^2 / 2) = 1 % are left out. */
#define SPECTRUM_REACH 3.0
/* Highest harmonics of the coordinates that vary least, where two or three vary, and of the coordinate that varies
 * most. */
#define HIGHEST_OF_TWO 31
#define HIGHEST_OF_THREE 19
#define HIGHEST_HARMONIC 63
#define SQUARE_WAVE 1.2732395447351628 /* 4 / pi: sign(sin x) = 4/pi sum over odd k of sin(k x) / k */

/* Whether the point (radians) has color 1. */
int checker_is_first(point x)
{
  return sin(x[0]) * sin(x[1]) * sin(x[2]) < 0.0;
}

/* Distance in radians to the nearest multiple of pi. */
float edge_distance(float x)
{
  return abs(x - M_PI * floor(x / M_PI + 0.5));
}

/* Mean of slice i of 64 equal slices of a normal distribution; upper: those of its upper half. */
float normal_slice(float upper[32], int i)
{
  return i < 32 ? -upper[31 - i] : upper[i - 32];
}

/* Share of color 1 among 64 points of equal weight: a lattice, so that its projection on any edge has many steps. */
float checker_points_share(point x, vector long_axis, vector short_axis)
{
  float upper[32] = {0.0196, 0.0588, 0.0981, 0.1375, 0.1772, 0.2171, 0.2574, 0.2981,
                     0.3393, 0.3811, 0.4236, 0.4669, 0.5110, 0.5562, 0.6025, 0.6502,
                     0.6994, 0.7503, 0.8033, 0.8586, 0.9167, 0.9781, 1.0434, 1.1134,
                     1.1895, 1.2731, 1.3668, 1.4743, 1.6023, 1.7642, 1.9942, 2.5102};
  int count = 0;
  for (int i = 0; i < 64; ++i) {
    int j = (37 * i + 18) % 64;
    count += checker_is_first(x + normal_slice(upper, i) * long_axis + normal_slice(upper, j) * short_axis);
  }
  return count / 64.0;
}

/* Smallest odd number that is at least `least`. */
int odd_from(float least)
{
  return 2 * (int)ceil((least - 1.0) / 2.0) + 1;
}

/* Sum over signed odd n of term(n) / n, where term is sin (three waves) or cos (two waves) of phase + n x, damped by
 * exp(-|(p, q) + n (a, b)|^2 / 2). */
float damped_wave(float phase, float p, float q, float x, float a, float b, int use_sine)
{
  float square = a * a + b * b;
  float along = -(p * a + q * b) / square;
  float rest = p * p + q * q - along * along * square;
  float reach = SPECTRUM_REACH * SPECTRUM_REACH - rest;
  float total = 0.0;
  if (reach > 0.0) {
    float half_range = sqrt(reach / square);
    float highest = min(along + half_range, float(HIGHEST_HARMONIC));
    for (int n = odd_from(max(along - half_range, -float(HIGHEST_HARMONIC))); n <= highest; n += 2) {
      float u = p + n * a;
      float w = q + n * b;
      float angle = phase + n * x;
      total += exp(-0.5 * (u * u + w * w)) * (use_sine ? sin(angle) : cos(angle)) / n;
    }
  }
  return total;
}

/* Mean of sign(sin x) sign(sin y) sign(sin z) by the Fourier series of the three square waves: a wave of frequency
 * (k, l, m) is damped by exp(-|k g_x + l g_y + m g_z|^2 / 2), where g_x = (long_axis.x, short_axis.x), and so on. The
 * series is also right where the three waves are in step (a diagonal plane), where a product of their means is not. */
float checker_wave_mean(point x, vector long_axis, vector short_axis)
{
  /* Sort the axes, so that the axis of the largest spread comes at the end; axes that hardly vary become a factor. */
  vector spread = vector(hypot(long_axis[0], short_axis[0]), hypot(long_axis[1], short_axis[1]),
                         hypot(long_axis[2], short_axis[2]));
  int axes[3];
  int count = 0;
  float constant = 1.0;
  for (int i = 0; i < 3; ++i) {
    if (spread[i] < CONSTANT_LIMIT) {
      constant *= sign(sin(x[i])) * erf(edge_distance(x[i]) / (M_SQRT2 * max(spread[i], 1e-6)));
    }
    else {
      axes[count] = i;
      count += 1;
    }
  }
  for (int i = 0; i + 1 < count; ++i) {
    if (spread[axes[i]] > spread[axes[count - 1]]) {
      int swapped = axes[i];
      axes[i] = axes[count - 1];
      axes[count - 1] = swapped;
    }
  }

  int widest = axes[count - 1];
  float mean = 0.0;
  if (count == 1) {
    /* sin X, of which damped_wave sums both signs of n. */
    mean = 0.5 * SQUARE_WAVE * damped_wave(0.0, 0.0, 0.0, x[widest], long_axis[widest], short_axis[widest], 1);
  }
  else {
    /* sin X sin Y = -1/2 sum of s cos(X + s Y); sin X sin Y sin Z = -1/4 sum of s t sin(X + s Y + t Z), s, t = +-1. */
    int first = axes[0];
    int second = axes[1];
    int highest_harmonic = count == 2 ? HIGHEST_OF_TWO : HIGHEST_OF_THREE;
    for (int k = 1; k <= highest_harmonic; k += 2) {
      float phase = k * x[first];
      float p = k * long_axis[first];
      float q = k * short_axis[first];
      if (count == 2) {
        mean -= 0.5 * SQUARE_WAVE * SQUARE_WAVE / k *
                damped_wave(phase, p, q, x[widest], long_axis[widest], short_axis[widest], 0);
      }
      else {
        for (int l = -highest_harmonic; l <= highest_harmonic; l += 2) {
          mean -= 0.25 * SQUARE_WAVE * SQUARE_WAVE * SQUARE_WAVE / (k * l) *
                  damped_wave(phase + l * x[second], p + l * long_axis[second], q + l * short_axis[second], x[widest],
                              long_axis[widest], short_axis[widest], 1);
        }
      }
    }
  }
  return clamp(constant * mean, -1.0, 1.0);
}

/* Share of color 1 in a Gaussian around x (radians) whose standard deviations are the two vectors. */
float checker_share(point x, vector long_axis, vector short_axis)
{
  /* Find out whether an edge is near. */
  float largest = 0.0;
  int near_edge = 0;
  int on_edge = 0;
  for (int i = 0; i < 3; ++i) {
    float spread = hypot(long_axis[i], short_axis[i]);
    largest = max(largest, spread);
    near_edge = near_edge || edge_distance(x[i]) < EDGE_REACH * spread;
    on_edge = on_edge || (spread < CONSTANT_LIMIT && sin(x[i]) == 0.0);
  }
  if (on_edge) {
    return 0.0; /* as on a plane at z = 0: the product of sines is 0, which is color 2 */
  }
  if (!near_edge) {
    return checker_is_first(x);
  }
  if (largest < POINTS_LIMIT) {
    return checker_points_share(x, long_axis, short_axis);
  }
  return 0.5 - 0.5 * checker_wave_mean(x, long_axis, short_axis);
}

/* Two standard deviations of a pixel's footprint on the surface, as vectors: Dx(P), Dy(P) with the stretch of a surface
 * seen at an angle, which Cycles leaves out; the square root of 1 + q q^T as in cone_on_surface (footprint.h). */
void surface_footprint(vector dpdx, vector dpdy, vector view, vector geometric_normal, float std_pixels,
                       output vector first, output vector second)
{
  float cone = max(length(dpdx), 1e-30);
  float cosine = max(abs(dot(view, geometric_normal)), 1e-4);
  float qx = dot(view, dpdx) / (cone * cosine);
  float qy = dot(view, dpdy) / (cone * cosine);
  float k = 1.0 / (1.0 + sqrt(1.0 + qx * qx + qy * qy));
  first = std_pixels * ((1.0 + k * qx * qx) * dpdx + k * qx * qy * dpdy);
  second = std_pixels * (k * qx * qy * dpdx + (1.0 + k * qy * qy) * dpdy);
}
