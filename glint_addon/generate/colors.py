"""A colour for each flake, grain or sequin, from its random number; linear Rec.709 RGB, as Blender's default space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import GenerateError

# Saturation and value come from later digits of the one random number: an id of 24 bits has 8 for each of three.
_SHIFTS = (1.0, 251.0, 63001.0)
LINEAR, CONSTANT = "LINEAR", "CONSTANT"
Color = tuple[float, float, float]


def spread_colors(id: np.ndarray, color: Color, hue=0.0, saturation=0.0, value=0.0) -> np.ndarray:
    """Colours float32 (..., 3) around `color` for random numbers `id` (...) in 0..1.

    hue, saturation, value: width of the range around the colour's own, 0..1 each, as Blender's HSV has them; 1 of hue
    is the whole circle. Saturation and value are kept in 0..1, or below the colour's own value if that is larger.
    """
    own = _hsv(np.array(color, float))
    digits = np.stack([np.mod(np.asarray(id, float) * shift, 1.0) for shift in _SHIFTS], axis=-1)
    hsv = own + (digits - 0.5) * (hue, saturation, value)
    hsv[..., 0] %= 1.0
    hsv[..., 1] = np.clip(hsv[..., 1], 0, 1)
    hsv[..., 2] = np.clip(hsv[..., 2], 0, max(1.0, own[2]))
    return _rgb(hsv).astype(np.float32)


def ramp_colors(id: np.ndarray, stops: Sequence[tuple[float, Color]], interpolation: str = LINEAR) -> np.ndarray:
    """Colours float32 (..., 3) of a colour ramp at `id` (...): stops are (position, colour), in any order.

    interpolation: LINEAR, or CONSTANT from each stop to the next. Raises GenerateError for a ramp without stops, or
    another interpolation.
    """
    if not stops:
        raise GenerateError("A colour ramp has no stops: add one.")
    if interpolation not in (LINEAR, CONSTANT):
        raise GenerateError(f'A colour ramp cannot be "{interpolation}": choose {LINEAR} or {CONSTANT}.')
    ordered = sorted(stops, key=lambda stop: stop[0])
    positions = np.array([position for position, _ in ordered], float)
    colors = np.array([color for _, color in ordered], np.float32)
    if interpolation == CONSTANT:
        # As in Blender, the first stop's colour goes on before it.
        return colors[np.maximum(np.searchsorted(positions, id, side="right") - 1, 0)]
    channels = [np.interp(id, positions, colors[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


def _hsv(rgb):
    """Hue, saturation and value of one colour (3,)."""
    value = rgb.max()
    chroma = value - rgb.min()
    if chroma == 0:
        return np.array([0.0, 0.0, value])
    r, g, b = rgb
    sector = ((g - b) / chroma, 2 + (b - r) / chroma, 4 + (r - g) / chroma)[int(rgb.argmax())]
    return np.array([sector / 6 % 1.0, chroma / value, value])


def _rgb(hsv):
    """Colours (..., 3) of hue, saturation and value (..., 3)."""
    hue, saturation, value = np.moveaxis(hsv, -1, 0)
    # Red is fullest at the hue 0, where the distance from half of the circle is largest; the others a third later each.
    distance = np.abs((hue[..., None] * 6 - (0.0, 2.0, 4.0)) % 6 - 3)
    pure = np.clip(distance - 1, 0, 1)
    return value[..., None] * (1 - saturation[..., None] * (1 - pure))
