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

from glint_addon.bake.openimageio import oiio
from glint_addon.nodes import script_node
from tests.helpers import cycles

SIDE = 32  # pixels; SIDE * SIDE input rows are rendered at once
ROWS = SIDE * SIDE
CAMERA_DISTANCE = 1.5  # plane widths; near, so that the view direction differs from pixel to pixel

SHADER = """
#include "stdcycles.h"
{headers}
shader test(point UV = point(0), point Mapped = point(0), int First = 0, output {kind} Result = 0)
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
SHOWN = "  Result = color(out[First], out[First + 1], out[First + 2]);"

# What may differ between OSL and float64.
EPSILON = 2.0**-23  # float32 rounding of one operation
ROUNDING = 64 * EPSILON  # of some thirty operations on numbers of equal size, some of which cancel partly
FAST_MATH = 2e-5  # OSL's pow and sincos: a few float32 roundings of their argument's own size
FAST_ASIN = 1e-4  # OSL's asin: documented to be exact to 5e-5 radians
MARGIN = 1e-4  # of a condition, relative to the numbers compared: rounding must not decide it


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def each(*vectors) -> tuple[str, ...]:
    """The components of OSL expressions that are vectors."""
    return tuple(f"{vector}[{k}]" for vector in vectors for k in range(3))


def assert_flags_agree(osl, twin, margin):
    """Yes or no is the same where the twin's margin leaves no doubt: nearly everywhere; and both answers occur."""
    clear = np.abs(margin) > MARGIN
    assert clear.mean() > 0.98
    assert 0.03 < twin.mean() < 0.99, "the inputs do not exercise both answers"
    np.testing.assert_array_equal(osl[clear] != 0, twin[clear])


class Inputs:
    """Columns of input rows, and the OSL statements that give them to variables."""

    def __init__(self):
        self.columns, self.statements = [], []

    def floats(self, names: str, values) -> np.ndarray:
        """Give the variables `names` ("a, float b") one column each of `values` (n, ...); (n, ...) float64 as OSL
        gets them, rounded to float32."""
        return self.add(names, values, "in[{0}]", 1)

    def ints(self, names: str, values) -> np.ndarray:
        return self.add(names, values, "(int)in[{0}]", 1)

    def vectors(self, names: str, values) -> np.ndarray:
        return self.add(names, values, "vector(in[{0}], in[{1}], in[{2}])", 3)

    def add(self, names, values, expression, size):
        rounded = np.asarray(values, np.float32)
        columns = rounded.reshape(len(rounded), -1)
        names = [name.strip() for name in names.split(",")]
        assert columns.shape[1] == size * len(names)
        first = sum(column.shape[1] for column in self.columns)
        for number, name in enumerate(names):
            start = first + size * number
            self.statements.append(f"  {name} = {expression.format(start, start + 1, start + 2)};")
        self.columns.append(columns)
        return rounded.astype(float)

    def evaluate(self, headers, declarations: str, body: str, results, **settings) -> np.ndarray:
        """(n, len(results)) float64: the OSL expressions `results` after `body`; `declarations` come before the
        variables get their inputs."""
        shown = [f"  out[{number}] = {result};" for number, result in enumerate(results)]
        text = "\n".join([declarations, *self.statements, body, *shown])
        return evaluate(headers, text, np.concatenate(self.columns, axis=1), len(results), **settings).astype(float)

    def reflected(self, headers, declarations: str, body: str, sun, **settings) -> np.ndarray:
        """What the closure Result, set by `body`, reflects of a sun: see the function `reflected`."""
        text = "\n".join([declarations, *self.statements, body])
        return reflected(headers, text, np.concatenate(self.columns, axis=1), sun, **settings)


def evaluate(
    headers, body: str, inputs, outputs: int, *, rotation=(0.0, 0.0, 0.0), shape=cycles.add_plane
) -> np.ndarray:
    """What the OSL statements `body` write to out[0..outputs-1] for each row in[] of `inputs`.

    headers: names in the osl folder, which include what they use; inputs: (n <= 1024, k) float32. Returns (n, outputs)
    float32. P, I and Ng are those of a plane of width 1 seen by a perspective camera, turned by `rotation` (Euler XYZ).
    shape: makes that plane, or another thing as wide, of (scene, width, material=). Mapped is what Blender's Normal Map
    node makes of the colour (u, v, 0).
    """
    pictures = -(-outputs // 3)
    with tempfile.TemporaryDirectory() as folder:
        source, count = shader_source(headers, body, inputs, Path(folder), 3 * pictures, "color", SHOWN)
        scene, node = shown_by(source, rotation, shape)
        values = np.empty((ROWS, 3 * pictures), np.float32)
        for first in range(0, 3 * pictures, 3):
            node.inputs["First"].default_value = first
            values[:, first : first + 3] = cycles.rendered(scene)[..., :3].reshape(ROWS, 3)
    return values[:count, :outputs]


def reflected(headers, body: str, inputs, sun, *, rotation=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Radiance (n,) float64 that the closure color Result, set by `body`, reflects of a sun without width and of
    irradiance 1 that shines from the world direction `sun`; the rest as `evaluate`. Nothing of it is random."""
    with tempfile.TemporaryDirectory() as folder:
        source, count = shader_source(headers, body, inputs, Path(folder), 3, "closure color", "")
        scene, _ = shown_by(source, rotation, cycles.add_plane)
        cycles.add_sun(scene, sun)
        scene.cycles.light_sampling_threshold = 0.0  # or dim pixels would be black or lighter at random
        return cycles.rendered(scene)[..., 0].reshape(ROWS).astype(float)[:count]


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
    """(scene, Script node) of a shader that a plane which fills the view shows."""
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
    return scene, node


def write_floats(file, pixels):
    """Write (height, width, 3) float32, row 0 at the bottom."""
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(file))
    assert output.open(str(file), oiio.ImageSpec(width, height, channels, oiio.FLOAT)), output.geterror()
    assert output.write_image(np.ascontiguousarray(pixels[::-1])), output.geterror()
    output.close()
