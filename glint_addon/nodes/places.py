"""Glints by nodes alone: resampled importance sampling of the texels under a sample, where the OSL lobe cannot run.

A sample looks at the map in some places of its footprint and keeps one normal, with odds of its importance q: what the
lights that are looked for would show of it. With S the sum of q over M places, and own the normal at the hit point,

    f = S / (M (q + FLOOR)) * microfacet(kept)  +  FLOOR / (q(own) + FLOOR) * microfacet(own)

The expectation is that of the own normal alone, Blender's plain nodes, averaged over the footprint, for any importance
and lights; FLOOR bounds the weights, so that lights that nobody looks for make no fireflies. Talbot, Cline, Egbert:
Importance Resampling for Global Illumination, EGSR 2005; the running choice is that of Bitterli et al.: Spatiotemporal
Reservoir Resampling for Real-Time Ray Tracing with Dynamic Direct Lighting, SIGGRAPH 2020.

The formulas that no user need look at are in hidden groups, which all Glint BSDF groups share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy

from .builder import Socket, add_math, add_mix, add_node, add_sockets, arrange, feed, local_group, new_group
from .driven import Driven, Variable, write_number
from .scene_lights import HINT_COUNT

# Of the hidden groups, and part of their names: groups of an older version keep theirs until they are brought up to
# date, and Blender drops what nobody uses when it saves the file.
VERSION = 4
DEFAULT_COUNT, LARGEST_COUNT = 16, 64  # places of a sample
# Importance below which a normal is left to the plain part of the sum: higher, and that part's noise shows; lower, and
# the weight of a rare normal grows: decision 59.
FLOOR = 0.05
# Squared width of the importance over that of what the light shows of a normal, whose exact form it need not know:
# decision 60.
WIDENING = 1.1
# Squared width of a Gaussian that has the variance of a disk of radius 1.
DISK = 0.5
# Radius in pixels of the footprint of one of n samples: scale / n^exponent, as osl/footprint.h has it.
FOOTPRINT_SCALE, FOOTPRINT_EXPONENT = 1.1, 0.21
# Radius of a footprint in texels from which on there is more than one normal to choose from, and the largest that is
# spread over: in it are as many normals as any number of places can use, and the less of the surface, the less light
# and view turn over it: decision 61.
NARROWEST, WIDEST = 1.0, 32.0
GOLDEN_ANGLE = 2.3999632  # radians: successive places of a sunflower

HIDDEN = FOOTPRINT, PLACE, HALF_VECTOR, HALF_VECTORS, IMPORTANCE = tuple(
    f".Glint {name} {VERSION}" for name in ("Footprint", "Place", "Half Vector", "Half Vectors", "Importance"))
# Number of places, which a user may change, and nodes that follow the map.
COUNT_NODE, FOOTPRINT_NODE = "Places", "Footprint"
IMPORTANCE_NODES = ("Importance", "Kept Importance", "Own Importance")
NODES = (COUNT_NODE, FOOTPRINT_NODE, *IMPORTANCE_NODES)

_CAMERA = (
    Variable("kind", "CONTEXT_PROP", "ACTIVE_SCENE", "camera.data.type", otherwise=0.0),
    Variable("x", "CONTEXT_PROP", "ACTIVE_SCENE", "render.resolution_x"),
    Variable("y", "CONTEXT_PROP", "ACTIVE_SCENE", "render.resolution_y"),
    Variable("percent", "CONTEXT_PROP", "ACTIVE_SCENE", "render.resolution_percentage"),
)
# Size of a pixel at a distance of 1 [rad], and of an orthographic camera's at any [m].
PIXEL_ANGLE = Driven(
    "(0 if kind == 1 else sensor / lens) / max(x, y) / percent * 100",
    (*_CAMERA, Variable("sensor", "CONTEXT_PROP", "ACTIVE_SCENE", "camera.data.sensor_width", otherwise=36.0),
     Variable("lens", "CONTEXT_PROP", "ACTIVE_SCENE", "camera.data.lens", otherwise=50.0)),
)
PIXEL_WIDTH = Driven(
    "(scale if kind == 1 else 0) / max(x, y) / percent * 100",
    (*_CAMERA, Variable("scale", "CONTEXT_PROP", "ACTIVE_SCENE", "camera.data.ortho_scale", otherwise=1.0)),
)


@dataclass(frozen=True)
class Places:
    """What `add_places` returns, sockets all: colour of the kept normal, its texture coordinates, and the cosine
    between view and the half vectors near it; weights of the kept normal, and of the own one, 0..1; is_useful: 1 where
    a footprint is wider than a texel and a light is looked for, else 0."""

    kept: bpy.types.NodeSocket
    kept_place: bpy.types.NodeSocket
    kept_cosine: bpy.types.NodeSocket
    kept_weight: bpy.types.NodeSocket
    own_weight: bpy.types.NodeSocket
    is_useful: bpy.types.NodeSocket


# What a hidden group consists of: its outputs, its inputs, and the function (group, sockets of its inputs by name) that
# adds nodes and returns the sockets of its outputs by name.
Formulas = tuple[tuple[Socket, ...], tuple[Socket, ...], Callable[..., dict]]


def add_places(group, texture: bpy.types.Node, own, frame, lights, sockets, read_at=None) -> Places:
    """Add a Repeat Zone that chooses one of the places under a sample.

    texture: the Image Texture node to read them by; own: colour of the normal at the hit point; frame: world-space
    tangent and bitangent; lights: the "Glint Lights" node; sockets: {"Coordinates", "Roughness", "Strength"}; read_at:
    function that adds nodes between the coordinates of a place and those at which images are read there, or None.
    """
    footprint = _add_group(group, FOOTPRINT, FOOTPRINT_NODE, {
        "Coordinates": sockets["Coordinates"], "Samples": lights.outputs["Samples"]}).outputs
    known = _add_group(group, HALF_VECTORS, "Half Vectors", {
        **{name: lights.outputs[name] for number in _NUMBERS for name in (f"Light {number}", f"Shape {number}")},
        "Roughness": sockets["Roughness"], "Tangent": frame[0], "Bitangent": frame[1]}).outputs
    count, start, end = _add_repeat_zone(group)
    place = _add_group(group, PLACE, "Place", {
        "Number": start.outputs["Iteration"], "Count": count, "Coordinates": sockets["Coordinates"],
        "Sum": start.outputs["Sum"], "Along": footprint["Along"], "Across": footprint["Across"]}).outputs["Place"]
    read = place if read_at is None else read_at(place)
    group.links.new(read, texture.inputs["Vector"])
    colour = texture.outputs["Color"]
    kept = end.outputs["Normal"]
    importance, kept_importance, of_own = (
        _add_group(group, IMPORTANCE, label, {
            "Color": source, "Strength": sockets["Strength"],
            **{f"{name} {number}": known[f"{name} {number}"] for number in _NUMBERS for name in _OF_A_LIGHT},
        }).outputs
        for label, source in zip(IMPORTANCE_NODES, (colour, kept, own), strict=True))
    importance = importance["Importance"]
    total = add_math(group, "ADD", start.outputs["Sum"], importance)
    # A fresh number for each place of each sample: no two look at the same coordinates.
    chance = add_node(group, "ShaderNodeTexWhiteNoise", "Chance", noise_dimensions="2D")
    group.links.new(place, chance.inputs["Vector"])
    is_kept = add_math(group, "LESS_THAN", add_math(group, "MULTIPLY", chance.outputs["Value"], total), importance)
    group.links.new(total, end.inputs["Sum"])
    for name, new in (("Normal", colour), ("Place", read)):
        group.links.new(add_mix(group, "VECTOR", is_kept, start.outputs[name], new, f"Keep {name}"), end.inputs[name])

    mean = add_math(group, "DIVIDE", end.outputs["Sum"], count)
    return Places(
        kept,
        end.outputs["Place"],
        kept_importance["Cosine"],
        add_math(group, "DIVIDE", mean, add_math(group, "ADD", kept_importance["Importance"], FLOOR)),
        add_math(group, "DIVIDE", FLOOR, add_math(group, "ADD", of_own["Importance"], FLOOR)),
        add_math(group, "MULTIPLY", known["Is Lit"], footprint["Is Wide"]),
    )


def _add_repeat_zone(group):
    """The number of places, and both ends of a zone that goes on so often with a sum, a normal and its place."""
    count = add_node(group, "FunctionNodeInputInt", COUNT_NODE, integer=DEFAULT_COUNT)
    bounds = add_node(group, "ShaderNodeClamp", inputs={"Min": 1.0, "Max": LARGEST_COUNT})
    group.links.new(count.outputs["Integer"], bounds.inputs["Value"])
    start = add_node(group, "GeometryNodeRepeatInput", "Each Place")
    group.links.new(bounds.outputs["Result"], start.inputs["Iterations"])
    end = add_node(group, "GeometryNodeRepeatOutput", "Kept")
    start.pair_with_output(end)
    end.repeat_items.clear()
    end.repeat_items.new("FLOAT", "Sum")
    end.repeat_items.new("VECTOR", "Normal")
    end.repeat_items.new("VECTOR", "Place")
    return bounds.outputs["Result"], start, end


def count_node(group) -> bpy.types.Node | None:
    """The node whose property `integer` is how many places a sample of a Glint BSDF group looks at; None without any.

    1 to LARGEST_COUNT count as they are, others as the next of these.
    """
    return group.nodes.get(COUNT_NODE)


def keep_count(group, count: int | None):
    """Let a Glint BSDF group, if it has places, look at `count` of them, or as many as it does if that is None."""
    node = count_node(group)
    if node is not None and count is not None:
        node.integer = count


def count_of(group) -> int | None:
    """How many places a Glint BSDF group looks at; None if it has none."""
    node = count_node(group)
    return node.integer if node is not None else None


def follow_size(group, size):
    """Let the places follow the map's size (width, height) in texels."""
    _set(group.nodes[FOOTPRINT_NODE].inputs["Size"], (*size, 0.0))


def follow_distribution(group, is_ggx: bool):
    """Let the places follow the distribution of the map's facets."""
    for name in IMPORTANCE_NODES:
        _set(group.nodes[name].inputs["GGX"], float(is_ggx))


def hidden_group(name: str, formulas: Formulas | None = None) -> bpy.types.ShaderNodeTree:
    """The local hidden group `name`, one of HIDDEN or of other `formulas`, built if the file has none.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = local_group(name)
    if group is not None:
        return group
    outputs, inputs, add_formulas = formulas or _FORMULAS[name]
    group = new_group(name, VERSION, "Part of Glint BSDF, where Open Shading Language cannot run")
    add_sockets(group, outputs, inputs)
    results = add_formulas(group, add_node(group, "NodeGroupInput").outputs)
    output = add_node(group, "NodeGroupOutput")
    for socket in outputs:
        feed(group, output.inputs[socket.name], results[socket.name])
    arrange(group)
    return group


def _number(name, default=0.0):
    return Socket(name, "NodeSocketFloat", default=default)


def _vector(name, default=(0.0, 0.0, 0.0)):
    return Socket(name, "NodeSocketVector", default=default)


_NUMBERS = range(1, HINT_COUNT + 1)  # of the lights that the importance knows, all of them: decision 62
# What the importance knows of a light: tangent-space vectors across and in the plane of incidence, whose dot products
# with a normal are its distances from the half vector in widths of what the light shows; whether there is a light; and
# the cosine between half vector and view, on which Fresnel's reflectance depends.
_OF_A_LIGHT = ("Outwards", "Inwards", "Is On", "Cosine")


def _footprint(group, given):
    """Half axes of the footprint in texture coordinates, and whether it is wider than a texel.

    Nodes cannot ask how a coordinate changes along the surface, but a Bump node tilts the normal by that.
    """
    geometry = add_node(group, "ShaderNodeNewGeometry").outputs
    normal, view = geometry["Normal"], geometry["Incoming"]
    size = add_node(group, "ShaderNodeSeparateXYZ")
    group.links.new(given["Size"], size.inputs[0])
    texels = add_math(group, "MAXIMUM", size.outputs["X"], size.outputs["Y"])
    # The height of one texel over the footprint's radius, so that slopes are neither rounded off nor too steep.
    height = add_math(group, "MULTIPLY", _pixels_radius(group, given), texels)
    tilted = _tilted(group, given["Coordinates"], height)
    # The gradient is -(tilted / (tilted . n) - n).
    facing, *upright = (add_math(group, "DOT_PRODUCT", each, normal, vector=True) for each in (view, *tilted))

    # Where the footprint is narrow Cycles computes no more than this: its area in squared texels, as a quotient.
    areas = add_math(group, "DIVIDE", add_math(group, "DIVIDE", size.outputs["X"], texels),
                     add_math(group, "DIVIDE", texels, size.outputs["Y"]))
    volume = add_math(group, "DOT_PRODUCT", add_math(group, "CROSS_PRODUCT", *tilted, vector=True), normal, vector=True)
    area = add_math(group, "MULTIPLY", add_math(group, "ABSOLUTE", volume), areas)
    unit = add_math(group, "MULTIPLY", add_math(group, "MULTIPLY", *upright), facing)
    is_wide = add_math(group, "GREATER_THAN", area, add_math(group, "MULTIPLY", unit, NARROWEST**2))
    share = add_math(group, "MINIMUM", add_math(group, "SQRT", add_math(
        group, "DIVIDE", add_math(group, "MULTIPLY", unit, WIDEST**2), area)), 1.0)
    scales = (add_math(group, "DIVIDE", share, add_math(group, "MULTIPLY", each, texels)) for each in upright)

    # Laid along the view onto the surface, each gradient loses its part there.
    axes = _turned_axes(group, geometry["Position"], view)
    changes = []
    for each, scale in zip(tilted, scales, strict=True):
        part = add_math(group, "DIVIDE", add_math(group, "DOT_PRODUCT", each, view, vector=True), facing)
        level = add_math(group, "SCALE", normal, part, vector=True)
        across = add_math(group, "SUBTRACT", level, each, vector=True)
        changes.append(add_math(group, "SCALE", across, scale, vector=True))
    along, across = (
        _combined(group, *(add_math(group, "DOT_PRODUCT", change, axis, vector=True) for change in changes), 0.0)
        for axis in axes)
    return {"Along": along, "Across": across, "Is Wide": is_wide}


def _tilted(group, coordinates, height):
    """Normals tilted by Bump nodes of that distance for both of the coordinates."""
    parts = add_node(group, "ShaderNodeSeparateXYZ")
    group.links.new(coordinates, parts.inputs[0])
    tilted = []
    for coordinate in (parts.outputs["X"], parts.outputs["Y"]):
        bump = add_node(group, "ShaderNodeBump", inputs={"Strength": 1.0})
        group.links.new(height, bump.inputs["Distance"])
        group.links.new(coordinate, bump.inputs["Height"])
        tilted.append(bump.outputs["Normal"])
    return tilted


def _turned_axes(group, position, view):
    """Two axes across the view, turned at random from sample to sample."""
    noise = add_node(group, "ShaderNodeTexWhiteNoise", "Turn", noise_dimensions="3D")
    group.links.new(position, noise.inputs["Vector"])
    random = add_math(group, "SUBTRACT", noise.outputs["Color"], (0.5, 0.5, 0.5), vector=True)
    first = add_math(group, "NORMALIZE", add_math(group, "CROSS_PRODUCT", view, random, vector=True), vector=True)
    return first, add_math(group, "CROSS_PRODUCT", view, first, vector=True)


def _pixels_radius(group, given):
    """Radius [m] of a sample's footprint across the view."""
    angle, width = (add_node(group, "ShaderNodeValue", label).outputs["Value"] for label in ("Angle", "Width"))
    write_number(angle, PIXEL_ANGLE)
    write_number(width, PIXEL_WIDTH)
    distance = add_node(group, "ShaderNodeCameraData").outputs["View Distance"]
    pixel = add_math(group, "MULTIPLY_ADD", distance, angle, width)
    pixels = add_math(group, "MULTIPLY", add_math(group, "POWER", given["Samples"], -FOOTPRINT_EXPONENT),
                      FOOTPRINT_SCALE)
    return add_math(group, "MULTIPLY", pixel, pixels)


def _place(group, given):
    """Coordinates of a place: places of one sample spread over the footprint as its kernel (osl/footprint.h)."""
    part = add_math(group, "DIVIDE", add_math(group, "ADD", given["Number"], 0.5), given["Count"])
    inner = add_math(group, "POWER", add_math(group, "SUBTRACT", 1.0, part), 1.0 / 3.0)
    radius = add_math(group, "SQRT", add_math(group, "SUBTRACT", 1.0, inner))
    angle = add_math(group, "MULTIPLY", given["Number"], GOLDEN_ANGLE)
    # The sum so far is never below 0, which Cycles cannot know: so it finishes one place before it begins the next, and
    # any number of them fits in its node stack.
    nothing = add_math(group, "MINIMUM", given["Sum"], 0.0)
    place = add_math(group, "ADD", given["Coordinates"], nothing, vector=True)
    for axis, turn in (("Along", "COSINE"), ("Across", "SINE")):
        step = add_math(group, "MULTIPLY", radius, add_math(group, turn, angle))
        place = add_math(group, "MULTIPLY_ADD", given[axis], _combined(group, step, step, step), place, vector=True)
    return {"Place": place}


def _half_vector(group, given):
    """What the importance knows of a light; see `_OF_A_LIGHT`."""
    geometry = add_node(group, "ShaderNodeNewGeometry").outputs
    normal, view = geometry["Normal"], geometry["Incoming"]
    shape = add_node(group, "ShaderNodeSeparateXYZ")
    group.links.new(given["Shape"], shape.inputs[0])
    kind, size = shape.outputs["X"], shape.outputs["Y"]
    # The vector is the direction to a sun, and the place of any other light, whose size is a radius.
    origin = add_math(group, "SCALE", geometry["Position"], add_math(group, "GREATER_THAN", kind, 1.5), vector=True)
    towards = add_math(group, "SUBTRACT", given["Light"], origin, vector=True)
    distance = add_math(group, "LENGTH", towards, vector=True)
    half_angle = add_math(group, "DIVIDE", size, distance)
    light = add_math(group, "NORMALIZE", towards, vector=True)
    whole = add_math(group, "ADD", light, view, vector=True)
    length = add_math(group, "LENGTH", whole, vector=True)
    # Where the light stands behind the eye all directions are in the plane of incidence: the tangent's is taken.
    across = add_math(group, "CROSS_PRODUCT", light, view, vector=True)
    across = add_math(group, "MULTIPLY_ADD", given["Tangent"], (1e-6, 1e-6, 1e-6), across, vector=True)
    outwards = add_math(group, "NORMALIZE", across, vector=True)
    inwards = add_math(group, "CROSS_PRODUCT", outwards, add_math(group, "NORMALIZE", whole, vector=True), vector=True)
    alpha = add_math(group, "POWER", given["Roughness"], 2.0)
    # An angle a between lights is one of a / |l + v| between half vectors across the plane of incidence, a / 2 in it.
    spreads = (add_math(group, "DIVIDE", half_angle, length), add_math(group, "MULTIPLY", half_angle, 0.5))
    forms = []
    for axis, spread in zip((outwards, inwards), spreads, strict=True):
        squares = add_math(group, "MULTIPLY_ADD", add_math(group, "MULTIPLY", spread, spread), DISK,
                           add_math(group, "MULTIPLY", alpha, alpha))
        scale = add_math(group, "INVERSE_SQRT", add_math(group, "MULTIPLY", squares, WIDENING))
        upright = _combined(group, *(add_math(group, "DOT_PRODUCT", axis, direction, vector=True)
                                     for direction in (given["Tangent"], given["Bitangent"], normal)))
        forms.append(add_math(group, "SCALE", upright, scale, vector=True))
    is_on = add_math(group, "GREATER_THAN", kind, 0.5)
    # The sum of two unit vectors is twice as long as the cosine between it and either.
    return dict(zip(_OF_A_LIGHT, (*forms, is_on, add_math(group, "MULTIPLY", length, 0.5)), strict=True))


def _half_vectors(group, given):
    """What the importance knows of each light, and whether any light is on."""
    shared = {name: given[name] for name in ("Roughness", "Tangent", "Bitangent")}
    results, is_lit = {}, 0.0
    for number in _NUMBERS:
        light = _add_group(group, HALF_VECTOR, f"Half Vector {number}", {
            "Light": given[f"Light {number}"], "Shape": given[f"Shape {number}"], **shared}).outputs
        results |= {f"{name} {number}": light[name] for name in _OF_A_LIGHT}
        is_lit = add_math(group, "MAXIMUM", light["Is On"], is_lit)
    return {**results, "Is Lit": is_lit}


def _importance(group, given):
    """Importance 0..1 of a normal, encoded as a colour, for each light: their sum, and the mean cosine between half
    vector and view, weighted by importance."""
    # As the Normal Map node has it: n = strength (2 c - 1) + (1 - strength) z.
    twice = add_math(group, "MULTIPLY", given["Strength"], 2.0)
    minus = add_math(group, "MULTIPLY", given["Strength"], -1.0)
    offset = _combined(group, minus, minus, add_math(group, "SUBTRACT", 1.0, twice))
    normal = add_math(group, "MULTIPLY_ADD", given["Color"], _combined(group, twice, twice, twice), offset, vector=True)
    total = cosines = 0.0
    for number in _NUMBERS:
        x, y = (add_math(group, "DOT_PRODUCT", normal, given[f"{name} {number}"], vector=True)
                for name in _OF_A_LIGHT[:2])
        square = add_math(group, "MULTIPLY_ADD", x, x, add_math(group, "MULTIPLY", y, y))
        beckmann = add_math(group, "POWER", 0.36787944, square)
        tail = add_math(group, "ADD", square, 1.0)
        ggx = add_math(group, "DIVIDE", 1.0, add_math(group, "MULTIPLY", tail, tail))
        lobe = add_mix(group, "FLOAT", given["GGX"], beckmann, ggx, "Lobe")
        # A product with 0 and a sum with 0: Cycles then drops all nodes of a light that is off.
        share = add_math(group, "MULTIPLY", lobe, given[f"Is On {number}"])
        total = add_math(group, "ADD", share, total)
        cosines = add_math(group, "ADD", add_math(group, "MULTIPLY", share, given[f"Cosine {number}"]), cosines)
    mean = add_math(group, "DIVIDE", cosines, add_math(group, "MAXIMUM", total, 1e-30))
    return {"Importance": total, "Cosine": mean}


_KNOWN = tuple(
    socket for number in _NUMBERS
    for socket in (_vector(f"Outwards {number}"), _vector(f"Inwards {number}"), _number(f"Is On {number}"),
                   _number(f"Cosine {number}")))
_FORMULAS = {
    FOOTPRINT: ((_vector("Along"), _vector("Across"), _number("Is Wide")),
                (_vector("Coordinates"), _vector("Size", (1.0, 1.0, 0.0)), _number("Samples", 1.0)), _footprint),
    PLACE: ((_vector("Place"),),
            (_number("Number"), _number("Count", 1.0), _vector("Coordinates"), _vector("Along"), _vector("Across"),
             _number("Sum")), _place),
    HALF_VECTOR: ((_vector("Outwards"), _vector("Inwards"), _number("Is On"), _number("Cosine")),
                  (_vector("Light"), _vector("Shape"), _number("Roughness"), _vector("Tangent"), _vector("Bitangent")),
                  _half_vector),
    HALF_VECTORS: ((*_KNOWN, _number("Is Lit")),
                   (*(_vector(f"{name} {number}") for number in _NUMBERS for name in ("Light", "Shape")),
                    _number("Roughness"), _vector("Tangent"), _vector("Bitangent")), _half_vectors),
    IMPORTANCE: ((_number("Importance"), _number("Cosine")),
                 (_vector("Color"), _number("Strength", 1.0), _number("GGX"), *_KNOWN), _importance),
}


def _set(socket, value):
    """Give a socket a value that it has not: Blender would compile the shader again."""
    is_same = tuple(socket.default_value) == value if isinstance(value, tuple) else socket.default_value == value
    if not is_same:
        socket.default_value = value


def _add_group(group, name, label, sources):
    """Add one of HIDDEN to `group`; sources: {input: socket or value}."""
    return add_hidden_group(group, name, label, sources)


def add_hidden_group(group, name, label, sources, formulas: Formulas | None = None) -> bpy.types.ShaderNode:
    """Add `hidden_group` to `group`; sources: {input: socket or value}."""
    node = add_node(group, "ShaderNodeGroup", label, node_tree=hidden_group(name, formulas))
    for socket, source in sources.items():
        feed(group, node.inputs[socket], source)
    return node


def _combined(group, x, y, z):
    node = add_node(group, "ShaderNodeCombineXYZ")
    for socket, source in zip(node.inputs, (x, y, z), strict=True):
        feed(group, socket, source)
    return node.outputs["Vector"]
