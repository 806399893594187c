#pragma once
/* A facet of the surface: what one microfacet closure shows. */

/* Kinds of surface, each the twin of one of Blender's nodes: glint_addon/nodes/surface_kinds.py. */
#define SURFACE_TINT 0       /* Glossy BSDF */
#define SURFACE_METAL 1      /* Metallic BSDF, F82 Tint */
#define SURFACE_CONDUCTOR 2  /* Metallic BSDF, Physical Conductor */
#define SURFACE_DIELECTRIC 3 /* Principled BSDF, its specular lobe */

struct Facet {
  string distribution; /* "beckmann" or "ggx" */
  float alpha;
  int surface;       /* SURFACE_... */
  color tint;        /* reflectance; METAL: where it is met head-on; DIELECTRIC: factor of that */
  color edge_tint;   /* METAL: tint at 82 degrees */
  vector ior;        /* CONDUCTOR; DIELECTRIC: its first number */
  vector extinction; /* CONDUCTOR */
};

int facet_is_ggx(Facet facet)
{
  return facet.distribution == "ggx";
}

/* `weight` times the closure of a facet of normal n that is alpha_x wide along `axis` and alpha_y across. tint: factor
 * of the facet's own. The calls are those of Cycles' shaders for these nodes: node_glossy_bsdf.osl,
 * node_metallic_bsdf.osl, node_principled_bsdf.osl. */
closure color surface_closure(Facet facet, float weight, color tint, normal n, vector axis, float alpha_x,
                              float alpha_y)
{
  color head_on = tint * facet.tint;
  if (facet.surface == SURFACE_METAL) {
    return weight * microfacet_f82_tint(facet.distribution, n, axis, alpha_x, alpha_y,
                                        clamp(head_on, color(0.0), color(1.0)), facet.edge_tint);
  }
  if (facet.surface == SURFACE_CONDUCTOR) {
    return weight * conductor_bsdf(n, axis, alpha_x, alpha_y, facet.ior, facet.extinction, facet.distribution);
  }
  if (facet.surface == SURFACE_DIELECTRIC) {
    float eta = max(facet.ior[0], 1e-5);
    float root = (eta - 1.0) / (eta + 1.0);
    /* Cycles takes a negative exponent for the index of refraction of real Fresnel. */
    return weight * generalized_schlick_bsdf(n, axis, color(1.0), color(0.0), alpha_x, alpha_y,
                                             root * root * head_on, color(1.0), -eta, facet.distribution);
  }
  return (weight * head_on) * microfacet(facet.distribution, n, axis, alpha_x, alpha_y, 0.0, 0);
}

closure color facet_closure(Facet facet, color tint, normal n)
{
  return surface_closure(facet, 1.0, tint, n, vector(0), facet.alpha, facet.alpha);
}

/* Squared width of a facet's lobe by the variance of slopes that blurs it. A blurred Beckmann lobe is as good as a
 * wider one. A GGX lobe is not: its tail keeps its height, so that of a wider lobe is too high, and what the region
 * around a light holds of it too little. This gain keeps what a region of radius `radius` holds, to first order in the
 * variance: decision 65. */
float facet_gain(Facet facet, float radius)
{
  float reach = radius / max(facet.alpha, 1e-6);
  return facet_is_ggx(facet) ? 4.0 / (1.0 + reach * reach) : 2.0;
}

/* What a facet shows at a squared slope from its middle, relative to its middle; width: its squared alpha. */
float facet_lobe(Facet facet, float square, float width)
{
  float q = square / max(width, 1e-30);
  return facet_is_ggx(facet) ? 1.0 / ((1.0 + q) * (1.0 + q)) : exp(-q);
}
