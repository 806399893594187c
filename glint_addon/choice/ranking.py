"""Which lights a material looks for: those whose glints would be noisiest without, for the whole animation at once.

Nothing here depends on the current frame, so that animation does not pop. In doubt a light is looked for.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from math import hypot, inf

from ..lights.hint import Hint
from ..lights.softness import TOO_SOFT
from ..nodes.glint_lights import HINT_COUNT

# Lights that together make no more than this part of the noise get no hint, because all hints share the closures:
# decision 40.
NEGLIGIBLE = 0.001
# Most elements of the map that a sample visits: osl/query.h. Lights without a hint make noise that visits do not
# reduce: more visits than leave the hinted lights ENOUGH times less variance, or FEWEST_VISITS, are wasted:
# decision 41.
LARGEST_VISIT = 4096
ENOUGH = 10.0
FEWEST_VISITS = 16

TOO_MANY = f"dimmer than the {HINT_COUNT} strongest lights: noisy, not wrong"
TOO_DIM = "so dim beside the others that the noise does not show"
OUT_OF_REACH = "no facet of the map can mirror it to a camera"
MISSES = "shines past every object of the material, which are outside its cone or behind it"


@dataclass(frozen=True)
class Choice:
    """hints: those a material looks for, by name; left: the others as (name, reason in words); visits: elements of the
    map that a sample should visit at most."""

    hints: tuple[Hint, ...]
    left: tuple[tuple[str, str], ...]
    visits: int = LARGEST_VISIT


def choose(
    found: list[Hint],
    values: list[float],
    reached: Collection[Hint] | None = None,
    soft: Iterable[Hint] = frozenset(),
    *,
    negligible: float = NEGLIGIBLE,
) -> Choice:
    """The hints to look for of those `found`, in their order, by their `values` from `noise_in_remainder`.

    reached: set of those that can be mirrored at all, None: all; soft: set of those that look too large to need it;
    negligible: part of the noise that may be left out.
    """
    worth = dict(zip(found, values, strict=True))
    reasons = {hint: MISSES for hint in found if worth[hint] < 0.0}
    reasons |= dict.fromkeys(soft, TOO_SOFT)
    reasons |= {hint: OUT_OF_REACH for hint in found if reached is not None and hint not in reached}
    ranked = sorted((hint for hint in found if hint not in reasons), key=lambda hint: (-worth[hint], hint.order))
    reasons |= dict.fromkeys(ranked[HINT_COUNT:], TOO_MANY)

    # Leave out the dimmest of the rest, as many as matter little together: the squares of their noise add up. A light
    # that is dark at all frames which were looked at stays, because it may shine at others.
    total = hypot(*(worth[hint] for hint in ranked))
    chance = hypot(*(worth[hint] for hint in ranked[HINT_COUNT:]))
    bright = [hint for hint in ranked if worth[hint] > 0.0]
    for place, hint in reversed(list(enumerate(bright))):
        if hypot(*(worth[other] for other in bright[place:])) > negligible * total or total == inf:
            break
        reasons.setdefault(hint, TOO_DIM)
    return Choice(
        tuple(hint for hint in found if hint not in reasons),
        tuple((hint.name, reasons[hint]) for hint in found if hint in reasons),
        _visits((chance / total) ** 2 if 0.0 < total < inf else 0.0),
    )


def _visits(chance: float) -> int:
    """Elements to visit where lights without a hint make the part `chance`, 0..1, of the variance.

    The rest of the variance is divided by their number.
    """
    return LARGEST_VISIT if chance * LARGEST_VISIT <= ENOUGH else max(round(ENOUGH / chance), FEWEST_VISITS)
