"""Cycles' switch for Open Shading Language: Glint switches it on only where some glint has a light with a hint.

Open Shading Language makes all materials of a scene slower, also Blender's own nodes: decision 55.
"""

from __future__ import annotations

import bpy

from ..nodes.glint_bsdf import is_glint_group
from ..nodes.script_node import osl_available
from ..properties import STAMP, SWITCHED_ON

ENGINES = ("CYCLES", "BLENDER_EEVEE")  # which render glints
NO_OSL = "This Blender has no Open Shading Language: glints are rendered by nodes, with more noise."
ON_GPU = "On a GPU glints are rendered by nodes: right, and noisier than on the CPU."
ONE_FILE = "A UDIM set or an image sequence fits no table: its glints are rendered by nodes, with more noise."
NO_LIGHT = "No glint in view has a light worth looking for"
LEFT_OFF = f"{NO_LIGHT}: Open Shading Language is off, and Blender's own nodes render the same picture, faster."
LEFT_ON = f"{NO_LIGHT}: switch Open Shading Language off in the Render properties, and the same picture renders faster."


def runs_lobe(scene: bpy.types.Scene) -> bool:
    """Whether `scene` is set to render where the OSL lobe runs: in Cycles, on a CPU, whose shading points hold 64
    closures."""
    return osl_available() and scene.render.engine == ENGINES[0] and scene.cycles.device == "CPU"


def is_on(scene: bpy.types.Scene) -> bool:
    """Whether Cycles renders `scene` through Open Shading Language."""
    return osl_available() and hasattr(scene, "cycles") and bool(scene.cycles.shading_system)


def choose_shading_system(scene: bpy.types.Scene, *, is_needed: bool) -> bool:
    """Switch Open Shading Language on where `is_needed`, off again where it is not and only Glint had it on.

    Script nodes outside the glints count: Glint's textures need OSL, for all others the user's choice stays. Returns
    whether OSL is of no use to `scene`.
    """
    if not osl_available() or not hasattr(scene, "cycles"):
        return False
    scripts = _scripts_outside_glints()
    if is_needed or STAMP in scripts:
        _switch_on(scene)
        return False
    if not scripts and scene.pop(SWITCHED_ON, False) and scene.cycles.shading_system:
        scene.cycles.shading_system = False
    return not scripts


def _switch_on(scene: bpy.types.Scene) -> None:
    if not scene.cycles.shading_system:
        scene.cycles.shading_system = True
        scene[SWITCHED_ON] = True


def _scripts_outside_glints() -> set[str]:
    """Of Script nodes outside Glint BSDFs, in materials, worlds and lights: STAMP for Glint's own, "" for others'."""
    owners = [*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None]
    found, seen = set(), set()
    while trees:
        tree = trees.pop()
        seen.add(tree)
        if any(node.bl_idname == "ShaderNodeScript" for node in tree.nodes):
            found.add(STAMP if STAMP in tree else "")
        inner = {node.node_tree for node in tree.nodes if node.bl_idname == "ShaderNodeGroup"} - {None}
        trees += [each for each in inner - seen if not is_glint_group(each)]
    return found
