"""Seed figure: a checker sphere whose colours bleed onto the white floor and walls."""

from __future__ import annotations

from glint_addon.nodes import GROUPS

from . import stage

NAME = "checker_sphere"
TITLE = "Checker sphere and its bleeding"
SPP = 48
DENOISE = True
COLORS = {"Color 1": (0.9, 0.03, 0.02), "Color 2": (0.9, 0.35, 0.02)}
SCALE = 18.0  # radians a metre: cells of 17 cm


def build(scene, bounces=4):
    """The white room with the checker sphere beside the left wall; `bounces` of diffuse light, 0 is direct light."""
    stage.add_room(scene, stage.diffuse_material("Wall", stage.WHITE))
    stage.add_sphere(scene, checker_material(), centre=(-0.3, 0.2, 0.62))
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces


def checker_material():
    """Diffuse, coloured by the node group Glint Checker."""
    material = stage.diffuse_material("Checker")
    tree = material.node_tree
    checker = tree.nodes.new("ShaderNodeGroup")
    checker.node_tree = GROUPS["Glint Checker"]()
    for name, color in COLORS.items():
        checker.inputs[name].default_value = (*color, 1.0)
    checker.inputs["Scale"].default_value = SCALE
    tree.links.new(checker.outputs["Color"], tree.nodes["Diffuse"].inputs["Color"])
    return material


def panels(rendered):
    """(label, pixels) pairs; rendered(**options) renders `build(scene, **options)`."""
    whole, direct = rendered(), rendered(bounces=0)
    return [
        ("All light", whole),
        ("Direct light only", direct),
        ("Bounced light only: red on wall and floor", whole - direct),
    ]
