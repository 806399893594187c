#pragma once
/* A facet of the surface: what one microfacet closure shows. */

struct Facet {
  string distribution; /* "beckmann" or "ggx" */
  float alpha;
};

int facet_is_ggx(Facet facet)
{
  return facet.distribution == "ggx";
}

closure color facet_closure(Facet facet, normal n)
{
  return microfacet(facet.distribution, n, vector(0), facet.alpha, facet.alpha, 0.0, 0);
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
