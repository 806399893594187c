"""Variation of a map that repeats: each tile of UVs shows another cut of the map, so that no repeat is like the next.

A cut is a move of the map within its tile, by whole texels that follow from the tile's number. This is the twin by
nodes of osl/tiles.h, where the lobe makes the same cuts.
"""

from __future__ import annotations

import bpy

from .builder import Socket, add_math, add_node
from .map_choices import SHUFFLE_NODE, VARIATION
from .places import add_hidden_group

VERSION = 1
NAME = f".Glint Shuffle {VERSION}"
# The node that moves the coordinates of the places of a Glint BSDF group; SHUFFLE_NODE does so for all others.
PLACES_SHUFFLE = "Places Shuffle"
NODES = {"SHUFFLE": SHUFFLE_NODE}  # which node says which variation; without any of them repeats are alike
# As TILES_PRIME in osl/tiles.h: products of two remainders are whole numbers below 2^24, which float32 has exactly.
PRIME = 4093.0


def variation_of(group) -> str:
    """Which value of the choice VARIATION a Glint BSDF group has: its nodes say it."""
    return next((value for value, node in NODES.items() if node in group.nodes), VARIATION.default)


def is_whole(group) -> bool:
    """Whether the places of a Glint BSDF group vary as its own nodes do: a user may have deleted one of the two."""
    return (SHUFFLE_NODE in group.nodes) == (PLACES_SHUFFLE in group.nodes)


def add_shuffle(group, coordinates: bpy.types.NodeSocket, name: str) -> bpy.types.NodeSocket:
    """Add the node `name` that moves texture coordinates by the cut of their tile; returns its output."""
    node = add_hidden_group(group, NAME, name, {"Coordinates": coordinates}, _FORMULAS)
    return node.outputs["Coordinates"]


def follow_size(group, size: tuple[int, int]):
    """Let the cuts of a Glint BSDF group, if it has any, be whole texels of a map of `size` (width, height)."""
    for name in (SHUFFLE_NODE, PLACES_SHUFFLE):
        node = group.nodes.get(name)
        if node is not None and tuple(node.inputs["Size"].default_value) != (*size, 0.0):
            node.inputs["Size"].default_value = (*size, 0.0)


def _shuffled(group, given):
    """Coordinates in the first tile, moved by the cut of the tile that they lie in."""
    inside, number = [], []
    parts = _parts(group, given["Coordinates"])
    for part in parts:
        tile = add_math(group, "FLOOR", part)
        inside.append(add_math(group, "SUBTRACT", part, tile))
        positive = add_math(group, "ADD", add_math(group, "MODULO", tile, PRIME), PRIME)
        number.append(add_math(group, "MODULO", positive, PRIME))
    column = _stirred(group, add_math(group, "ADD", number[0], 1013.0))
    tile = _stirred(group, add_math(group, "ADD", column, number[1]))
    first = _stirred(group, add_math(group, "ADD", tile, add_math(group, "MULTIPLY_ADD", number[0], 3.0, 499.0)))
    second = _stirred(group, add_math(group, "ADD", first, add_math(group, "ADD", column, 1.0)))
    moved = add_node(group, "ShaderNodeCombineXYZ")
    sizes = _parts(group, given["Size"])
    for socket, place, stirred, size in zip(moved.inputs, inside, (first, second), sizes, strict=False):
        texels = add_math(group, "FLOOR", add_math(group, "MULTIPLY", stirred, add_math(group, "DIVIDE", size, PRIME)))
        group.links.new(add_math(group, "ADD", place, add_math(group, "DIVIDE", texels, size)), socket)
    return {"Coordinates": moved.outputs["Vector"]}


def _parts(group, vector):
    """The first two numbers of a vector."""
    node = add_node(group, "ShaderNodeSeparateXYZ")
    group.links.new(vector, node.inputs[0])
    return node.outputs["X"], node.outputs["Y"]


def _stirred(group, number):
    """The fifth power modulo PRIME: a permutation of the remainders; see osl/tiles.h."""
    remainder = add_math(group, "MODULO", number, PRIME)
    square = _product(group, remainder, remainder)
    return _product(group, _product(group, square, square), remainder)


def _product(group, one, other):
    return add_math(group, "MODULO", add_math(group, "MULTIPLY", one, other), PRIME)


_FORMULAS = (
    (Socket("Coordinates", "NodeSocketVector"),),
    (Socket("Coordinates", "NodeSocketVector"), Socket("Size", "NodeSocketVector", default=(1.0, 1.0, 0.0))),
    _shuffled,
)
