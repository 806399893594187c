"""Tangent frames: the equations themselves, numpy against OSL, and both against Blender's Normal Map node."""

import bpy
import numpy as np
import pytest

from glint_addon.errors import MapError
from glint_addon.nodes import script_node
from tests.helpers import cycles
from tests.helpers.osl_functions import evaluate
from tests.reference.tangent_frame import (
    basis_around,
    object_to_world,
    tangent_frame,
    tangent_to_world,
    triangle_frame,
)

SIDE = 4  # SIDE x SIDE triangles in one picture
FLOAT32 = 2e-5  # a few dozen float32 operations on unit vectors, UV areas above 2 % of their differences' product
RENDERED = 3e-4  # Cycles' float32 hits, derivatives and tangents, and the colour's own 1e-7


def random_triangles(count, seed=0):
    """(positions (count, 3, 3), uvs (count, 3, 2)) with areas well away from 0; about half of the UVs are mirrored."""
    random = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        position, uv = random.normal(size=(3, 3)), random.uniform(-2, 2, (3, 2))
        edges, (d1, d2) = position[1:] - position[0], uv[1:] - uv[0]
        if np.linalg.norm(np.cross(*edges)) > 0.3 and abs(d1[0] * d2[1] - d1[1] * d2[0]) > 0.3:
            found.append((position, uv))
    return tuple(np.array(parts) for parts in zip(*found, strict=True))


def random_normals(count, seed=1):
    normals = np.random.default_rng(seed).normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2]) + 0.3
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_tangent_and_bitangent_solve_both_equations():
    positions, uvs = random_triangles(500)
    frame = triangle_frame(positions, uvs)
    assert not frame.degenerate.any() and 0.3 < (frame.sign < 0).mean() < 0.7
    for corner in (1, 2):
        du, dv = (uvs[:, corner] - uvs[:, 0]).T[..., None]
        edge = positions[:, corner] - positions[:, 0]
        np.testing.assert_allclose(du * frame.tangent + dv * frame.bitangent, edge, atol=1e-12)


def test_a_square_with_plain_uvs_has_the_axes_as_its_frame():
    frame = triangle_frame([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_allclose(np.stack([frame.tangent, frame.bitangent, frame.normal]), np.diag([2, 2, 1]))
    assert frame.sign == 1
    np.testing.assert_allclose(tangent_to_world(frame, [0.6, 0.0, 0.8]), [0.6, 0.0, 0.8], atol=1e-15)


def test_mirrored_uvs_turn_the_tangent_and_keep_the_normal():
    positions, uvs = random_triangles(50)
    plain, mirrored = triangle_frame(positions, uvs), triangle_frame(positions, uvs * [-1, 1])
    np.testing.assert_allclose(mirrored.tangent, -plain.tangent)
    np.testing.assert_allclose(mirrored.bitangent, plain.bitangent)
    np.testing.assert_array_equal(mirrored.normal, plain.normal)
    np.testing.assert_array_equal(mirrored.sign, -plain.sign)


@pytest.mark.parametrize("orthonormal", [True, False])
def test_the_flat_normal_is_the_triangles_own_and_every_result_a_unit_vector(orthonormal):
    positions, uvs = random_triangles(200)
    frame = triangle_frame(positions, uvs)
    flat = tangent_to_world(frame, np.broadcast_to([0, 0, 1.0], (200, 3)), orthonormal=orthonormal)
    np.testing.assert_allclose(flat, frame.normal, atol=1e-14)
    bent = tangent_to_world(frame, random_normals(200), orthonormal=orthonormal)
    np.testing.assert_allclose(np.linalg.norm(bent, axis=1), 1, atol=1e-14)
    if orthonormal:  # a rotation keeps the angle to the normal
        np.testing.assert_allclose(np.einsum("ij,ij->i", bent, frame.normal), random_normals(200)[:, 2], atol=1e-14)


DEGENERATE_UVS = {
    "all corners in one point": [[0.3, 0.3]] * 3,
    "corners in a line": [[0, 0], [1, 1], [0.5, 0.5]],
    "two corners in one point": [[0, 0], [0, 0], [1, 0]],
    "a line but for rounding": [[0, 0], [1, 1], [0.5, 0.5 + 1e-9]],
}


@pytest.mark.parametrize("uvs", DEGENERATE_UVS.values(), ids=DEGENERATE_UVS)
def test_degenerate_uvs_have_a_defined_right_handed_frame(uvs):
    positions, _ = random_triangles(20)
    frame = triangle_frame(positions, np.broadcast_to(uvs, (20, 3, 2)))
    assert frame.degenerate.all() and (frame.sign == 1).all()
    matrix = np.stack([frame.tangent, frame.bitangent, frame.normal], axis=-1)
    np.testing.assert_allclose(np.swapaxes(matrix, 1, 2) @ matrix, np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(matrix), 1, atol=1e-14)


def test_a_triangle_without_area_is_upright_and_not_nan():
    positions, uvs = random_triangles(3)
    positions[1] = positions[1, 0]
    frame = triangle_frame(positions, uvs)
    np.testing.assert_array_equal(frame.degenerate, [False, True, False])
    np.testing.assert_array_equal(frame.normal[1], [0, 0, 1])
    assert np.isfinite(tangent_to_world(frame, random_normals(3))).all()


def test_the_basis_is_right_handed_for_every_normal_also_straight_down():
    normals = np.concatenate([np.random.default_rng(2).normal(size=(500, 3)), [[0, 0, -1], [0, 0, 1], [1, 0, 0]]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first, second = basis_around(normals)
    np.testing.assert_allclose(np.cross(first, second), normals, atol=1e-14)


@pytest.mark.parametrize(
    ("positions", "uvs", "words"),
    [
        (np.zeros((2, 3)), np.zeros((3, 2)), "differ"),
        (np.zeros((5, 3, 3)), np.zeros((4, 3, 2)), "differ"),
        (np.full((3, 3), np.nan), np.zeros((3, 2)), "NaN or infinite"),
    ],
)
def test_wrong_triangles_are_refused_in_one_sentence(positions, uvs, words):
    with pytest.raises(MapError, match=words):
        triangle_frame(positions, uvs)


def test_osl_and_numpy_give_the_same_frames():
    count = 1000
    positions, uvs = random_triangles(count)
    uvs[::10] = uvs[::10, :1]  # a tenth has no UV area
    edges, differences = positions[:, 1:] - positions[:, :1], uvs[:, 1:] - uvs[:, :1]
    cross = np.cross(edges[:, 0], edges[:, 1])
    upright = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    upright[1::2] *= -1  # either side may be the front
    normals = random_normals(count)
    rows = np.concatenate([edges.reshape(count, 6), differences.reshape(count, 4), upright, normals], axis=1)
    rows = rows.astype(np.float32)
    body = """
      TangentFrame frame = tangent_frame(vector(in[0], in[1], in[2]), vector(in[3], in[4], in[5]), in[6], in[7], in[8],
                                         in[9], vector(in[10], in[11], in[12]));
      vector n = vector(in[13], in[14], in[15]);
      vector results[4];
      results[0] = frame.tangent;
      results[1] = frame.bitangent;
      results[2] = tangent_to_world(frame, n, 1);
      results[3] = tangent_to_world(frame, n, 0);
      for (int i = 0; i < 12; ++i) out[i] = results[i / 3][i % 3];
      out[12] = frame.uv_sign;
      out[13] = frame.degenerate;
    """
    osl = evaluate(("tangent_frame.h",), body, rows, 14)

    rows = rows.astype(float)
    frame = tangent_frame(rows[:, :3], rows[:, 3:6], rows[:, 6:8], rows[:, 8:10], rows[:, 10:13])
    np.testing.assert_array_equal(osl[:, 12], frame.sign)
    np.testing.assert_array_equal(osl[:, 13], frame.degenerate)
    assert frame.degenerate.sum() == count / 10 and (frame.sign < 0).any()
    expected = [frame.tangent, frame.bitangent]
    expected += [tangent_to_world(frame, rows[:, 13:], orthonormal=flag) for flag in (True, False)]
    for columns, values in zip(np.split(osl[:, :12], 4, axis=1), expected, strict=True):
        scale = np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1)
        np.testing.assert_allclose(columns / scale, values / scale, atol=FLOAT32)


def triangle_scene(uvs, tilts):
    """A grid of flat triangles that all face the camera above: (scene, mesh object, positions (n, 3, 3))."""
    scene = cycles.empty_scene(size=(8 * SIDE, 8 * SIDE))
    cycles.box_filter(scene, 0.01)
    corners = np.array([[0.1, 0.1, 0], [0.9, 0.15, 0], [0.35, 0.95, 0]])
    grid = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 1, 2) - SIDE / 2
    positions = np.repeat(corners[None], SIDE * SIDE, axis=0)
    positions[..., :2] += grid
    positions[..., 2] = np.einsum("nci,ni->nc", positions[..., :2] - grid, tilts)
    vertices, faces = positions.reshape(-1, 3), np.arange(3 * SIDE * SIDE).reshape(-1, 3)
    material, shown = cycles.emission_material()
    thing = cycles.add_mesh(scene, vertices, faces, uvs=uvs.reshape(-1, 2), material=material)
    cycles.add_camera(scene, (0, 0, 10), width=SIDE)
    return scene, thing, positions, material.node_tree, shown


def shown_normals(scene, tree, socket, shown):
    """What `socket` gives at one pixel well inside each triangle, (n, 3)."""
    # Emission shows no negative colours.
    positive = tree.nodes.new("ShaderNodeVectorMath")
    positive.operation = "MULTIPLY_ADD"
    positive.inputs[1].default_value = positive.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(socket, positive.inputs[0])
    tree.links.new(positive.outputs[0], shown)
    picture = cycles.rendered(scene)[..., :3]
    return 2 * picture[3::8, 3::8].reshape(-1, 3) - 1


def blender_normals(scene, tree, shown, color):
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.inputs["Color"].default_value = (*(0.5 + 0.5 * np.asarray(color)), 1)
    return shown_normals(scene, tree, node.outputs["Normal"], shown)


OSL_TEST = """
#include "stdcycles.h"
%s
shader test(vector Tangent_Normal = vector(0), point UV = point(0), output vector Result = vector(0))
{
  vector upright = backfacing() ? -Ng : Ng;
  TangentFrame frame = tangent_frame(Dx(P), Dy(P), Dx(UV[0]), Dx(UV[1]), Dy(UV[0]), Dy(UV[1]), upright);
  Result = tangent_to_world(frame, Tangent_Normal, 1);
}
"""


def osl_normals(scene, tree, shown, tangent_normal):
    text = bpy.data.texts.new("Test shader")
    text.from_string(OSL_TEST % script_node.with_headers('#include "tangent_frame.h"'))
    script_node._let_oslquery_be_imported()
    node = tree.nodes.new("ShaderNodeScript")
    node.script = text
    if not node.bytecode:
        script_node.compile_script_node(node)
    node.inputs[0].default_value = tangent_normal
    coordinates = tree.nodes.new("ShaderNodeUVMap")
    tree.links.new(coordinates.outputs["UV"], node.inputs["UV"])
    return shown_normals(scene, tree, node.outputs["Result"], shown)


MATRICES = {
    "as it is": ((0, 0, 0), (1, 1, 1)),
    "turned and scaled": ((0, 0, np.pi / 2), (0.95, 0.95, 0.95)),
}


@pytest.mark.parametrize(("rotation", "scale"), MATRICES.values(), ids=MATRICES)
def test_rendered_frames_are_those_of_numpy_and_of_blenders_normal_map_node(rotation, scale):
    _, uvs = random_triangles(SIDE * SIDE, seed=3)
    tilts = np.random.default_rng(4).uniform(-0.7, 0.7, (SIDE * SIDE, 2))
    scene, thing, positions, tree, shown = triangle_scene(uvs, tilts)
    thing.rotation_euler, thing.scale = rotation, scale
    bpy.context.view_layer.update()
    tangent_normal = np.array([0.4, -0.5, 0.7])
    tangent_normal /= np.linalg.norm(tangent_normal)

    frame = triangle_frame(positions, uvs)
    assert 0.2 < (frame.sign < 0).mean() < 0.8
    expected = object_to_world(tangent_to_world(frame, tangent_normal[None]), thing.matrix_world)
    if rotation[2]:
        # A quarter turn takes cell (column, row) to (SIDE - 1 - row, column).
        expected = np.rot90(expected.reshape(SIDE, SIDE, 3).transpose(1, 0, 2), 1).transpose(1, 0, 2).reshape(-1, 3)
    np.testing.assert_allclose(blender_normals(scene, tree, shown, tangent_normal), expected, atol=RENDERED)
    np.testing.assert_allclose(osl_normals(scene, tree, shown, tangent_normal), expected, atol=RENDERED)


def test_under_uneven_scale_object_space_normals_turn_as_blenders():
    _, uvs = random_triangles(SIDE * SIDE, seed=5)
    scene, thing, positions, tree, shown = triangle_scene(uvs, np.full((SIDE * SIDE, 2), 0.4))
    thing.scale = (1, 1, 3)
    bpy.context.view_layer.update()
    tangent_normal = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])
    local = tangent_to_world(triangle_frame(positions, uvs), tangent_normal[None])
    expected = object_to_world(local, thing.matrix_world)
    assert np.abs(expected - local).max() > 0.1
    np.testing.assert_allclose(blender_normals(scene, tree, shown, tangent_normal), expected, atol=RENDERED)


def test_degenerate_uvs_render_without_nan():
    uvs = np.zeros((SIDE * SIDE, 3, 2))
    scene, _, positions, tree, shown = triangle_scene(uvs, np.full((SIDE * SIDE, 2), 0.2))
    tangent_normal = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])
    expected = tangent_to_world(triangle_frame(positions, uvs), tangent_normal[None])
    np.testing.assert_allclose(osl_normals(scene, tree, shown, tangent_normal), expected, atol=RENDERED)
