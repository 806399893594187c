#pragma once
/* The glint table: a normal map as one float texture. Layout: glint_addon/bake/table.py, which writes it. */

#define TABLE_MAGIC 7919.0

/* Exact value of texel (i, j) of the padded texture: at a texel's centre Cycles does not interpolate. */
color table_texel(string table, float inverse_padded_width, float inverse_padded_height, int i, int j)
{
  return texture(table, (i + 0.5) * inverse_padded_width, (j + 0.5) * inverse_padded_height, 0, 0, 0, 0);
}

/* Value at (x, y) in texels, where (i + 0.5, j + 0.5) is the centre of texel (i, j), as Cycles interpolates it. All
 * four texels around the place must lie in the map. */
color table_between(string table, float inverse_padded_width, float inverse_padded_height, float x, float y)
{
  return texture(table, x * inverse_padded_width, y * inverse_padded_height, 0, 0, 0, 0);
}

/* Whether patch_bounds holds for the bilinear patch between texel (i, j) and its right and upper neighbours: a patch
 * across the map's edge has no bounds, nor has the patch at texel (0, 0), whose alpha is TABLE_MAGIC. */
int patch_has_bounds(int width, int height, int i, int j)
{
  return i + 1 < width && j + 1 < height && i + j > 0;
}

/* Bounds of that patch, by one fetch in its middle: the mean of its corners, and a radius that is no less than the
 * distance of the farthest corner, because the alpha of each texel is the radius of the largest patch that touches the
 * texel. */
color patch_bounds(string table, float inverse_padded_width, float inverse_padded_height, int i, int j,
                   output float radius)
{
  return texture(table, (i + 1) * inverse_padded_width, (j + 1) * inverse_padded_height, 0, 0, 0, 0, "alpha", radius);
}

/* Whether the table's file exists, is whole and was not shrunk (Blender's Simplify shrinks data textures without a
 * word). */
int table_is_intact(string table, float inverse_padded_width, float inverse_padded_height)
{
  float magic = 0;
  color texel = texture(
      table, 0.5 * inverse_padded_width, 0.5 * inverse_padded_height, 0, 0, 0, 0, "alpha", magic);
  return magic == TABLE_MAGIC && texel[0] == texel[0];
}

/* Smallest power of two that is at least size: the side of the padded texture. */
float padded_size(float size)
{
  return exp2(ceil(log2(max(size, 1.0)) - 1e-6));
}

/* i modulo size, in 0..size-1 for negative i too. */
int wrapped(int i, int size)
{
  int r = i % size;
  return r < 0 ? r + size : r;
}

/* Normal Map node's Strength on a decoded tangent-space normal. Source: Cycles, node_normal_map.osl. */
vector strengthened(color n, float strength)
{
  return vector(n[0] * strength, n[1] * strength, mix(1.0, n[2], clamp(strength, 0.0, 1.0)));
}

/* Bounds low and high of the slopes of a map -> bounds with Strength. A strength below 1 makes a normal's z larger, so
 * slopes shrink towards 0 by more than the strength. */
void strengthened_bounds(float strength, output vector low, output vector high)
{
  if (strength < 1.0) {
    low = min(low, vector(0));
    high = max(high, vector(0));
  }
  vector one = strength * low;
  vector other = strength * high;
  low = min(one, other);
  high = max(one, other);
}

/* Sides of the texture that holds a list of `texels` texels: powers of two, in one row if the file format allows. Twin:
 * list_shape() of glint_addon/bake/float_image.py. */
void list_shape(int texels, output int log_width, output float inverse_width, output float inverse_height)
{
  log_width = 4;
  while (log_width < 20 && (1 << log_width) < texels) {
    log_width += 1;
  }
  int rows = 1;
  while ((rows << log_width) < texels) {
    rows *= 2;
  }
  inverse_width = 1.0 / (1 << log_width);
  inverse_height = 1.0 / rows;
}
