#pragma once
/* Mip-mapped look-ups in the atlas that glint_addon/bake/pyramid.py writes; the layout is described there. */

#define PYRAMID_MAGIC 5344.0
#define PYRAMID_BORDER 1
#define PYRAMID_MAGIC_TOLERANCE 0.5

/* Standard deviation of a bilinear look-up among box means, in that level's texels: tent 1/6 + box 1/12. */
#define TAP_STD 0.5
#define MAX_ANISOTROPY 16.0
/* Taps along the long axis reach as far as TAP_REACH standard deviations, and lie TAP_SPACING standard deviations of a
 * tap apart. */
#define TAP_REACH 2.0
#define TAP_SPACING 1.5

struct Pyramid {
  int width;
  int height;
  int level_count;
  float atlas_width;
  float atlas_height;
  int encoded;     /* level 0 is sRGB-encoded */
  int unassociate; /* colour is stored times alpha, and straight colour is wanted */
  int clamp_v;     /* v ends at 0 and 1 instead of repeating */
};

/* Side of level `level` in texels: each level has half the side of the level below, rounded up. */
int level_side(int side, int level)
{
  return (side + (1 << level) - 1) >> level;
}

/* Texel row of the atlas where `level` starts. Level 0 lies alone on the left. */
int level_row(Pyramid pyramid, int level)
{
  int row = PYRAMID_BORDER;
  for (int finer = 1; finer < level; ++finer) {
    row += level_side(pyramid.height, finer) + 2 * PYRAMID_BORDER;
  }
  return row;
}

Pyramid image_pyramid(int width, int height, int encoded, int unassociate, int clamp_v)
{
  Pyramid pyramid;
  pyramid.width = width;
  pyramid.height = height;
  pyramid.encoded = encoded;
  pyramid.unassociate = unassociate;
  pyramid.clamp_v = clamp_v;
  pyramid.level_count = 1;
  int side = max(width, height);
  while (side > 1) {
    side = level_side(side, 1);
    pyramid.level_count += 1;
  }

  int right = 0;
  int rows = 0;
  if (pyramid.level_count > 1) {
    right = level_side(width, 1) + 2 * PYRAMID_BORDER;
    rows = level_row(pyramid, pyramid.level_count) - PYRAMID_BORDER;
  }
  pyramid.atlas_width = width + 2 * PYRAMID_BORDER + right + 1;
  pyramid.atlas_height = max(height + 2 * PYRAMID_BORDER, rows);
  return pyramid;
}

/* Whether the atlas's file exists and was not shrunk. */
int pyramid_is_whole(string file, Pyramid pyramid)
{
  float magic;
  color corner = texture(file, (pyramid.atlas_width - 0.5) / pyramid.atlas_width, 0.5 / pyramid.atlas_height, 0.0, 0.0,
                         0.0, 0.0, "alpha", magic);
  return abs(magic - PYRAMID_MAGIC) < PYRAMID_MAGIC_TOLERANCE && corner[0] == 0.0;
}

/* Source: IEC 61966-2-1. */
float srgb_decoded(float value)
{
  return value < 0.04045 ? max(value, 0.0) / 12.92 : pow((value + 0.055) / 1.055, 2.4);
}

/* Bilinear look-up in one level at (s, t), linear light, colour times alpha where the image has alpha. */
color level_color(string file, Pyramid pyramid, int level, int row, float s, float t, output float alpha)
{
  int width = level_side(pyramid.width, level);
  int height = level_side(pyramid.height, level);
  float x = (s - floor(s)) * width;
  float y = (pyramid.clamp_v ? clamp(t, 0.5 / height, 1.0 - 0.5 / height) : t - floor(t)) * height;
  int column = level == 0 ? PYRAMID_BORDER : pyramid.width + 3 * PYRAMID_BORDER;
  color result = texture(file, (column + x) / pyramid.atlas_width, (row + y) / pyramid.atlas_height, 0.0, 0.0, 0.0, 0.0,
                         "alpha", alpha);
  if (level == 0 && pyramid.encoded) {
    /* Interpolate first, then decode the straight colour, as Cycles does. */
    float divisor = pyramid.unassociate && alpha != 0.0 ? alpha : 1.0;
    result /= divisor;
    result = divisor * color(srgb_decoded(result[0]), srgb_decoded(result[1]), srgb_decoded(result[2]));
  }
  return result;
}

/* An elliptic Gaussian over the image. */
struct Gaussian {
  float s; /* its middle, in texture units */
  float t;
  float long_s; /* one standard deviation along its long axis, in texture units */
  float long_t;
  float long_std; /* its standard deviations in texels */
  float short_std;
};

/* Mean of the image over a Gaussian, by trilinear taps along its long axis. After McCormack et al., "Feline: Fast
 * Elliptical Lines for Anisotropic Texture Mapping", SIGGRAPH 1999; we choose levels so that variances add up to the
 * footprint's. */
color filtered_color(string file, Pyramid pyramid, Gaussian over, output float alpha)
{
  /* Choose the level whose tap is as wide as the short axis. */
  float wanted = max(max(over.short_std, over.long_std / MAX_ANISOTROPY), 1e-6);
  float depth = clamp(log2(wanted / TAP_STD), 0.0, float(pyramid.level_count - 1));
  int fine = min(int(depth), max(pyramid.level_count - 2, 0));
  float coarse_share = min(depth - fine, 1.0);
  int fine_row = level_row(pyramid, fine);
  int coarse = min(fine + 1, pyramid.level_count - 1);
  int coarse_row = level_row(pyramid, coarse);

  /* Spread taps so that the variance of their places and of one tap add up to the long axis's. */
  float tap_std = TAP_STD * pow(2.0, depth);
  float spread = sqrt(max(over.long_std * over.long_std - tap_std * tap_std, 0.0));
  int half_count = int(ceil(TAP_REACH * spread / (TAP_SPACING * tap_std) - 0.25));
  float stretch = over.long_std > 0.0 ? spread / over.long_std : 0.0;

  color total = 0.0;
  float total_alpha = 0.0;
  float total_weight = 0.0;
  for (int tap = -half_count; tap <= half_count; ++tap) {
    float offset = half_count > 0 ? TAP_REACH * tap / half_count : 0.0;
    float weight = exp(-0.5 * offset * offset);
    float tap_s = over.s + offset * stretch * over.long_s;
    float tap_t = over.t + offset * stretch * over.long_t;
    float tap_alpha;
    color tap_color = level_color(file, pyramid, fine, fine_row, tap_s, tap_t, tap_alpha);
    if (coarse_share > 0.0) {
      float coarse_alpha;
      color coarse_color = level_color(file, pyramid, coarse, coarse_row, tap_s, tap_t, coarse_alpha);
      tap_color = mix(tap_color, coarse_color, coarse_share);
      tap_alpha = mix(tap_alpha, coarse_alpha, coarse_share);
    }
    total += weight * tap_color;
    total_alpha += weight * tap_alpha;
    total_weight += weight;
  }
  alpha = total_alpha / total_weight;
  return total / total_weight;
}
