#pragma once
/* The linear map from tangent-space normals to world space that Blender's Normal Map node applies, with derivatives:
 * world = n.x * tangent + n.y * bitangent + n.z * upright, not normalised. Source: Cycles, node_normal_map.osl. */

struct NormalFrame {
  vector tangent;
  vector bitangent;
  vector upright;
  vector dpdx; /* Dx(P) and Dy(P) */
  vector dpdy;
  /* How the three change with them: the surface's curvature and the twist of its UVs. */
  vector tangent_dx;
  vector tangent_dy;
  vector bitangent_dx;
  vector bitangent_dy;
  vector upright_dx;
  vector upright_dy;
};

/* Frame at the shading point. Returns 0 where the mesh has no tangents of that UV map: the node then returns N. */
int normal_frame(string tangent_name, string sign_name, output NormalFrame frame)
{
  normal object_tangent = normal(0);
  float tangent_sign = 1.0;
  if (!getattribute(tangent_name, object_tangent) || !getattribute(sign_name, tangent_sign)) {
    return 0;
  }

  /* Take the interpolated normal that the node uses, and the bump normal, which has the same direction and
   * derivatives. */
  normal object_normal = normal(0);
  normal curved = normal(0);
  float is_smooth = 0.0;
  getattribute("geom:is_smooth", is_smooth);
  if (is_smooth) {
    if (!getattribute("geom:normal_map_normal", object_normal)) {
      object_normal = N;
    }
    getattribute("geom:bump_map_normal", curved);
  }
  else {
    object_normal = normalize(transform("world", "object", Ng));
    if (backfacing()) {
      object_normal = -object_normal;
    }
  }

  float side = backfacing() ? -1.0 : 1.0;
  normal world_tangent = side * transform("object", "world", object_tangent);
  normal object_bitangent = tangent_sign * cross(object_normal, object_tangent);
  normal world_bitangent = side * transform("object", "world", object_bitangent);
  normal curved_bitangent = side * transform("object", "world", normal(tangent_sign * cross(curved, object_tangent)));
  normal world_curved = side * transform("object", "world", curved);

  frame.dpdx = Dx(P);
  frame.dpdy = Dy(P);
  frame.tangent = world_tangent;
  frame.bitangent = world_bitangent;
  frame.upright = side * transform("object", "world", object_normal);
  frame.tangent_dx = Dx(world_tangent);
  frame.tangent_dy = Dy(world_tangent);
  frame.bitangent_dx = Dx(curved_bitangent);
  frame.bitangent_dy = Dy(curved_bitangent);
  frame.upright_dx = Dx(world_curved);
  frame.upright_dy = Dy(world_curved);
  return 1;
}

vector frame_to_world(NormalFrame frame, vector n)
{
  return n[0] * frame.tangent + n[1] * frame.bitangent + n[2] * frame.upright;
}
