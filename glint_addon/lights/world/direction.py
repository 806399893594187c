"""From directions in a world's texture to directions in world space: its Mapping nodes backwards."""

from __future__ import annotations

import bpy

from ..node_numbers import Groups, number, source
from .textures import Texture
from .trigonometry import Angles, Sum, negative, turned

# A shift or a stretch below it moves a spot by less than a hundredth of a sun's width.
NOT_AT_ALL = 1e-4

# Directions that depend on neither camera nor object.
PLAIN_COORDINATES = {("ShaderNodeTexCoord", "Generated"), ("ShaderNodeNewGeometry", "Position")}


class UnreadableMappingError(Exception):
    """A texture's coordinates cannot be followed; the text says why."""


def in_world(world: bpy.types.World, texture: Texture, vector: list[Sum], angles: Angles) -> list[Sum]:
    """The direction in world space in which `texture` shows its point `vector`, a unit direction in its own space.

    Raises UnreadableMappingError.
    """
    own = texture.node.texture_mapping  # of files from before Blender 2.5; no panel shows it
    if any(own.translation) or any(own.rotation) or tuple(own.scale) != (1, 1, 1):
        raise UnreadableMappingError(f'"{texture.node.name}" has a texture mapping of its own')
    socket, groups = texture.node.inputs.get("Vector"), texture.groups
    if socket is None:
        return vector  # a sky with a sun, whose hidden socket Cycles ignores too
    while True:
        end, groups = source(socket, groups)
        if end is not None and (not end.is_output or (end.node.bl_idname, end.name) in PLAIN_COORDINATES):
            return vector
        if end is None or end.node.bl_idname != "ShaderNodeMapping":
            found = f'"{end.node.name}"' if end else "nowhere"
            raise UnreadableMappingError(f'the coordinates of "{texture.node.name}" come from {found}')
        vector = _unmapped(world, end.node, groups, vector, angles)
        socket = end.node.inputs["Vector"]


def _unmapped(
    world: bpy.types.World, mapping: bpy.types.ShaderNode, groups: Groups, vector: list[Sum], angles: Angles
) -> list[Sum]:
    """The vector from which a Mapping node makes `vector`.

    Cycles (kernel/svm/mapping_util.h), with a rotation R and a scale S that at most mirrors: Point, Vector and Normal
    give R S v, Texture S R^-1 v.
    """
    signs = _signs_of_scale(world, mapping, groups)
    rotation = []
    for axis in range(3):
        angle = number(world, mapping.inputs["Rotation"], groups, axis)
        if angle is None:
            raise UnreadableMappingError(f'the rotation of "{mapping.name}" comes from nodes')
        rotation.append(angle)

    # R turns about X, then Y, then Z.
    if mapping.vector_type == "TEXTURE":
        vector = _mirrored(vector, signs)
        for axis in (0, 1, 2):
            vector = turned(vector, axis, angles.cos_sin(rotation[axis]))
        return vector
    for axis in (2, 1, 0):
        cosine, sine = angles.cos_sin(rotation[axis])
        vector = turned(vector, axis, (cosine, negative(sine)))
    return _mirrored(vector, signs)


def _signs_of_scale(world: bpy.types.World, mapping: bpy.types.ShaderNode, groups: Groups) -> list[bool]:
    """Which axes the scale of a Mapping node mirrors; UnreadableMappingError if it stretches or shifts directions."""
    still: dict[str, list[float]] = {"Location": [], "Scale": []}
    for name, values in still.items():
        for axis in range(3) if name in mapping.inputs else ():  # a Mapping of vectors has no location
            part = number(world, mapping.inputs[name], groups, axis)
            if part is None or part.moves:
                raise UnreadableMappingError(f'the {name.lower()} of "{mapping.name}" moves or comes from nodes')
            values.append(part.value)
    if any(abs(value) > NOT_AT_ALL for value in still["Location"]):
        raise UnreadableMappingError(f'"{mapping.name}" shifts its picture')
    sizes = [abs(value) for value in still["Scale"]]
    if max(sizes) - min(sizes) > NOT_AT_ALL * max(sizes) or max(sizes) == 0:
        raise UnreadableMappingError(f'"{mapping.name}" stretches its picture')
    return [value < 0 for value in still["Scale"]]


def _mirrored(vector: list[Sum], is_negative: list[bool]) -> list[Sum]:
    return [negative(entry) if sign else entry for entry, sign in zip(vector, is_negative, strict=True)]
