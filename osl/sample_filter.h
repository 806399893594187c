/* How much one sample blurs a texture. */

/* Standard deviation in pixels of the Gaussian that one of `samples` samples a pixel stands for: less with more samples,
 * so that the picture converges to the unfiltered truth. Least error against 4096 samples, measured:
 *   samples               1     4     16    64
 *   noisy image, floor    0.37  0.30  0.20  0.14
 *   checker, two planes   0.42  0.36  0.22  0.15 */
float sample_filter_std(float samples)
{
  return 0.4 * pow(max(samples, 1.0), -0.25);
}
