"""Node group "Glint Image Texture": an image by UV map or on a sphere; nearest, bilinear, or mipmapped with OSL.

Nearest and bilinear are Blender's own Image Texture nodes, so colours, alpha, tiles and packed files are Blender's.
Mipmap is osl/image_texture.osl reading a baked pyramid; where Cycles runs without OSL, in EEVEE, and while the pyramid
is missing it is bilinear. A file name cannot be a group's socket, so each image has a group of its own ("Glint Image
Texture", "Glint Image Texture.001", ...).
"""

from __future__ import annotations

import math
from pathlib import Path

import bpy

from .. import paths
from ..errors import SceneError
from ..images import image_shape
from ..properties import IMAGE_TEXTURE
from . import builder, glint_lights, script_node
from .builder import Socket

NAME = "Glint Image Texture"
VERSION = 1
SHADER = "image_texture.osl"

# Menu items by the names that functions take.
MAPPINGS = {"UV": "UV", "SPHERICAL": "Spherical", "VECTOR": "Vector"}
FILTERS = {"NEAREST": "Nearest", "BILINEAR": "Bilinear", "MIPMAP": "Mipmap"}
UP_AXES = {"Y": "Y", "Z": "Z"}

OUTPUTS = (
    Socket("Color", "NodeSocketColor", help="As Blender's Image Texture"),
    Socket("Alpha", "NodeSocketFloat", help="As Blender's Image Texture"),
)
INPUTS = (
    Socket("Mapping", "NodeSocketMenu", help="UV map, sphere around the object's origin, or the Vector socket"),
    Socket("Filter", "NodeSocketMenu", help="Mipmap needs OSL and is bilinear without"),
    Socket("Up Axis", "NodeSocketMenu", help="Axis of the sphere: v = 1 at its positive end"),
    Socket("Turn with Object", "NodeSocketBool", default=False,
           help="Spherical: the sphere's axes are the object's own instead of the world's"),
    Socket("Vector", "NodeSocketVector", help="Texture coordinates for the mapping Vector"),
)

NEAREST_NODE, BILINEAR_NODE, MIPMAP_NODE = "Image Nearest", "Image Bilinear", "Image Mipmap"
UV_NODE, ROW_NODE = "UV Map", "Half a Row"
PROBE = "Glint Alpha Probe"


def build() -> bpy.types.ShaderNodeTree:
    """The local group "Glint Image Texture", built without an image if the file has none; see `set_image`.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = builder.local_group(NAME)
    return group if group is not None else _new_tree()


def build_for_image(
    image, *, mapping="UV", filter="MIPMAP", up="Z", uv_map="", folder=None
) -> bpy.types.ShaderNodeTree:
    """The group that shows `image`: the file's own one if there is, else a new one, with these values for new nodes.

    mapping: 'UV' | 'SPHERICAL' | 'VECTOR'; filter: 'NEAREST' | 'BILINEAR' | 'MIPMAP'; up: 'Y' | 'Z'; uv_map: "" is the
    object's active one; folder: for the mip pyramid, which is baked if the filter is 'MIPMAP'
    (default `paths.table_folder` of the open file).
    Raises SceneError for an unknown choice, and whatever `set_image` raises.
    """
    _check_choices(mapping, filter, up)
    copies = [group for group in bpy.data.node_groups if group.library is None and IMAGE_TEXTURE in group]
    matching = [group for group in copies if image_of(group) == image and group.nodes[UV_NODE].uv_map == uv_map]
    unused = [group for group in copies if image_of(group) is None and group.users == 0]
    group = (matching or unused or [None])[0]
    is_new = group is None
    if is_new:
        builder.local_group(NAME)  # raises if the name is taken by someone else's group
        group = _new_tree()
    try:
        set_image(group, image, bake=filter == "MIPMAP", folder=folder)
    except Exception:
        if is_new:
            bpy.data.node_groups.remove(group)
        raise
    group.nodes[UV_NODE].uv_map = uv_map
    for socket, value in (("Mapping", MAPPINGS[mapping]), ("Filter", FILTERS[filter]), ("Up Axis", UP_AXES[up])):
        group.interface.items_tree[socket].default_value = value
    return group


def add_node(tree, image, **options) -> bpy.types.ShaderNodeGroup:
    """Add a node of `build_for_image(image, **options)` to the node tree `tree`, with those options as its values."""
    group = build_for_image(image, **options)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    for socket in ("Mapping", "Filter", "Up Axis"):
        node.inputs[socket].default_value = group.interface.items_tree[socket].default_value
    return node


def image_of(group) -> bpy.types.Image | None:
    """The image that a copy of the group shows."""
    return group.nodes[BILINEAR_NODE].image


def set_image(group, image, *, bake=True, folder=None):
    """Make a copy of the group (or the group of a node) show `image`; `bake` its mip pyramid into `folder` if missing.

    Raises SceneError if it is not such a group or there is no image, MapError if the image has no pixels or cannot
    have a pyramid, TableError if the pyramid cannot be written.
    """
    group = getattr(group, "node_tree", group)
    if group is None or IMAGE_TEXTURE not in group:
        raise SceneError(f'"{getattr(group, "name", None)}" is not a {NAME} group: add one from the Glint menu.')
    if image is None:
        raise SceneError(f'"{group.name}" needs an image: choose one.')
    script = group.nodes.get(MIPMAP_NODE)
    if bake and script is not None:
        _bake(script, image, folder)
    elif script is not None and image != image_of(group):
        script.inputs["File"].default_value = ""
    group.nodes[NEAREST_NODE].image = group.nodes[BILINEAR_NODE].image = image
    group.nodes[ROW_NODE].outputs[0].default_value = 0.5 / max(image_shape(image)[0], 1)


def bake_missing(folder=None) -> list[str]:
    """Bake the pyramid of every image that a node shows with the filter Mipmap; names of the images baked now.

    Pixels are compared by content, so an image painted since is baked again. Raises as `set_image`.
    """
    baked = []
    for group in _groups_with_mipmap():
        image = image_of(group)
        if image is not None and _bake(group.nodes[MIPMAP_NODE], image, folder):
            baked.append(image.name)
    return baked


def change_paths(group, change):
    """Let change(path) say what stands for the path of the pyramid that a copy of the group names; others name none."""
    script = group.nodes.get(MIPMAP_NODE) if IMAGE_TEXTURE in group else None
    builder.change_text(script.inputs.get("File") if script is not None else None, change)


def shows_mip_levels() -> bool:
    """Whether any node shows an image with the filter Mipmap, which needs OSL and baked levels."""
    return bool(_groups_with_mipmap())


def _groups_with_mipmap():
    owners = [*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners] + list(bpy.data.node_groups)
    nodes = [node for tree in trees if tree is not None for node in tree.nodes if node.type == "GROUP"]
    used = [
        node.node_tree
        for node in nodes
        if node.node_tree is not None and IMAGE_TEXTURE in node.node_tree
        and node.inputs["Filter"].default_value == "Mipmap"
    ]
    return [group for group in dict.fromkeys(used) if MIPMAP_NODE in group.nodes and group.library is None]


def _bake(script, image, folder) -> bool:
    """Bake the pyramid of `image` and point the Script node to it; whether a file was written."""
    # Menus import this module when Blender starts; what bakes is loaded only to bake.
    from ..bake.pyramid import bake_pyramid
    from ..images.stored import stored_image

    stored = stored_image(image)
    path, written = bake_pyramid(
        stored.pixels,
        Path(folder) if folder is not None else paths.table_folder(bpy.data.filepath),
        encoded=stored.encoded,
        associated=stored.associated,
        half=stored.half,
        name=image.name,
    )
    height, width = stored.pixels.shape[:2]
    values = {"File": paths.stored_path(path), "Width": width, "Height": height}
    values |= {"Encoded": int(stored.encoded), "Associated": int(stored.associated)}
    for name, value in values.items():
        script.inputs[name].default_value = value
    return written


def _check_choices(mapping, filter, up):
    choices = (("mapping", mapping, MAPPINGS), ("filter", filter, FILTERS), ("up axis", up, UP_AXES))
    for what, value, allowed in choices:
        if value not in allowed:
            raise SceneError(f'Image texture {what} "{value}" is unknown: use one of {", ".join(allowed)}.')


def _new_tree():
    group = builder.new_group(NAME, VERSION, "Image by UV map or on a sphere: nearest, bilinear, or mipmapped with OSL")
    group[IMAGE_TEXTURE] = True
    _add_sockets(group)
    inputs = builder.add_node(group, "NodeGroupInput")
    vector = _add_mapping(group, inputs)
    _add_filters(group, inputs, vector)
    for socket, value in (("Mapping", "UV"), ("Filter", "Mipmap"), ("Up Axis", "Z")):
        group.interface.items_tree[socket].default_value = value
    builder.arrange(group)
    return group


def _add_sockets(group):
    for socket in OUTPUTS:
        builder.add_output(group, socket)
    for socket in INPUTS:
        builder.add_input(group, socket)
    group.interface.items_tree["Vector"].hide_value = True


def _add_menu(group, socket, data_type, label, sources):
    """A Menu Switch over `sources` (item name -> socket or constant); its output."""
    node = builder.add_node(group, "GeometryNodeMenuSwitch", label, data_type=data_type)
    node.enum_definition.enum_items.clear()
    for name in sources:
        node.enum_definition.enum_items.new(name)
    group.links.new(socket, node.inputs["Menu"])
    for name, source in sources.items():
        if isinstance(source, bpy.types.NodeSocket):
            group.links.new(source, node.inputs[name])
        else:
            node.inputs[name].default_value = source
    return node.outputs[0]


def _add_mix(group, data_type, factor, a, b, label):
    """A Mix node of `data_type`; factor is a socket or a constant, a and b are sockets. Returns its output."""
    node = builder.add_node(group, "ShaderNodeMix", label, data_type=data_type)
    enabled = [socket for socket in node.inputs if socket.enabled]
    for source, target in zip((factor, a, b), enabled, strict=True):
        if isinstance(source, bpy.types.NodeSocket):
            group.links.new(source, target)
        else:
            target.default_value = source
    return next(socket for socket in node.outputs if socket.enabled)


def _add_mapping(group, inputs):
    """Texture coordinates; z is 1 where v must not repeat (the poles of the sphere), else 0."""
    uv = builder.add_node(group, "ShaderNodeUVMap", UV_NODE).outputs["UV"]
    flat = builder.add_math(group, "MULTIPLY", inputs.outputs["Vector"], (1, 1, 0), label="Drop z", vector=True)
    sphere = _add_sphere(group, inputs)
    sources = {"UV": uv, "Spherical": sphere, "Vector": flat}
    return _add_menu(group, inputs.outputs["Mapping"], "VECTOR", "Mapping", sources)


def _add_sphere(group, inputs):
    """n = normalized hit - origin; u = atan2(n.x, n.z) / (2 pi) + 0.5, v = n.y * 0.5 + 0.5 with y up."""
    position = builder.add_node(group, "ShaderNodeNewGeometry").outputs["Position"]
    origin = builder.add_node(group, "ShaderNodeObjectInfo").outputs["Location"]
    world = builder.add_math(group, "SUBTRACT", position, origin, label="Hit - Origin", vector=True)
    own = builder.add_node(group, "ShaderNodeTexCoord", "Object Axes").outputs["Object"]
    offset = _add_mix(group, "VECTOR", inputs.outputs["Turn with Object"], world, own, "Axes")
    normal = builder.add_math(group, "NORMALIZE", offset, label="n", vector=True)

    # Blender's z up to y up is a turn about x, so the picture is not mirrored: (x, y, z) -> (x, z, -y).
    axes = builder.add_node(group, "ShaderNodeSeparateXYZ", "Blender's Axes")
    group.links.new(normal, axes.inputs[0])
    turned = builder.add_node(group, "ShaderNodeCombineXYZ", "Y Up")
    group.links.new(axes.outputs["X"], turned.inputs["X"])
    group.links.new(axes.outputs["Z"], turned.inputs["Y"])
    group.links.new(builder.add_math(group, "MULTIPLY", axes.outputs["Y"], -1.0, label="-y"), turned.inputs["Z"])
    upright = _add_menu(group, inputs.outputs["Up Axis"], "VECTOR", "Up Axis", {"Y": normal, "Z": turned.outputs[0]})

    n = builder.add_node(group, "ShaderNodeSeparateXYZ", "n with y up")
    group.links.new(upright, n.inputs[0])
    angle = builder.add_math(group, "ARCTAN2", n.outputs["X"], n.outputs["Z"], label="Longitude")
    u = builder.add_math(group, "MULTIPLY_ADD", angle, 0.5 / math.pi, 0.5, label="u")
    v = builder.add_math(group, "MULTIPLY_ADD", n.outputs["Y"], 0.5, 0.5, label="v")

    # Interpolation must not reach across a pole to the other one: end v at the centres of the outer rows.
    row = builder.add_node(group, "ShaderNodeValue", ROW_NODE).outputs[0]
    last = builder.add_math(group, "SUBTRACT", 1.0, row, label="1 - Half a Row")
    ended = builder.add_math(
        group, "MINIMUM", builder.add_math(group, "MAXIMUM", v, row, label="From"), last, label="To"
    )
    sphere = builder.add_node(group, "ShaderNodeCombineXYZ", "Sphere", inputs={"Z": 1.0})
    group.links.new(u, sphere.inputs["X"])
    group.links.new(ended, sphere.inputs["Y"])
    return sphere.outputs[0]


def _add_filters(group, inputs, vector):
    nearest = builder.add_node(group, "ShaderNodeTexImage", NEAREST_NODE, interpolation="Closest")
    bilinear = builder.add_node(group, "ShaderNodeTexImage", BILINEAR_NODE, interpolation="Linear")
    for node in (nearest, bilinear):
        group.links.new(vector, node.inputs["Vector"])
    color, alpha = bilinear.outputs["Color"], bilinear.outputs["Alpha"]

    # Two Menu Switch nodes on one menu clash, so the menu becomes numbers: 1 for nearest, 1 for mipmap.
    chosen = {"Nearest": (1, 0, 0), "Bilinear": (0, 0, 0), "Mipmap": (0, 1, 0)}
    choice = builder.add_node(group, "ShaderNodeSeparateXYZ", "Chosen")
    group.links.new(_add_menu(group, inputs.outputs["Filter"], "VECTOR", "Filter", chosen), choice.inputs[0])

    # Without OSL the Script node vanishes and its factor is 0: bilinear.
    script = script_node.add_script_node(group, SHADER, MIPMAP_NODE)
    if script is not None:
        group.links.new(vector, script.inputs["Vector"])
        lights = builder.add_node(group, "ShaderNodeGroup", "Scene", node_tree=glint_lights.build())
        group.links.new(lights.outputs[glint_lights.SAMPLES], script.inputs["Samples"])
        active = builder.add_math(group, "MULTIPLY", 0.0, choice.outputs["Y"], label="Mipmap Active")
        group.links.new(script.outputs["Active"], active.node.inputs[0])
        is_linked, probe_alpha = _add_alpha_probe(group)
        group.links.new(is_linked, script.inputs["Straight"])
        color = _add_mix(group, "RGBA", active, color, script.outputs["Color"], "Mipmap Color")
        mixed = _add_mix(group, "FLOAT", active, alpha, script.outputs["Alpha"], "Mipmap Alpha")
        alpha = builder.add_math(group, "MAXIMUM", mixed, probe_alpha, label="Alpha, Probe")

    output = builder.add_node(group, "NodeGroupOutput")
    color = _add_mix(group, "RGBA", choice.outputs["X"], color, nearest.outputs["Color"], "Nearest Color")
    alpha = _add_mix(group, "FLOAT", choice.outputs["X"], alpha, nearest.outputs["Alpha"], "Nearest Alpha")
    group.links.new(color, output.inputs["Color"])
    group.links.new(alpha, output.inputs["Alpha"])


def _add_alpha_probe(group):
    """Whether the group's Alpha output is in use: (1 if it is, else 0; a number below 0 to be made part of Alpha).

    Cycles divides the color of an Image Texture by alpha only if the node's Alpha is linked; our shader cannot see it,
    but it can see what another Image Texture does whose Alpha ends in the same output: white with alpha 0.5 turns gray
    if its Alpha leads nowhere.
    """
    probe = builder.add_node(group, "ShaderNodeTexImage", "Alpha Probe", image=_probe_image())
    is_linked = builder.add_math(group, "GREATER_THAN", probe.outputs["Color"], 0.75, label="Alpha Is Linked")
    return is_linked, builder.add_math(group, "SUBTRACT", probe.outputs["Alpha"], 1.0, label="Below 0")


def _probe_image():
    image = bpy.data.images.get((PROBE, None))
    if image is None:
        image = bpy.data.images.new(PROBE, 1, 1, alpha=True)
        image.generated_color = (1, 1, 1, 0.5)
    return image
