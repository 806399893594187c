"""Kinds of surface that a Glint BSDF may have: each is the microfacet lobe of one of Blender's nodes.

The node inside the group says which kind it is, as Blender's other nodes there say how the map is read. A kind has the
sockets of its node. Refractive indices of metals are the RGB values of the Physically Based database by Anton Palmqvist
(CC0); those of titanium are also the defaults of Blender's Metallic BSDF.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from .builder import Socket, add_node
from .map_choices import FACETS_NODE, SURFACE

COLOR = Socket(
    "Color", "NodeSocketColor", default=(1.0, 1.0, 1.0, 1.0), low=0.0, high=1.0, help="Reflectance of a facet",
    setting_help="Colour of the reflection",
)
BASE_COLOR = Socket(
    "Base Color", "NodeSocketColor", default=(0.617, 0.577, 0.540, 1.0), low=0.0, high=1.0,
    help="Reflectance of a facet met head-on",
)
EDGE_TINT = Socket(
    "Edge Tint", "NodeSocketColor", default=(0.695, 0.726, 0.770, 1.0), low=0.0, high=1.0,
    help="Tint of a facet met at 82 degrees", setting_help="Of a metal: tint where it is seen at 82 degrees",
)
IORS = Socket(
    "IOR", "NodeSocketVector", default=(2.757, 2.513, 2.231), low=0.0, high=100.0,
    help="Refractive index of red, green and blue light: the real part of the complex one",
    setting_help="Of a conductor: refractive index of red, green and blue; of a dielectric the first number",
)
EXTINCTION = Socket(
    "Extinction", "NodeSocketVector", default=(3.867, 3.404, 3.009), low=0.0, high=100.0,
    help="Extinction coefficient of red, green and blue light: the imaginary part of the complex refractive index",
    setting_help="Of a conductor: extinction coefficients of red, green and blue",
)
IOR = Socket(
    "IOR", "NodeSocketFloat", default=1.5, low=1.0, high=100.0, help="Refractive index: ice 1.31, water 1.33, mica 1.6",
)
SPECULAR_TINT = Socket(
    "Specular Tint", "NodeSocketColor", default=(1.0, 1.0, 1.0, 1.0), low=0.0, high=1.0,
    help="Tint of what a facet met head-on reflects",
)

BLACK = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class SurfaceKind:
    """A kind of surface.

    node: type of Blender's node; settings: its properties that make it this kind; values: of its inputs that no socket
    sets; sockets: {socket of the group: input of the OSL node}, each the input of Blender's node of the same name;
    color: the socket that a flake's colour multiplies, or None; distribution: the only one that the node has.
    """

    node: str
    sockets: dict[Socket, str]
    color: Socket | None
    settings: dict[str, str] = field(default_factory=dict)
    values: dict[str, object] = field(default_factory=dict)
    distribution: str = ""


# By the identifiers of the choice SURFACE, whose numbers are SURFACE_... of osl/facet.h.
KINDS = {
    "TINT": SurfaceKind("ShaderNodeBsdfAnisotropic", {COLOR: "Color"}, COLOR),
    "METAL": SurfaceKind(
        "ShaderNodeBsdfMetallic", {BASE_COLOR: "Color", EDGE_TINT: "EdgeTint"}, BASE_COLOR, {"fresnel_type": "F82"}),
    "CONDUCTOR": SurfaceKind(
        "ShaderNodeBsdfMetallic", {IORS: "IOR", EXTINCTION: "Extinction"}, None,
        {"fresnel_type": "PHYSICAL_CONDUCTOR"}),
    "DIELECTRIC": SurfaceKind(
        "ShaderNodeBsdfPrincipled", {IOR: "IOR", SPECULAR_TINT: "Color"}, SPECULAR_TINT,
        values={"Base Color": BLACK}, distribution="GGX"),
}


def surface_of(group) -> str:
    """Identifier of the kind of surface of a Glint BSDF group: what its node says; unknown nodes by their own name."""
    return node_surface(group.nodes[FACETS_NODE]) if FACETS_NODE in group.nodes else SURFACE.default


def node_surface(node) -> str:
    """Identifier of the kind of surface whose node `node` is, or the node's type in capitals."""
    for identifier, kind in KINDS.items():
        if node.bl_idname == kind.node and all(getattr(node, name) == value for name, value in kind.settings.items()):
            return identifier
    return node.bl_idname.upper()


def add_facets(group, surface: str, name: str) -> bpy.types.ShaderNode:
    """Add Blender's node of a kind of surface."""
    kind = KINDS[surface]
    return add_node(group, kind.node, name, **kind.settings, inputs=kind.values)


@dataclass(frozen=True)
class Metal:
    """Complex refractive index of a metal for red, green and blue light."""

    ior: tuple[float, float, float]
    extinction: tuple[float, float, float]

    @property
    def base_color(self) -> tuple[float, ...]:
        """Reflectance head-on: base colour of the kind METAL."""
        return tuple(conductor_reflectance(1.0, n, k) for n, k in zip(self.ior, self.extinction, strict=True))

    @property
    def edge_tint(self) -> tuple[float, ...]:
        """Reflectance at the cosine 1/7 (82 degrees) by that of Schlick's approximation: edge tint of the kind METAL.

        Kutz, Hasan, Edmondson: Novel aspects of the Adobe Standard Material, 2021 (F82-tint).
        """
        edges = []
        for n, k, head_on in zip(self.ior, self.extinction, self.base_color, strict=True):
            schlick = head_on + (1.0 - head_on) * (1.0 - 1.0 / 7.0) ** 5
            edges.append(min(conductor_reflectance(1.0 / 7.0, n, k) / schlick, 1.0))
        return tuple(edges)


def conductor_reflectance(cosine: float, n: float, k: float) -> float:
    """Unpolarised Fresnel reflectance of a conductor n + ik in air, at a cosine in 0..1 of the angle of incidence.

    Born and Wolf: Principles of Optics, section 14.2.
    """
    square = cosine * cosine
    difference = n * n - k * k - (1.0 - square)
    sum_of_squares = (difference * difference + 4.0 * n * n * k * k) ** 0.5
    a = max(0.5 * (sum_of_squares + difference), 0.0) ** 0.5
    across = (sum_of_squares + square - 2.0 * a * cosine) / (sum_of_squares + square + 2.0 * a * cosine)
    sine = 1.0 - square
    top = sum_of_squares * square + sine * sine
    along = across * (top - 2.0 * a * cosine * sine) / (top + 2.0 * a * cosine * sine)
    return 0.5 * (across + along)


METALS = {
    "Gold": Metal((0.18299, 0.42108, 1.3734), (3.4242, 2.3459, 1.7704)),
    "Silver": Metal((0.15943, 0.14512, 0.13547), (3.9291, 3.19, 2.3808)),
    "Copper": Metal((0.27105, 0.67693, 1.3164), (3.6092, 2.6248, 2.2921)),
    "Aluminium": Metal((1.3456, 0.96521, 0.61722), (7.4746, 6.3995, 5.3031)),
    "Chromium": Metal((3.1071, 3.1812, 2.323), (3.3314, 3.3291, 3.135)),
    "Titanium": Metal((2.757, 2.513, 2.231), (3.867, 3.404, 3.009)),
}
