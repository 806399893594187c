"""World matrices in driver expressions: axes and middle of a light, also of one that a collection instance shows.

Drivers read the elements of `matrix_world` as properties, so that parents, constraints, shear and mirroring are in it,
and the product of two matrices is an expression that Blender evaluates without Python.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy

from ..nodes.driven import Driven, Variable

ROWS = (0, 1, 2)
# Elements by row and column: l of the light's own matrix, e of that of the empty which instances its collection.
ELEMENT = re.compile(r"\b([le])(\d)(\d)\b")


@dataclass(frozen=True)
class DrivenMatrix:
    """The world matrix of `object`, or of the copy of it that `instancer` shows of the collection which holds it."""

    object: bpy.types.Object
    instancer: bpy.types.Object | None = None

    def point(self, local: Sequence[float]) -> tuple[Driven, Driven, Driven]:
        """World position [m] of a point in the object's own coordinates."""
        own = [_sum([f"l{row}3"] + [_times(f"l{row}{k}", local[k]) for k in ROWS]) for row in ROWS]
        if self.instancer is None:
            x, y, z = map(self.driven, own)
            return x, y, z
        # A collection is shown with its instance offset at the empty's origin.
        offset = self.instancer.instance_collection.instance_offset
        inner = [_sum([own[k], _number(-offset[k])]) for k in ROWS]
        products = ("+".join(f"e{row}{k}*({inner[k]})" for k in ROWS) for row in ROWS)
        x, y, z = (self.driven(f"e{row}3+{product}") for row, product in enumerate(products))
        return x, y, z

    def z_axis(self) -> tuple[Driven, Driven, Driven]:
        """Unit vector along the object's Z axis, in world space."""
        length = f"max(sqrt({self.squared_length(2)}), 1e-30)"
        x, y, z = (self.driven(f"({self._element(row, 2)})/{length}") for row in ROWS)
        return x, y, z

    def squared_length(self, column: int) -> str:
        """Expression for the squared length of an axis: of the object's scale along it, without shear."""
        return _squares([self._element(row, column) for row in ROWS])

    def largest_scale(self) -> str:
        """Expression for the largest scale; of an instance the product of both largest, which may be too large."""
        names = ["l"] if self.instancer is None else ["e", "l"]
        squares = ([_squares([f"{name}{row}{column}" for row in ROWS]) for column in ROWS] for name in names)
        return "*".join(f"sqrt(max({','.join(columns)}))" for columns in squares)

    def driven(self, expression: str, *variables: Variable) -> Driven:
        """The number that `expression` computes from matrix elements and `variables`."""
        things = {"l": self.object, "e": self.instancer}
        found = sorted(set(ELEMENT.findall(expression)))
        # Blender counts columns first.
        elements = (object_property(f"{name}{row}{column}", things[name], f"matrix_world[{column}][{row}]")
                    for name, row, column in found)
        return Driven(expression, (*variables, *elements))

    def _element(self, row: int, column: int) -> str:
        if self.instancer is None:
            return f"l{row}{column}"
        return "+".join(f"e{row}{k}*l{k}{column}" for k in ROWS)


def object_property(name: str, thing: bpy.types.Object | None, path: str) -> Variable:
    """A driver's variable `name` that reads a property of an object, or of its data by way of the object."""
    return Variable(name, "SINGLE_PROP", thing, path)


def _squares(terms: Iterable[str]) -> str:
    return "+".join(f"{term}*{term}" if ELEMENT.fullmatch(term) else f"pow({term},2)" for term in terms)


def _times(name: str, factor: float) -> str:
    return f"{name}*{_number(factor)}" if factor else ""


def _number(value: float) -> str:
    """Seven digits are those of a float; longer ones would not fit the 255 characters of an expression."""
    return f"{value:.7g}" if value else ""


def _sum(terms: Iterable[str]) -> str:
    return "+".join(term for term in terms if term)
