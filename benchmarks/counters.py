"""What the glint shader did for each pixel: its outputs Counters and Costs, shown in two passes of one render.

The counts are exact and the same on every machine; an output that is not linked costs a render nothing.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from glint_addon import paths
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_tables import SCRIPT_NODE

from .passes import rendered_layer


def _names(file, prefix):
    """Names behind the numbers that a header defines: #define MODE_ALL 3 gives {3: "ALL"}."""
    lines = re.findall(rf"^#define {prefix}(\w+) (\d+)\b", paths.shader_file(file).read_text(encoding="utf-8"), re.M)
    return {int(value): name for name, value in lines}


MODES = _names("counters.h", "MODE_")  # how the query went, PLAIN: there was none
REASONS = _names("counters.h", "LEFT_")  # why a sample left early, NOT: it did not


@dataclass(frozen=True)
class Counts:
    """Counts of one sample for each pixel, arrays (height, width), row 0 at the bottom; zero where `seen` is False.

    seen: whether the pixel shows the material; visited: texels or patches looked at; closures: returned to Cycles;
    fetches: texture() calls into the table; mode: key of MODES; reason: key of REASONS; hints: lights asked about.
    """

    seen: np.ndarray
    visited: np.ndarray
    closures: np.ndarray
    fetches: np.ndarray
    mode: np.ndarray
    reason: np.ndarray
    hints: np.ndarray

    @property
    def share_left_early(self) -> float:
        """Share of the material's samples that made no query, 0..1."""
        return float(self.left_early[self.seen].mean())

    @property
    def left_early(self) -> np.ndarray:
        """Whether each sample left before the query, (height, width) bool."""
        return self.seen & (self.reason != 0)

    def summary(self) -> dict:
        """Plain numbers for a report: means over the material's samples, in all, by mode, and shares by reason."""
        return {
            "samples": int(self.seen.sum()),
            "share_left_early": self.share_left_early,
            **self._means(self.seen),
            "by_mode": {
                name: {"share": float((self.mode[self.seen] == mode).mean()), **self._means(self._in_mode(mode))}
                for mode, name in MODES.items()
                if self._in_mode(mode).any()
            },
            "left_because": {
                name: float((self.reason[self.seen] == reason).mean())
                for reason, name in REASONS.items()
                if (self.reason[self.seen] == reason).any()
            },
        }

    def _in_mode(self, mode):
        return self.seen & (self.mode == mode)

    def _means(self, chosen):
        return {name: float(getattr(self, name)[chosen].mean()) for name in ("visited", "closures", "fetches", "hints")}


def counters(scene, material, samples=1) -> Counts:
    """Counts of the camera rays that hit `material` in `scene`, prepared; the scene is as before afterwards.

    One sample a pixel is looked at, the first of those of the scene's seed, with the footprint that it has in a render
    of `samples` samples. Other materials that share the map's node group count as the same. Raises ValueError if the
    material has no glints through OSL, or the camera sees none of it.
    """
    groups = [group for group in glint_groups(material) if SCRIPT_NODE in group.nodes]
    if not groups:
        raise ValueError(f'Material "{material.name}" has no glint shader to count in.')
    with _dark(scene), _samples(groups, samples):
        first, second = _shown(scene, groups)
    visited, closures, mode = np.moveaxis(first, 2, 0)
    fetches, reason, hints = np.moveaxis(second, 2, 0)
    seen = closures + fetches + reason > 0
    if not seen.any():
        raise ValueError(f'The camera of scene "{scene.name}" does not see material "{material.name}".')
    return Counts(seen, visited, closures, fetches, mode, reason, hints)


def show(group, output, *, surface="ShaderNodeEmission", scale=1.0, ray=None):
    """Let a Glint BSDF group be an emission, or another `surface`, of its shader's `output` times `scale`, for good.

    ray: output of the Light Path node by whose value an emission is multiplied, such as "Is Camera Ray".
    """
    group.links.new(_coloured(group, output, surface, scale=scale, ray=ray), _surface_socket(group))


def _coloured(group, output, surface, *, scale=1.0, ray=None):
    """Socket of a new shader node `surface` in a Glint BSDF group, in the colour of `show`."""
    tree = group.nodes
    shader = tree.new(surface)
    scaled = tree.new("ShaderNodeVectorMath")
    scaled.operation = "SCALE"
    scaled.inputs["Scale"].default_value = scale
    group.links.new(tree[SCRIPT_NODE].outputs[output], scaled.inputs[0])
    group.links.new(scaled.outputs["Vector"], shader.inputs["Color"])
    if ray is not None:
        group.links.new(tree.new("ShaderNodeLightPath").outputs[ray], shader.inputs["Strength"])
    return shader.outputs[0]


def _surface_socket(group):
    return next(node for node in group.nodes if node.bl_idname == "NodeGroupOutput").inputs["BSDF"]


def _shown(scene, groups):
    """Pictures (height, width, 3), float64, of Counters and Costs of the groups' shaders, seen by camera rays alone."""
    layer = next(layer for layer in scene.view_layers if layer.use)
    wanted = layer.use_pass_emit, layer.use_pass_diffuse_color
    before = {group: (set(group.nodes), _surface_socket(group).links[0].from_socket) for group in groups}
    try:
        layer.use_pass_emit = layer.use_pass_diffuse_color = True
        for group in groups:
            _show_both(group)
        passes = rendered_layer(scene)
        return [passes[name].astype(np.float64) for name in ("Emission", "Diffuse Color")]
    finally:
        layer.use_pass_emit, layer.use_pass_diffuse_color = wanted
        for group, (nodes, surface) in before.items():
            for node in set(group.nodes) - nodes:
                group.nodes.remove(node)
            group.links.new(surface, _surface_socket(group))


def _show_both(group):
    """Let a Glint BSDF group emit its Counters and be diffuse in the colour of its Costs.

    A second render would compile the shader again, which takes longer than all samples. An AOV would not do: a Mix
    Shader between two lobes weights closures alone.
    """
    both = group.nodes.new("ShaderNodeAddShader")
    group.links.new(_coloured(group, "Counters", "ShaderNodeEmission", ray="Is Camera Ray"), both.inputs[0])
    group.links.new(_coloured(group, "Costs", "ShaderNodeBsdfDiffuse"), both.inputs[1])
    group.links.new(both.outputs[0], _surface_socket(group))


@contextmanager
def _dark(scene):
    """One sample a pixel and no light of the scene's own, so that a picture holds nothing but counts."""
    # Black, not switched off: a light without energy is no hint.
    lights = {lamp.data: tuple(lamp.data.color) for lamp in scene.objects if lamp.type == "LIGHT"}
    world, spp = scene.world, scene.cycles.samples
    mistrusted = scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising
    try:
        for light in lights:
            light.color = (0.0, 0.0, 0.0)
        scene.world = None
        scene.cycles.samples = 1
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        yield
    finally:
        for light, color in lights.items():
            light.color = color
        scene.world, scene.cycles.samples = world, spp
        scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = mistrusted


@contextmanager
def _samples(groups, samples):
    """Tell the shaders that a pixel has `samples` samples, whatever the render has."""
    sockets = [group.nodes[SCRIPT_NODE].inputs["Samples"] for group in groups]
    sources = [socket.links[0].from_socket for socket in sockets]
    try:
        for group, socket in zip(groups, sockets, strict=True):
            group.links.remove(socket.links[0])
            socket.default_value = samples
        bpy.context.view_layer.update()
        yield
    finally:
        for group, socket, source in zip(groups, sockets, sources, strict=True):
            group.links.new(source, socket)
