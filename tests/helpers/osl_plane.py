"""A plane whose every pixel shows what an OSL shader makes of one input row."""

from __future__ import annotations

import bpy
import numpy as np

from glint_addon.bake.openimageio import oiio
from glint_addon.nodes import script_node
from tests.helpers import cycles

SIDE = 32  # pixels; SIDE * SIDE input rows are rendered at once
ROWS = SIDE * SIDE
CAMERA_DISTANCE = 1.5  # plane widths; near, so that the view direction differs from pixel to pixel

SHADER = """
#include "stdcycles.h"
{headers}
shader test(point UV = point(0), point Mapped = point(0), output {kind} Result = 0)
{{
  int test_row = (int)floor(UV[1] * {side}) * {side} + (int)floor(UV[0] * {side});
  float in[{input_size}];
  for (int test_k = 0; test_k < {texels}; ++test_k) {{
    color test_texel = texture("{file}", (test_k + 0.5) / {texels}, (test_row + 0.5) / {rows}, 0, 0, 0, 0);
    in[3 * test_k] = test_texel[0];
    in[3 * test_k + 1] = test_texel[1];
    in[3 * test_k + 2] = test_texel[2];
  }}
  float out[{output_size}];
  for (int test_k = 0; test_k < {output_size}; ++test_k) {{
    out[test_k] = 0;
  }}
{body}
{end}
}}
"""
SHOWN = """
  float test_picture = 0;
  getattribute("object:index", test_picture);
  int test_first = 3 * (int)test_picture;
  Result = color(out[test_first], out[test_first + 1], out[test_first + 2]);
"""


def shader_source(headers, body, inputs, folder, output_size, kind, end):
    """(OSL source, number of rows) of a shader whose inputs are written to `folder`."""
    inputs = np.asarray(inputs, np.float32)
    count, width = inputs.shape
    assert count <= ROWS and np.isfinite(inputs).all()
    texels = 1 << max(-(-width // 3) - 1, 0).bit_length()  # a power of two: only then is a fetch exact
    file = folder / "inputs.exr"
    table = np.zeros((ROWS, 3 * texels), np.float32)
    table[:count, :width] = inputs
    write_floats(file, table.reshape(ROWS, texels, 3))
    included = script_node.with_headers("\n".join(f'#include "{name}"' for name in headers))
    return SHADER.format(
        headers=included, body=body, file=file.as_posix(), side=SIDE, rows=ROWS, texels=texels, input_size=3 * texels,
        output_size=output_size, kind=kind, end=end,
    ), count


def shown_by(source, rotation, shape):
    """(scene, plane) of a shader that a plane which fills the view shows."""
    scene = cycles.empty_scene(size=(SIDE, SIDE))
    cycles.box_filter(scene, 0.01)
    material, shown = cycles.emission_material()
    tree = material.node_tree
    text = bpy.data.texts.new("Test shader")
    text.from_string(source)
    script_node._let_oslquery_be_imported()
    node = tree.nodes.new("ShaderNodeScript")
    node.script = text
    if not node.bytecode or "UV" not in node.inputs:
        script_node.compile_script_node(node)
    coordinates = tree.nodes.new("ShaderNodeUVMap")
    tree.links.new(coordinates.outputs["UV"], node.inputs["UV"])
    normals = tree.nodes.new("ShaderNodeNormalMap")
    tree.links.new(coordinates.outputs["UV"], normals.inputs["Color"])
    tree.links.new(normals.outputs["Normal"], node.inputs["Mapped"])
    result = node.outputs["Result"]
    if result.type == "SHADER":
        shown = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial").inputs["Surface"]
    tree.links.new(result, shown)

    # A plane of width 1 that fills the view; both hang on one empty.
    plane = shape(scene, 1.0, material=material)
    camera = cycles.add_camera(scene, (0, 0, CAMERA_DISTANCE), angle=2.0 * np.arctan(0.5 / CAMERA_DISTANCE))
    pivot = bpy.data.objects.new("Pivot", None)
    scene.collection.objects.link(pivot)
    plane.parent = camera.parent = pivot
    pivot.rotation_euler = rotation
    bpy.context.view_layer.update()
    return scene, plane


def write_floats(file, pixels):
    """Write (height, width, 3) float32, row 0 at the bottom."""
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(file))
    assert output.open(str(file), oiio.ImageSpec(width, height, channels, oiio.FLOAT)), output.geterror()
    assert output.write_image(np.ascontiguousarray(pixels[::-1])), output.geterror()
    output.close()
