"""Glint BSDF: a normal map's glints, through OSL where Cycles has it, else Blender's own nodes.

The map belongs to the group, not to a socket: OSL needs its table's file name as a constant, and node groups have no
string sockets. So there is one group for each map and way of reading it: "Glint BSDF", "Glint BSDF.001", ...
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..errors import MapError
from . import glint_lights
from .builder import STAMP, add_input, add_node, add_output, arrange, local_group, new_group
from .driven import Driven, Variable, write_number
from .script_node import add_script_node, osl_available

NAME = "Glint BSDF"
VERSION = 9
SCRIPT_NODE = "Glint"
LIGHTS_NODE = "Lights"
CAUSTICS_NODE = "Caustics"
DISTRIBUTIONS = ("BECKMANN", "GGX")
INTERPOLATIONS = ("LINEAR", "CLOSEST")
CONVENTIONS = ("OPENGL", "DIRECTX")
EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")

# Whether glints are enumerated after diffuse bounces too, in the scene that is being rendered: where Cycles shows what
# facets throw on their neighbours, and does not blur it by Filter Glossy, which leaves nothing to gain.
CAUSTICS = Driven(
    "1 if caustics > 0 and blur <= 0 else 0",
    (
        Variable("caustics", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.caustics_reflective"),
        Variable("blur", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.blur_glossy"),
    ),
)


@dataclass(frozen=True)
class MapBinding:
    """A normal map and how it is read; the values are those of Blender's own nodes."""

    image: bpy.types.Image | None = None
    interpolation: str = "LINEAR"
    convention: str = "OPENGL"
    distribution: str = "BECKMANN"
    uv_map: str = ""
    extension: str = "REPEAT"

    def __post_init__(self):
        for value, allowed, what in (
            (self.interpolation, INTERPOLATIONS, "Interpolation"),
            (self.convention, CONVENTIONS, "Convention"),
            (self.distribution, DISTRIBUTIONS, "Distribution"),
            (self.extension, EXTENSIONS, "Extension"),
        ):
            if value not in allowed:
                raise MapError(f'{what} "{value}" is unknown: use one of {", ".join(allowed)}.')


def build() -> bpy.types.ShaderNodeTree:
    """Get or build the group without a map: a plain glossy surface until a map is chosen."""
    return group_for(MapBinding())


def group_for(binding: MapBinding) -> bpy.types.ShaderNodeTree:
    """Get or build the group that reads `binding`.

    Raises SceneError if a group of that name is not ours, ShaderError if the shader does not compile.
    """
    local_group(NAME)
    for group in bpy.data.node_groups:
        if is_glint_group(group) and group.library is None and group_binding(group) == binding:
            return group
    group = new_group(NAME, VERSION, "Glints of a normal map's microstructure")
    try:
        _store_binding(group, binding)
        _add_sockets(group)
        _add_nodes(group, binding)
        arrange(group)
    except Exception:
        bpy.data.node_groups.remove(group)
        raise
    return group


def is_glint_group(group) -> bool:
    """Whether a node tree is a Glint BSDF group."""
    return group is not None and STAMP in group and "glint_interpolation" in group


def group_binding(group) -> MapBinding:
    """What a Glint BSDF group reads."""
    return MapBinding(
        group.get("glint_image"),
        group["glint_interpolation"],
        group["glint_convention"],
        group["glint_distribution"],
        group["glint_uv_map"],
        group.get("glint_extension", "REPEAT"),  # groups of version 3 and before have none
    )


def refresh(group):
    """Rebuild the nodes of a group made by another version, or by a Blender without OSL; its sockets stay linked."""
    outdated = group[STAMP] != VERSION or (osl_available() and group.nodes.get(SCRIPT_NODE) is None)
    if not outdated:
        return
    group.nodes.clear()
    _add_nodes(group, group_binding(group))
    arrange(group)
    group[STAMP] = VERSION
    group["glint_table"] = ""


def set_table(group, path: str, size, slope_low, slope_high, counts=None, index: str = ""):
    """Let the group's OSL node read the table at `path`, "" for none.

    size: (width, height) in texels of the map; slopes: (2,); counts: (path, (first, last) block sides, low and high
    corner (2,) of the bins), or None; index: path, "" for none.
    """
    group["glint_table"] = path
    script = group.nodes.get(SCRIPT_NODE)
    if script is None:
        return
    bounded = all(abs(value) < 1e6 for value in (*slope_low, *slope_high))
    values = {
        "Table": path,
        "Width": float(size[0]),
        "Height": float(size[1]),
        "SlopeLow": (*slope_low, 0.0) if bounded else (0.0, 0.0, 0.0),
        "SlopeHigh": (*slope_high, 0.0) if bounded else (0.0, 0.0, 0.0),
        "IndexTable": index,
    } | _counts_values(*(counts or ("", (0, 0), (0.0, 0.0), (0.0, 0.0))))
    for name, value in values.items():
        script.inputs[name].default_value = value


def share_closures(group, lobes: int):
    """Tell the group's OSL node how many Glint BSDFs, 1 or more, share the closures of a shading point with it."""
    _set_constant(group, "Lobes", lobes)


def limit_visits(group, visits: int):
    """Tell the group's OSL node how many elements of the map a sample visits at most, 1 to 4096 (osl/query.h)."""
    _set_constant(group, "Visits", visits)


def _set_constant(group, name, value):
    """Groups that no camera sees stay as an older version made them, and may have no such input."""
    script = group.nodes.get(SCRIPT_NODE)
    socket = script.inputs.get(name) if script is not None else None
    if socket is not None and socket.default_value != value:
        socket.default_value = value


def _counts_values(path, levels, low, high) -> dict:
    first, last = levels
    return {
        "CountsTable": path,
        "CountsFirst": first,
        "CountsLevels": (last // first).bit_length() if path else 0,
        "BinLow": (*low, 0.0),
        "BinHigh": (*high, 0.0),
    }


def _store_binding(group, binding):
    if binding.image is not None:
        group["glint_image"] = binding.image
    group["glint_interpolation"] = binding.interpolation
    group["glint_convention"] = binding.convention
    group["glint_distribution"] = binding.distribution
    group["glint_uv_map"] = binding.uv_map
    group["glint_extension"] = binding.extension
    group["glint_table"] = ""
    group["glint_source"] = ""


def _add_sockets(group):
    add_output(group, "BSDF", "NodeSocketShader")
    add_input(group, "Color", "NodeSocketColor", default=(1, 1, 1, 1), help="Reflectance of a facet")
    add_input(group, "Roughness", "NodeSocketFloat", default=0.1, low=0.0, high=1.0, subtype="FACTOR",
              help="Roughness of a single facet; its alpha is the square. Smaller: sharper, rarer, brighter glints")
    add_input(group, "Strength", "NodeSocketFloat", default=1.0, low=0.0, high=10.0,
              help="Scale of the map's slopes, as in the Normal Map node")
    add_input(group, "Vector", "NodeSocketVector", help="Texture coordinates: connect a UV Map node")


def _add_nodes(group, binding):
    source = add_node(group, "NodeGroupInput")
    output = add_node(group, "NodeGroupOutput")
    glossy = _add_native_nodes(group, binding, source)
    script = add_script_node(group, "glint.osl", SCRIPT_NODE)
    if script is None:
        group.links.new(glossy, output.inputs["BSDF"])
        return

    lights = add_node(group, "ShaderNodeGroup", LIGHTS_NODE, node_tree=glint_lights.build())
    prefix = f"{binding.uv_map}." if binding.uv_map else "geom:"
    for name, value in {
        "Linear": int(binding.interpolation == "LINEAR"),
        "Repeats": int(binding.extension == "REPEAT"),
        "GGX": int(binding.distribution == "GGX"),
        "TangentName": f"{prefix}tangent",
        "SignName": f"{prefix}tangent_sign",
    }.items():
        script.inputs[name].default_value = value
    links = [(source.outputs[name], script.inputs[name]) for name in ("Color", "Roughness", "Strength")]
    links.append((source.outputs["Vector"], script.inputs["UV"]))
    links.append((glossy, script.inputs["Fallback"]))
    for name in (glint_lights.SAMPLES, glint_lights.CLOSURES):
        links.append((lights.outputs[name], script.inputs[name]))
    caustics = add_node(group, "ShaderNodeValue", CAUSTICS_NODE).outputs["Value"]
    write_number(caustics, CAUSTICS)
    links.append((caustics, script.inputs["Caustics"]))
    for index in range(1, glint_lights.HINT_COUNT + 1):
        links.append((lights.outputs[f"Light {index}"], script.inputs[f"Light{index}"]))
        links.append((lights.outputs[f"Shape {index}"], script.inputs[f"Shape{index}"]))
        links.append((lights.outputs[f"Axis {index}"], script.inputs[f"Axis{index}"]))

    # Without OSL the Script node vanishes and the factor takes its own value, 0: Blender's own nodes.
    mix = add_node(group, "ShaderNodeMixShader", "OSL or native", inputs={"Factor": 0.0})
    links.append((script.outputs["Active"], mix.inputs["Factor"]))
    links.append((glossy, mix.inputs[1]))
    links.append((script.outputs["BSDF"], mix.inputs[2]))
    links.append((mix.outputs[0], output.inputs["BSDF"]))
    for one, other in links:
        group.links.new(one, other)


def _add_native_nodes(group, binding, source):
    """Blender's own nodes for the same surface; returns the BSDF output."""
    texture = add_node(group, "ShaderNodeTexImage", "Normal Map Image",
                       interpolation="Linear" if binding.interpolation == "LINEAR" else "Closest",
                       extension=binding.extension)
    texture.image = binding.image
    normal_map = add_node(group, "ShaderNodeNormalMap", "Tangent Space", uv_map=binding.uv_map,
                          convention=binding.convention)
    glossy = add_node(group, "ShaderNodeBsdfAnisotropic", "Facets", distribution=binding.distribution)
    group.links.new(source.outputs["Vector"], texture.inputs["Vector"])
    group.links.new(source.outputs["Strength"], normal_map.inputs["Strength"])
    if binding.image is not None:
        group.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    group.links.new(normal_map.outputs["Normal"], glossy.inputs["Normal"])
    group.links.new(source.outputs["Color"], glossy.inputs["Color"])
    group.links.new(source.outputs["Roughness"], glossy.inputs["Roughness"])
    return glossy.outputs["BSDF"]
