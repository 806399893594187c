"""Vectors turned by angles that may be animated: present numbers, and driver expressions without Python.

A sum {("cos(a0)", "sin(a1)"): 0.5, (): 2} is 0.5 cos(a0) sin(a1) + 2. A vector is a list of three sums.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, prod, sin

from ...nodes.driven import Driven, Variable
from ..node_numbers import Number, read

Sum = dict[tuple[str, ...], float]

DIGITS = 9  # of coefficients after the point; sockets hold seven
NOTHING = 10.0**-DIGITS
LONGEST_EXPRESSION = 255  # characters: Blender cuts a longer expression of a driver


class Angles:
    """The angles of one calculation: their names in drivers, and their present sines and cosines."""

    def __init__(self) -> None:
        self._variables: list[Variable] = []
        self._values: dict[str, float] = {}

    def cos_sin(self, angle: Number) -> tuple[Sum, Sum]:
        """Cosine and sine of an angle [rad]: numbers, or factors where the angle is animated."""
        if not angle.moves:
            return {(): cos(angle.value)}, {(): sin(angle.value)}
        name = f"a{len(self._variables)}"
        self._variables.append(read(name, angle))
        factors = f"cos({name})", f"sin({name})"
        self._values |= dict(zip(factors, (cos(angle.value), sin(angle.value)), strict=True))
        return {(factors[0],): 1.0}, {(factors[1],): 1.0}

    def now(self, vector: list[Sum]) -> tuple[float, ...]:
        """The present numbers of a vector."""
        return tuple(
            sum(part * prod(self._values[factor] for factor in factors) for factors, part in entry.items())
            for entry in vector
        )

    def over_time(self, vector: list[Sum]) -> tuple[Driven | float, ...] | None:
        """The numbers of a vector, as drivers where they are animated; None if Blender would cut an expression."""
        words = [expression(entry) for entry in vector]
        if max(map(len, words)) > LONGEST_EXPRESSION:
            return None
        used = [tuple(entry for entry in self._variables if f"({entry.name})" in text) for text in words]
        return tuple(Driven(text, variables) if variables else number
                     for text, variables, number in zip(words, used, self.now(vector), strict=True))


def constant(values: Iterable[float]) -> list[Sum]:
    """A vector of numbers."""
    return [{(): float(value)} for value in values]


def turned(vector: list[Sum], axis: int, angle: tuple[Sum, Sum]) -> list[Sum]:
    """A vector turned about `axis` (0 to 2) by an angle given as cosine and sine."""
    turned_cos, turned_sin = angle
    after, last = (axis + 1) % 3, (axis + 2) % 3
    result = list(vector)
    result[after] = added(multiplied(turned_cos, vector[after]), negative(multiplied(turned_sin, vector[last])))
    result[last] = added(multiplied(turned_sin, vector[after]), multiplied(turned_cos, vector[last]))
    return result


def added(first: Sum, second: Sum) -> Sum:
    """The sum of two sums."""
    return {factors: first.get(factors, 0.0) + second.get(factors, 0.0) for factors in {**first, **second}}


def negative(one: Sum) -> Sum:
    """A sum with the other sign."""
    return {factors: -part for factors, part in one.items()}


def multiplied(first: Sum, second: Sum) -> Sum:
    """The product of two sums."""
    result: Sum = {}
    for factors, part in first.items():
        for others, other in second.items():
            both = tuple(sorted(factors + others))
            result[both] = result.get(both, 0.0) + part * other
    return result


def expression(one: Sum) -> str:
    """A sum as an expression of a driver."""
    terms = ["*".join((f"{part:.{DIGITS}f}", *factors)) for factors, part in one.items() if abs(part) > NOTHING]
    return " + ".join(terms) or "0"
