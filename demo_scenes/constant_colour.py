"""Seed figure: one constant colour on the wall, another on the sphere."""

from __future__ import annotations

from . import stage

NAME = "constant_colour"
TITLE = "Constant colours on wall and sphere"
SPP = 32
DENOISE = True
WALL = (0.12, 0.3, 0.6)
SPHERE = (0.85, 0.4, 0.08)


def build(scene):
    """The room with a blue back wall and an orange sphere on the floor."""
    stage.add_room(scene, stage.diffuse_material("Wall", WALL))
    stage.add_sphere(scene, stage.diffuse_material("Sphere", SPHERE))


def panels(rendered):
    """(label, pixels) pairs; rendered(**options) renders `build(scene, **options)`."""
    return [("Diffuse, one colour each", rendered())]
