#pragma once
/* Half vectors of the hinted lights. A hint says where a small light is, and a facet whose normal lies within the
 * region around the light's half vector shows a glint of that light. */

#include "footprint.h"
#include "normal_frame.h"

#define HINT_COUNT 8
#define HINT_NONE 0.0
#define HINT_SUN 1.0
#define HINT_LOCAL 2.0
/* Radius of the region in alpha: a Beckmann lobe has 0.2 % of its energy outside (exp(-2.5^2)), a GGX lobe 14 %, and
 * the remainder shows this energy without bias. A wider region would need more cells. */
#define REGION 2.5
/* Largest radius of a region (slope): a wider lobe shows no glints, because it blurs them. */
#define LARGEST_REGION 0.8
/* Largest radius of a region, relative to the cosine of view and half vector, and to the sine of the light's height
 * above the surface. Near either horizon the lobe changes across the region faster than the cells of counts can follow,
 * and Cycles bends normals that reflect below the surface, so light is lost: decision 36. */
#define LARGEST_OF_VIEW 1.0
#define LARGEST_OF_LIGHT 2.0
/* Largest turn (slope) over half a texel: on UVs squeezed nearly to a line, a turn is a difference of large numbers,
 * and light is lost: decision 37. */
#define LARGEST_TURN 2.0

/* Largest turn (slope) within the footprint, which is made smaller where the turn is larger: the turn is linear only to
 * first order, and a near lamp's light is lost: decision 4. */
#define LARGEST_FOOTPRINT_TURN 1.0

/* Half-angle from which on a cone is a half-space: pi / 2, less than rounding. */
#define FLAT_CONE 1.5707

/* Slopes around a half vector: p = (n.t1, n.t2) / (n.h) for a normal n in world space, as three linear forms on
 * tangent-space normals: p = (n.f1, n.f2) / (n.f3) + offset in texels * (turn_u, turn_v). The turn is the change of a
 * slope with the position on the surface, because the surface's normal, the view and the light change direction from
 * texel to texel. */
struct HalfVector {
  vector h;
  vector t1;
  vector t2;
  vector f1;
  vector f2;
  vector f3;
  /* Turn per texel: change of slope 1 and slope 2 over one texel along u and v. */
  float turn_u1;
  float turn_v1;
  float turn_u2;
  float turn_v2;
  float radius;      /* of the region (slope) */
  float turn;        /* change of slope from the footprint's middle to its edge */
  float reach;       /* change of slope from the footprint's middle to one texel beyond its edge */
  float patch_turn;  /* change of slope from a patch's middle to its corners */
  /* By how much the three forms differ within a ball of normals, relative to the ball's radius. */
  float ball_growth;
};

/* Axes and linear forms around hint.h. */
void slope_axes(NormalFrame frame, output HalfVector hint)
{
  hint.t1 = normalize(abs(hint.h[2]) < 0.9 ? vector(-hint.h[1], hint.h[0], 0) : vector(0, -hint.h[2], hint.h[1]));
  hint.t2 = cross(hint.h, hint.t1);
  hint.f1 = vector(dot(frame.tangent, hint.t1), dot(frame.bitangent, hint.t1), dot(frame.upright, hint.t1));
  hint.f2 = vector(dot(frame.tangent, hint.t2), dot(frame.bitangent, hint.t2), dot(frame.upright, hint.t2));
  hint.f3 = vector(dot(frame.tangent, hint.h), dot(frame.bitangent, hint.h), dot(frame.upright, hint.h));
}

/* Largest length of (n.f1, n.f2) for unit normals n; f1, f2 are orthogonal unless the object is scaled unevenly. */
float forms_norm(vector f1, vector f2)
{
  float mean = 0.5 * (dot(f1, f1) + dot(f2, f2));
  return sqrt(mean + hypot(0.5 * (dot(f1, f1) - dot(f2, f2)), dot(f1, f2)));
}

/* Whether a light can shine on the shading point: whether the point lies within the light's cone, whose half-angle is
 * shape[2] (0: the light shines all around) and whose axis points against the direction in which the light shines. Each
 * point of a soft lamp has its own cone, and a cone of FLAT_CONE is the half-space in front of a flat lamp. Where the
 * light cannot shine, its hint is left out and the remainder shows it without bias: decision 38. */
int shines_here(vector light, vector shape, vector axis)
{
  if (shape[0] != HINT_LOCAL || !(shape[2] > 0.0)) {
    return 1;
  }
  vector l = light - vector(P);
  float distance = length(l);
  float cone = shape[2];
  if (cone < FLAT_CONE) {
    cone += shape[1] < distance ? asin(shape[1] / distance) : M_PI;
  }
  return cone >= M_PI || dot(l, axis) > distance * cos(cone);
}

/* Half vector of one hint at the shading point; region: radius of a facet's lobe (slope), view_turn: of the view per
 * metre along the surface (radians). Returns 0 if the hint is not used here. turn_over gives what depends on the
 * footprint's size. */
int half_vector(vector light, vector shape, float region, NormalFrame frame, Footprint footprint, float view_turn,
                output HalfVector hint)
{
  if (shape[0] == HINT_NONE) {
    return 0;
  }

  /* Find the direction to the light, its angular radius, and how fast it turns with the position. */
  vector l = light;
  float half_angle = shape[1];
  float light_turn = 0.0;
  if (shape[0] == HINT_LOCAL) {
    l = light - vector(P);
    float distance = length(l);
    if (!(distance > 0.0)) {
      return 0;
    }
    l /= distance;
    half_angle = shape[1] < distance ? asin(shape[1] / distance) : M_PI;
    light_turn = 1.0 / distance;
  }
  vector sum = l + I;
  float sum_length = length(sum);
  if (sum_length < 1e-3) {
    return 0;
  }
  hint.h = sum / sum_length;

  /* An angle a between lights is an angle between half vectors of up to a / (2 cos) across the plane of incidence. */
  hint.radius = region + half_angle / sum_length;
  float largest = min(LARGEST_OF_VIEW * 0.5 * sum_length, LARGEST_OF_LIGHT * dot(l, Ng));
  if (!(hint.radius < min(largest, LARGEST_REGION))) {
    return 0;
  }

  slope_axes(frame, hint);

  /* Find the turn of the frame for normals near h, whose tangent-space normal is about f3, less the turn of the half
   * vector: d(l + I) = -(across l / its distance) - (across I / its distance). */
  vector turn_dx = hint.f3[0] * frame.tangent_dx + hint.f3[1] * frame.bitangent_dx + hint.f3[2] * frame.upright_dx;
  vector turn_dy = hint.f3[0] * frame.tangent_dy + hint.f3[1] * frame.bitangent_dy + hint.f3[2] * frame.upright_dy;
  vector dpdx = frame.dpdx;
  vector dpdy = frame.dpdy;
  turn_dx += (light_turn * (dpdx - dot(dpdx, l) * l) + view_turn * (dpdx - dot(dpdx, I) * I)) / sum_length;
  turn_dy += (light_turn * (dpdy - dot(dpdy, l) * l) + view_turn * (dpdy - dot(dpdy, I) * I)) / sum_length;
  float dx1 = dot(turn_dx, hint.t1);
  float dx2 = dot(turn_dx, hint.t2);
  float dy1 = dot(turn_dy, hint.t1);
  float dy2 = dot(turn_dy, hint.t2);
  hint.turn_u1 = dx1 * footprint.xu + dy1 * footprint.yu;
  hint.turn_v1 = dx1 * footprint.xv + dy1 * footprint.yv;
  hint.turn_u2 = dx2 * footprint.xu + dy2 * footprint.yu;
  hint.turn_v2 = dx2 * footprint.xv + dy2 * footprint.yv;

  hint.patch_turn = 0.5 * (hypot(hint.turn_u1, hint.turn_u2) + hypot(hint.turn_v1, hint.turn_v2));
  return hint.patch_turn < LARGEST_TURN;
}

/* How far slopes turn over a footprint. */
void turn_over(Footprint footprint, output HalfVector hint)
{
  hint.turn = hypot(hint.turn_u1, hint.turn_u2) * hypot(footprint.ux, footprint.uy) +
              hypot(hint.turn_v1, hint.turn_v2) * hypot(footprint.vx, footprint.vy);
  hint.reach = hint.turn + 2.0 * hint.patch_turn;
  hint.ball_growth = forms_norm(hint.f1, hint.f2) + (hint.radius + hint.reach) * length(hint.f3);
}

/* Whether any convex combination of four normals can have a slope within `r` of the half vector; in doubt yes.
 * offset_u, offset_v: where it lies, in texels. None can if all four lie beyond the same side of a square around the
 * half vector, or behind its horizon. The test uses linear forms, so it holds for normals on both sides of the
 * horizon too. */
int hull_reaches_hint(HalfVector hint, vector corners[4], float offset_u, float offset_v, float r)
{
  vector f1 = hint.f1 + (offset_u * hint.turn_u1 + offset_v * hint.turn_v1) * hint.f3;
  vector f2 = hint.f2 + (offset_u * hint.turn_u2 + offset_v * hint.turn_v2) * hint.f3;
  int sides[5] = { 1, 1, 1, 1, 1 };
  for (int corner = 0; corner < 4; ++corner) {
    float limit = r * dot(corners[corner], hint.f3);
    float x1 = dot(corners[corner], f1);
    float x2 = dot(corners[corner], f2);
    sides[0] = sides[0] && limit <= 0.0;
    sides[1] = sides[1] && x1 >= limit;
    sides[2] = sides[2] && x1 <= -limit;
    sides[3] = sides[3] && x2 >= limit;
    sides[4] = sides[4] && x2 <= -limit;
  }
  return !(sides[0] || sides[1] || sides[2] || sides[3] || sides[4]);
}

/* Whether any normal whose slope lies between low and high can lie in the region around h: all are convex combinations
 * of the corners of that box. */
int map_reaches_hint(HalfVector hint, vector low, vector high)
{
  vector corners[4] = { vector(low[0], low[1], 1.0), vector(high[0], low[1], 1.0), vector(low[0], high[1], 1.0),
                        vector(high[0], high[1], 1.0) };
  return hull_reaches_hint(hint, corners, 0.0, 0.0, hint.radius + hint.reach);
}
