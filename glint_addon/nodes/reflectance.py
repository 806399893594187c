"""What facets of each kind of surface reflect, as a colour of a Glossy BSDF, where glints are made by nodes alone.

Only the Glossy BSDF takes a weight above 1, as chosen places need it. Its colour is the reflectance at the angle
between view and the half vectors of the lights that are looked for, which the chosen normals mirror.
"""

from __future__ import annotations

import bpy

from .builder import Socket, add_math, add_mix, add_node, feed
from .places import add_hidden_group

VERSION = 1
# Cosine of 82 degrees, where the edge tint is that of a metal.
EDGE = 1.0 / 7.0


def add_reflectance(group, surface: str, cosine, inputs: dict[str, bpy.types.NodeSocket]) -> bpy.types.NodeSocket:
    """Colour of a Glossy BSDF that is as bright as a facet of a kind of surface where the cosine between half vector
    and view is `cosine`, a socket.

    inputs: what the inputs of Blender's node for that kind have, by name.
    """
    if surface == "TINT":
        return inputs["Color"]
    sockets, formula = _FORMULAS[surface]
    name = f".Glint Reflectance {surface.title()} {VERSION}"
    given = {socket.name: inputs[socket.name] for socket in sockets}
    formulas = ((Socket("Color", "NodeSocketColor"),), (*sockets, Socket("Cosine", "NodeSocketFloat")), formula)
    return add_hidden_group(group, name, "", {**given, "Cosine": cosine}, formulas).outputs["Color"]


def _metal(group, given):
    """Cycles' F82-tint; Kutz, Hasan, Edmondson: Novel aspects of the Adobe Standard Material, 2021."""
    cosine = given["Cosine"]
    away = add_math(group, "SUBTRACT", 1.0, cosine)
    above = _vector(group, "MAXIMUM", given["Base Color"], (0.0, 0.0, 0.0))
    head_on = _vector(group, "MINIMUM", above, (1.0, 1.0, 1.0))
    rise = add_math(group, "POWER", away, 5.0)
    schlick = _towards_one(group, head_on, rise)
    at_edge = _towards_one(group, head_on, (1.0 - EDGE) ** 5)
    dip = add_math(group, "MULTIPLY", add_math(group, "MULTIPLY", rise, away),
                   add_math(group, "MULTIPLY", cosine, 1.0 / (EDGE * (1.0 - EDGE) ** 6)))
    darker = _vector(group, "MULTIPLY", at_edge, _vector(group, "SUBTRACT", (1.0, 1.0, 1.0), given["Edge Tint"]))
    reflected = _vector(group, "SUBTRACT", schlick, add_math(group, "SCALE", darker, dip, vector=True))
    return {"Color": _vector(group, "MAXIMUM", reflected, (0.0, 0.0, 0.0))}


def _conductor(group, given):
    """Fresnel reflectance at a complex refractive index; Born and Wolf: Principles of Optics, section 14.2."""
    cosine = given["Cosine"]
    square = _all(group, add_math(group, "MULTIPLY", cosine, cosine))
    sine = _vector(group, "SUBTRACT", (1.0, 1.0, 1.0), square)
    n2 = _vector(group, "MULTIPLY", given["IOR"], given["IOR"])
    k2 = _vector(group, "MULTIPLY", given["Extinction"], given["Extinction"])
    difference = _vector(group, "SUBTRACT", _vector(group, "SUBTRACT", n2, k2), sine)
    product = _vector(group, "SCALE", _vector(group, "MULTIPLY", n2, k2), 4.0)
    total = _root(group, _vector(group, "ADD", _vector(group, "MULTIPLY", difference, difference), product))
    a = _root(group, _vector(group, "SCALE", _vector(group, "ADD", total, difference), 0.5))
    twice = add_math(group, "SCALE", a, add_math(group, "MULTIPLY", cosine, 2.0), vector=True)
    upper = _vector(group, "ADD", total, square)
    across = _vector(group, "DIVIDE", _vector(group, "SUBTRACT", upper, twice), _vector(group, "ADD", upper, twice))
    middle = _vector(group, "ADD", _vector(group, "MULTIPLY", total, square), _vector(group, "MULTIPLY", sine, sine))
    shift = _vector(group, "MULTIPLY", twice, sine)
    ratio = _vector(group, "DIVIDE", _vector(group, "SUBTRACT", middle, shift), _vector(group, "ADD", middle, shift))
    both = _vector(group, "MULTIPLY", across, _vector(group, "ADD", ratio, (1.0, 1.0, 1.0)))
    return {"Color": _vector(group, "SCALE", both, 0.5)}


def _dielectric(group, given):
    """Real Fresnel between the reflectance head-on, which is tinted, and 1, as Principled BSDF has it.

    Cook, Torrance: A Reflectance Model for Computer Graphics, SIGGRAPH 1981.
    """
    def number(operation, *operands):
        return add_math(group, operation, *operands)

    cosine = given["Cosine"]
    inside = number("SQRT", number("ADD", number("SUBTRACT", number("MULTIPLY", given["IOR"], given["IOR"]), 1.0),
                                   number("MULTIPLY", cosine, cosine)))
    less, more = number("SUBTRACT", inside, cosine), number("ADD", inside, cosine)
    across = number("POWER", number("DIVIDE", less, more), 2.0)
    ratio = number("DIVIDE", number("SUBTRACT", number("MULTIPLY", cosine, more), 1.0),
                   number("ADD", number("MULTIPLY", cosine, less), 1.0))
    both = number("MULTIPLY", number("MULTIPLY", across, 0.5), number("ADD", 1.0, number("MULTIPLY", ratio, ratio)))
    root = add_math(group, "DIVIDE", add_math(group, "SUBTRACT", given["IOR"], 1.0),
                    add_math(group, "ADD", given["IOR"], 1.0))
    head_on = add_math(group, "MULTIPLY", root, root)
    share = add_math(group, "DIVIDE", add_math(group, "SUBTRACT", both, head_on),
                     add_math(group, "SUBTRACT", 1.0, head_on))
    tinted = add_math(group, "SCALE", given["Specular Tint"], head_on, vector=True)
    return {"Color": add_mix(group, "VECTOR", share, tinted, (1.0, 1.0, 1.0), "Fresnel")}


def _color(name):
    return Socket(name, "NodeSocketColor")


_FORMULAS = {
    "METAL": ((_color("Base Color"), _color("Edge Tint")), _metal),
    "CONDUCTOR": ((Socket("IOR", "NodeSocketVector"), Socket("Extinction", "NodeSocketVector")), _conductor),
    "DIELECTRIC": ((Socket("IOR", "NodeSocketFloat"), _color("Specular Tint")), _dielectric),
}


def _vector(group, operation, *operands):
    return add_math(group, operation, *operands, vector=True)


def _root(group, values):
    """Square roots of a vector's numbers, which are 0 at least."""
    return _vector(group, "POWER", _vector(group, "MAXIMUM", values, (0.0, 0.0, 0.0)), (0.5, 0.5, 0.5))


def _all(group, number):
    """A vector of three times the same number."""
    node = add_node(group, "ShaderNodeCombineXYZ")
    for socket in node.inputs:
        feed(group, socket, number)
    return node.outputs["Vector"]


def _towards_one(group, color, share):
    return add_mix(group, "VECTOR", share, color, (1.0, 1.0, 1.0), "Schlick")
