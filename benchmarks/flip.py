"""HDR-FLIP: how far a picture is from the truth to an eye that sees both in turn at the same place.

Andersson, Nilsson, Shirley, Akenine-Möller: Visualizing Errors in Rendered High Dynamic Range Images, Eurographics
2021 (short papers); the authors' own program. Its map is 0 where no difference is seen, at most 1, and of each pixel
the largest over a range of exposures. Pictures are linear luminance (height, width), shown to it as grey.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

# Its threads are to sleep while they wait: beside another program a picture takes 0.3 s else, and 0.02 so.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

from flip_evaluator import evaluate  # noqa: E402  (reads the variable above)

# A pixel of a picture is one of a screen of 3840 pixels and 0.7 m seen from 0.7 m, FLIP's default: renders are looked
# at pixel for pixel, as if cut out of larger ones. The eye then averages over neighbouring pixels.
PIXELS_PER_DEGREE = 67.02
PERCENTILE = 99  # of the map: the worst pixels, where glints are wrong
# FLIP's exposures end where the median of the truth is bright. Where half of the picture is black (`bumps_close`), that
# is 2^34 times where they begin, and nobody looks at it so: what is darker than this share of the mean counts as such.
DARKEST = 0.01


@dataclass(frozen=True)
class Flip:
    """Of the error map, 0..1: its mean over the pixels, and its 99th percentile."""

    flip: float
    flip_99: float


def flip_error(pictures, mean) -> Flip:
    """HDR-FLIP of `pictures` (count, height, width) against a truth's `mean`, averaged over the pictures.

    Raises ValueError if the pictures are of another size.
    """
    pictures = np.asarray(pictures)
    if pictures.shape[1:] != mean.shape:
        raise ValueError(f"Pictures of {pictures.shape[1:]} and a truth of {mean.shape} pixels: renew the truth.")
    parameters = exposures(mean)
    maps = [_error_map(mean, picture, parameters)[0] for picture in pictures]
    return Flip(float(np.mean(maps)), float(np.mean([np.percentile(each, PERCENTILE) for each in maps])))


def exposures(mean) -> dict[str, float]:
    """The range of exposures (powers of two) in which all pictures of a scene are compared: that of its truth alone."""
    bright = np.maximum(mean, DARKEST * mean.mean())
    chosen = _error_map(bright, bright, {})[1]
    return {key: chosen[key] for key in ("startExposure", "stopExposure")}


def truth_flip(mean, variance) -> float:
    """Mean HDR-FLIP that the truth's own noise makes: of one more truth of that `variance` against `mean`."""
    noise = np.random.default_rng(1).standard_normal(mean.shape)
    return flip_error([np.maximum(mean + np.sqrt(variance) * noise, 0.0)], mean).flip


def _error_map(reference, picture, parameters):
    """(map (height, width), all parameters) of two pictures of luminance at 0 or above."""
    shown = [np.repeat(each[..., np.newaxis], 3, axis=2).astype(np.float32) for each in (reference, picture)]
    found, _, used = evaluate(
        *shown, "HDR", applyMagma=False, parameters={"ppd": PIXELS_PER_DEGREE, **parameters}
    )
    return found[..., 0], used
