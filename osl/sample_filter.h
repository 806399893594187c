#pragma once
/* The filter by which one sample averages a texture. */

/* Standard deviation in pixels of the Gaussian over which one of `samples` samples a pixel averages: it falls with the
 * samples, so that the picture converges to the unfiltered truth: decision 6. */
float sample_filter_std(float samples)
{
  return 0.4 * pow(max(samples, 1.0), -0.25);
}
