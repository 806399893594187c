"""Many straight or curved grooves, carved into one periodic surface."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

STEP = 0.7  # texels between two points of a walk: each texel whose centre is in a groove has one of them
POINTS = 1 << 15  # that are carved at once: few, so that they stay in the processor's cache


class Grooves(NamedTuple):
    """n grooves, lengths in metres and angles in radians; arrays are (n,), in parts of them (n, 1, 1).

    A groove begins at `along` from its place (x, y) in the direction `angle`, and `across` to the left of it. radius:
    of the circle that it follows, whose centre is to the left if it is positive; None: all are straight. Its profile is
    a cosine of `width` and `depth`, and it rises to the surface over one width at both ends.
    """

    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray
    across: np.ndarray
    along: np.ndarray
    length: np.ndarray
    width: np.ndarray
    depth: np.ndarray
    radius: np.ndarray | None = None

    def part(self, chosen: np.ndarray) -> Grooves:
        """Some of the grooves, as arrays (n, 1, 1)."""
        parts: dict[str, Any] = {name: None if values is None else values[chosen][:, None, None]
                                 for name, values in self._asdict().items()}
        return Grooves(**parts)


def carved(grooves: Grooves, extent: float, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Slopes float32 (r, r, 2), and the number of the deepest groove at each texel's centre int32 (r, r), -1 for none.

    What is carved is decided and measured at the texels' centres, so that it does not depend on how grooves are walked.
    """
    height = np.zeros(resolution**2, np.float32)
    slopes = np.zeros((resolution**2, 2), np.float32)
    owner = np.full(resolution**2, -1, np.int32)
    texel = extent / resolution
    for numbers, steps, lanes in _groups(grooves, texel):
        part = grooves.part(numbers)
        at_s = np.minimum(np.asarray(steps)[None, :, None] * (STEP * texel), part.length)
        at_t = np.minimum(np.arange(lanes)[None, None, :] * (STEP * texel), part.width) - part.width / 2
        x, y = position(part, at_s, at_t)
        column, row = np.floor(x / texel), np.floor(y / texel)
        # From the point of the walk to the centre of its texel.
        depth, p, q = _surface(part, (column + 0.5) * texel, (row + 0.5) * texel)

        index = (row.astype(np.int64) % resolution) * resolution + column.astype(np.int64) % resolution
        np.minimum.at(height, index.ravel(), depth.ravel())
        seen = (depth < 0) & (height[index] == depth)
        where = index[seen]
        slopes[where, 0], slopes[where, 1] = p[seen], q[seen]
        owner[where] = np.broadcast_to(numbers[:, None, None], seen.shape)[seen]
    return slopes.reshape(resolution, resolution, 2), owner.reshape(resolution, resolution)


def walk(grooves: Grooves, texel: float) -> tuple[np.ndarray, np.ndarray]:
    """How many points a walk over each groove has along it and across it, (n,) each; texel: its side in metres."""
    steps = np.ceil(grooves.length / texel / STEP).astype(int) + 1
    return steps, np.ceil(grooves.width / texel / STEP).astype(int) + 1


def _groups(grooves, texel) -> Iterator[tuple[np.ndarray, range, int]]:
    """Numbers of grooves of like size, a part of the points along them, and how many there are across the widest."""
    steps, lanes = walk(grooves, texel)
    order = np.lexsort((steps, lanes))
    start = 0
    while start < len(order):
        # The next ones are about as large as this one.
        first = order[start]
        stop = start + max(1, int(POINTS // (steps[first] * lanes[first])))
        numbers = order[start:stop].astype(np.int32)
        most, across = int(steps[numbers].max()), int(lanes[numbers].max())
        at_once = max(1, POINTS // (across * len(numbers)))
        for step in range(0, most, at_once):
            yield numbers, range(step, min(step + at_once, most)), across
        start = stop


def position(grooves: Grooves, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where `s` along and `t` to the left of a groove is: x and y, metres."""
    forward, left = s + grooves.along, t + grooves.across
    if grooves.radius is not None:
        turn = forward / grooves.radius
        forward, left = (grooves.radius - left) * np.sin(turn), grooves.radius - (grooves.radius - left) * np.cos(turn)
    cosine, sine = np.cos(grooves.angle), np.sin(grooves.angle)
    return grooves.x + forward * cosine - left * sine, grooves.y + forward * sine + left * cosine


def coordinates(grooves: Grooves, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The inverse of `position`: metres along a groove and to the left of it, and its direction there in radians."""
    x, y = x - grooves.x, y - grooves.y
    cosine, sine = np.cos(grooves.angle), np.sin(grooves.angle)
    forward, left = x * cosine + y * sine, y * cosine - x * sine
    turn = np.zeros(1)
    if grooves.radius is not None:
        sign = np.sign(grooves.radius)
        turn = np.arctan2(sign * forward, sign * (grooves.radius - left))
        # Angles are counted around the groove's middle, so that arcs up to a full circle have one for each place.
        middle = (grooves.along + 0.5 * grooves.length) / grooves.radius
        turn += 2 * np.pi * np.round((middle - turn) / (2 * np.pi))
        forward, left = turn * grooves.radius, grooves.radius - sign * np.hypot(forward, grooves.radius - left)
    return forward - grooves.along, left - grooves.across, grooves.angle + turn


def _surface(grooves, x, y):
    """Height (0 or less) and slopes along x and y of each groove at places, float32."""
    along, across, direction = coordinates(grooves, x, y)
    # Both ends rise over one width, or over half of a groove that is shorter than two.
    rise = np.minimum(grooves.width, grooves.length / 2)
    ramp = np.minimum(along, grooves.length - along) / rise
    is_inside = (np.abs(across) < grooves.width / 2) & (ramp > 0)
    phase = (2 * np.pi / grooves.width) * across
    shape = grooves.depth * is_inside
    profile = 0.5 * shape * (1 + np.cos(phase))
    height = -profile * np.minimum(ramp, 1)

    # The slope is minus the derivative.
    uphill = -shape * (np.pi / grooves.width) * np.sin(phase) * np.minimum(ramp, 1)
    forward = np.where(ramp < 1, profile / rise * np.sign(grooves.length / 2 - along), 0)
    cosine, sine = np.cos(direction), np.sin(direction)
    p, q = forward * cosine - uphill * sine, forward * sine + uphill * cosine
    return height.astype(np.float32), p.astype(np.float32), q.astype(np.float32)
