"""How individuals are coloured, as settings: around one colour, or by a colour ramp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .colors import CONSTANT, LINEAR, Color, ramp_colors, spread_colors
from .settings import COLOR, FACTOR, Choice, setting

NONE, SPREAD, RAMP = "NONE", "SPREAD", "RAMP"
_MODES = (
    Choice(NONE, "None", "No image of colours"),
    Choice(SPREAD, "Spread", "Colours around one colour"),
    Choice(RAMP, "Ramp", "Colours of a colour ramp, each place on it equally frequent"),
)
_INTERPOLATIONS = (
    Choice(LINEAR, "Linear", "Colours between stops are mixed"),
    Choice(CONSTANT, "Constant", "Each colour is that of the stop before it"),
)


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A colour of a ramp."""

    position: float = setting(0.0, "Position", "Where on the ramp the colour is", low=0.0, high=1.0, quantity=FACTOR)
    color: Color = setting((0.8, 0.8, 0.8), "Color", "Color at this place of the ramp", low=0.0, high=1.0,
                           quantity=COLOR)


@dataclass(frozen=True, kw_only=True)
class Coloring:
    """Colours of flakes, grains and other individuals by their random numbers; colours are linear Rec.709."""

    label = "Colors"

    mode: str = setting(NONE, "Colors", "Where the colors of flakes and grains come from", choices=_MODES)
    color: Color = setting((0.8, 0.5, 0.2), "Color", "The color that others are spread around", low=0.0, high=1.0,
                           quantity=COLOR, only=("mode", (SPREAD,)))
    hue: float = setting(0.1, "Hue Spread", "Range of the hues, 1 is the whole circle", low=0.0, high=1.0,
                         quantity=FACTOR, only=("mode", (SPREAD,)))
    saturation: float = setting(0.2, "Saturation Spread", "Range of the saturations", low=0.0, high=1.0,
                                quantity=FACTOR, only=("mode", (SPREAD,)))
    value: float = setting(0.2, "Value Spread", "Range of the values", low=0.0, high=1.0, quantity=FACTOR,
                           only=("mode", (SPREAD,)))
    interpolation: str = setting(LINEAR, "Interpolation", "What lies between the stops of the ramp",
                                 choices=_INTERPOLATIONS, only=("mode", (RAMP,)))
    stops: tuple[Stop, ...] = setting((Stop(color=(0.8, 0.1, 0.05)), Stop(position=1.0, color=(0.9, 0.7, 0.1))),
                                      "Stops", "Colors of the ramp", low=1, high=32, only=("mode", (RAMP,)))

    def colors(self, id: np.ndarray | None) -> np.ndarray | None:
        """Colours float32 (..., 3) of random numbers `id` (...); None without any, or without an image of colours."""
        if id is None or self.mode == NONE:
            return None
        if self.mode == RAMP:
            return ramp_colors(id, [(stop.position, stop.color) for stop in self.stops], self.interpolation)
        return spread_colors(id, self.color, self.hue, self.saturation, self.value)


def srgb(linear: np.ndarray) -> np.ndarray:
    """Linear values as sRGB has them, float32 (IEC 61966-2-1)."""
    linear = np.clip(np.asarray(linear, np.float32), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** np.float32(1 / 2.4) - 0.055)
