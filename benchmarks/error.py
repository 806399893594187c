"""How far a picture is from the truth: relative RMSE, relMSE, energy bias, each with the truth's own noise taken out.

Pictures are linear luminance, float64 (height, width). Several pictures of one method at one budget are independent
(seeds of their own); what is averaged over them is the squared error, so that the figure is the expected error of one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Keeps black pixels of the truth from deciding the relMSE: a hundredth of the mean luminance squared, that is the usual
# 0.01 for pictures exposed to a mean of 1 (Rousselle, Knaus, Zwicker: Adaptive Sampling and Reconstruction using Greedy
# Error Minimization, SIGGRAPH Asia 2011), made independent of the exposure.
RELATIVE_EPSILON = 0.01


@dataclass(frozen=True)
class Error:
    """rmse, bias: in units of the truth's mean; relmse: see `relative_mse`; bias_noise: standard deviation of bias."""

    rmse: float
    relmse: float
    bias: float
    bias_noise: float


def picture_error(pictures, mean, variance) -> Error:
    """The error of `pictures` (count, height, width) against a truth of `mean` and `variance` of that mean.

    Raises ValueError if the truth is black or the pictures are of another size.
    """
    pictures = np.asarray(pictures, np.float64)
    if pictures.shape[1:] != mean.shape:
        raise ValueError(f"Pictures of {pictures.shape[1:]} and a truth of {mean.shape} pixels: renew the truth.")
    if not mean.mean() > 0.0:
        raise ValueError("The truth is black, so there is no relative error: light the scene.")
    biases = pictures.mean(axis=(1, 2)) / mean.mean() - 1.0
    return Error(
        relative_rmse(pictures, mean, variance),
        relative_mse(pictures, mean, variance),
        float(biases.mean()),
        math.hypot(_picture_bias_noise(pictures, mean), truth_bias_noise(mean, variance)),
    )


def relative_rmse(pictures, mean, variance) -> float:
    """Root of the mean squared difference, less the truth's own variance, in units of the truth's mean; 0 if below."""
    square = np.mean((pictures - mean) ** 2) - np.mean(variance)
    return math.sqrt(max(square, 0.0)) / float(mean.mean())


def relative_mse(pictures, mean, variance) -> float:
    """Mean of (squared difference - the truth's variance) / (truth^2 + RELATIVE_EPSILON mean^2); 0 if below."""
    square = np.mean((pictures - mean) ** 2, axis=0) - variance
    return max(float(np.mean(square / (mean**2 + RELATIVE_EPSILON * mean.mean() ** 2))), 0.0)


def truth_bias_noise(mean, variance) -> float:
    """Standard deviation of the truth's mean luminance, relative: that of a mean of independent pixels."""
    return float(np.sqrt(variance.sum()) / mean.size / mean.mean())


def _picture_bias_noise(pictures, mean):
    """The same of the mean of the pictures, whose variance is not known: that of their differences to the truth."""
    differences = (pictures - mean).mean(axis=0)
    return float(differences.std() / np.sqrt(mean.size) / mean.mean())
