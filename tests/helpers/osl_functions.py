"""Call functions of osl/*.h on arrays: a plane whose every pixel shows what the function returns for one input row.

The inputs go through a float texture fetched at texel centres and the outputs through an Emission, both exactly, so a
comparison sees only the rounding of the function itself. A picture shows three outputs; there are as many as needed,
all of the same points.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from glint_addon import paths
from glint_addon.bake.openimageio import oiio
from glint_addon.nodes import script_node
from tests.helpers import cycles

SIDE = 32  # pixels; SIDE * SIDE input rows are rendered at once
ROWS = SIDE * SIDE
CAMERA_DISTANCE = 1.5  # plane widths; near, so that the view direction differs from pixel to pixel

SHADER = """
#include "stdcycles.h"
{headers}
shader test(point UV = point(0), int First = 0, output color Result = color(0))
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
  Result = color(out[First], out[First + 1], out[First + 2]);
}}
"""


def evaluate(headers, body: str, inputs, outputs: int, *, rotation=(0.0, 0.0, 0.0)) -> np.ndarray:
    """What the OSL statements `body` write to out[0..outputs-1] for each row in[] of `inputs`.

    headers: names in the osl folder, in order of inclusion; inputs: (n <= 1024, k) float32. Returns (n, outputs)
    float32. P, I and Ng are those of a plane of width 1 seen by a perspective camera, turned by `rotation` (Euler XYZ).
    """
    inputs = np.asarray(inputs, np.float32)
    count, width = inputs.shape
    assert count <= ROWS and np.isfinite(inputs).all()
    texels = 1 << max(-(-width // 3) - 1, 0).bit_length()  # a power of two: only then is a fetch exact
    pictures = -(-outputs // 3)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "inputs.exr"
        table = np.zeros((ROWS, 3 * texels), np.float32)
        table[:count, :width] = inputs
        _write_floats(file, table.reshape(ROWS, texels, 3))
        source = SHADER.format(
            headers="\n".join(paths.shader_file(name).read_text(encoding="utf-8") for name in headers),
            body=body, file=file.as_posix(), side=SIDE, rows=ROWS, texels=texels, input_size=3 * texels,
            output_size=3 * pictures,
        )
        scene, node = _scene(source, rotation)
        values = np.empty((ROWS, 3 * pictures), np.float32)
        for first in range(0, 3 * pictures, 3):
            node.inputs["First"].default_value = first
            values[:, first : first + 3] = cycles.rendered(scene)[..., :3].reshape(ROWS, 3)
    return values[:count, :outputs]


def _scene(source, rotation):
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
    tree.links.new(node.outputs["Result"], shown)

    # A plane of width 1 that fills the view; both hang on one empty.
    plane = cycles.add_plane(scene, 1.0, material=material)
    camera = cycles.add_camera(scene, (0, 0, CAMERA_DISTANCE), angle=2.0 * np.arctan(0.5 / CAMERA_DISTANCE))
    pivot = bpy.data.objects.new("Pivot", None)
    scene.collection.objects.link(pivot)
    plane.parent = camera.parent = pivot
    pivot.rotation_euler = rotation
    bpy.context.view_layer.update()
    return scene, node


def _write_floats(file, pixels):
    """Write (height, width, 3) float32, row 0 at the bottom."""
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(file))
    assert output.open(str(file), oiio.ImageSpec(width, height, channels, oiio.FLOAT)), output.geterror()
    assert output.write_image(np.ascontiguousarray(pixels[::-1])), output.geterror()
    output.close()
