"""What an exact truth needs of a Blender scene: triangles of one mesh, the camera's projection, suns and soft lamps.

Arrays are float64, places in metres and in world space; raster coordinates are pixels from the picture's lower left.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from demo_scenes.measure import LUMINANCE

from .exact_lobe import cross, dot


@dataclass(frozen=True)
class Triangle:
    """Corners in order: places, normals, tangents (3, 3) and uv (3, 2); sign of the bitangent, face normal (3,)."""

    places: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray
    uv: np.ndarray
    sign: float
    face_normal: np.ndarray


@dataclass(frozen=True)
class Camera:
    """raster: (3, 4), takes (x, y, z, 1) to (raster x, raster y, 1) times the third; eye: place (3,) of a perspective
    camera, None of an orthographic one; backward: the direction (3,) to the viewer of an orthographic one."""

    raster: np.ndarray
    eye: np.ndarray | None
    backward: np.ndarray

    def views(self, places) -> np.ndarray:
        """Directions (n, 3) from `places` (n, 3) to the viewer."""
        if self.eye is None:
            return np.broadcast_to(self.backward, places.shape)
        return _unit(self.eye - places)


@dataclass(frozen=True)
class Sun:
    """direction: (3,) to the sun; irradiance: luminance on a surface that faces it; half_angle: radians."""

    direction: np.ndarray
    irradiance: float
    half_angle: float

    def middles(self, places):
        """Directions (n, 3) to the sun's middle, and its angular radius (n,) or ()."""
        return np.broadcast_to(self.direction, places.shape), self.half_angle

    def sample(self, places, u, v):
        """Directions (m, n, 3) to points u, v (m, 1) of the unit disc, and what the disc shines if all were there, ().

        The unit disc maps to the cone evenly in solid angle; the radiance is over pi sin^2 of the half-angle, not over
        the cone (SunLight::area of scene/light.cpp, kernel/light/sun.h).
        """
        u, v = u[..., None], v[..., None]
        square = u * u + v * v
        depth = 1.0 - np.cos(self.half_angle)
        cosine = 1.0 - square * depth
        width = np.sqrt((1.0 - cosine * cosine) / square)
        first, second = _across(self.direction)
        direction = cosine * self.direction + width * (u * first + v * second)
        share = 2.0 * depth / np.sin(self.half_angle) ** 2
        return np.broadcast_to(direction, (len(u), *places.shape)), self.irradiance * share


@dataclass(frozen=True)
class Lamp:
    """A point lamp with soft falloff: a disc of `radius` that turns to face each place (kernel/light/point.h); power:
    luminance in watts."""

    place: np.ndarray
    power: float
    radius: float

    def middles(self, places):
        """Directions (n, 3) to the lamp's middle, and its angular radius (n,) or ()."""
        towards = self.place - places
        distance = np.sqrt(dot(towards, towards))
        return towards / distance[:, None], self.radius / distance

    def sample(self, places, u, v):
        """Directions (m, n, 3) to points u, v (m, 1) of the unit disc, and what the disc shines if all were there,
        (m, n)."""
        towards = self.place - places
        distance = np.sqrt(dot(towards, towards))
        first, second = _across(towards / distance[:, None])
        towards = towards + self.radius * (u[..., None] * first + v[..., None] * second)
        length = np.sqrt(dot(towards, towards))
        # Radiance: the power over pi times the area of the sphere of that radius (PointLight::copy_to_kernel).
        radiance = self.power / (4.0 * np.pi**2 * self.radius**2)
        return towards / length[..., None], radiance * np.pi * self.radius**2 * distance / length**3


def camera(scene) -> Camera:
    """The projection of the scene's camera. Raises ValueError for a lens that is open or panoramic."""
    eye = scene.camera
    if eye.data.type not in {"PERSP", "ORTHO"} or eye.data.dof.use_dof:
        raise ValueError("An exact truth needs a pinhole or orthographic camera: close the lens or render the truth.")
    render = scene.render
    width, height = render.resolution_x, render.resolution_y
    graph = bpy.context.evaluated_depsgraph_get()
    project = np.array(eye.calc_matrix_camera(graph, x=width, y=height), np.float64)
    world = np.array(eye.matrix_world, np.float64)
    half = np.array([[width / 2.0], [height / 2.0]])
    rows = np.concatenate([half * (project[:2] + project[3]), project[3:]])
    place = world[:3, 3] if eye.data.type == "PERSP" else None
    return Camera(rows @ np.linalg.inv(world), place, _unit(world[:3, 2]))


def lights(scene) -> list[Sun | Lamp]:
    """The scene's lights. Raises ValueError for a kind that cannot be summed."""
    if any(node.type == "BACKGROUND" and max(node.inputs["Color"].default_value[:3]) > 0.0
           for node in scene.world.node_tree.nodes):
        raise ValueError("An exact truth needs a black world: render this one.")
    return [_light(obj) for obj in scene.objects if obj.type == "LIGHT"]


def triangles(scene) -> list[Triangle]:
    """Those of the scene's only mesh. Raises ValueError if there are more meshes: one might hide or light another."""
    meshes = [obj for obj in scene.objects if obj.type == "MESH"]
    if len(meshes) != 1 or meshes[0].modifiers:
        raise ValueError("An exact truth needs one mesh without modifiers: render this one.")
    mesh, world = meshes[0].data, np.array(meshes[0].matrix_world, np.float64)
    if not np.allclose(world[:3, :3] @ world[:3, :3].T, np.eye(3), atol=1e-6):
        raise ValueError(f'Object "{meshes[0].name}" is scaled: apply its scale for an exact truth.')
    mesh.calc_loop_triangles()
    corners = np.array([each.loops[:] for each in mesh.loop_triangles])
    smooth = np.array([mesh.polygons[each.polygon_index].use_smooth for each in mesh.loop_triangles])
    co = np.array([mesh.vertices[loop.vertex_index].co[:] for loop in mesh.loops])
    uv = np.array([each.uv[:] for each in mesh.uv_layers.active.data])
    normals = np.array([each.vector[:] for each in mesh.corner_normals])
    tangents, signs = _tangents(mesh)
    found = []
    for index, loops in enumerate(corners):
        places = co[loops] @ world[:3, :3].T + world[:3, 3]
        face = _unit(np.cross(places[1] - places[0], places[2] - places[0]))
        shading = normals[loops] @ world[:3, :3].T if smooth[index] else np.tile(face, (3, 1))
        turned = tangents[loops] @ world[:3, :3].T
        found.append(Triangle(places, shading, turned, uv[loops], signs[loops[0]], face))
    return found


def _light(obj):
    data, world = obj.data, np.array(obj.matrix_world, np.float64)
    power = float(np.array(data.color[:]) @ LUMINANCE) * data.energy
    if data.type == "SUN" and data.angle > 0.0:
        return Sun(_unit(world[:3, 2]), power, data.angle / 2.0)
    if data.type == "POINT" and data.shadow_soft_size > 0.0 and data.use_soft_falloff:
        return Lamp(world[:3, 3], power, data.shadow_soft_size)
    raise ValueError(f'Light "{obj.name}" is neither a sun nor a soft point lamp with a size: render this truth.')


def _tangents(mesh):
    """Tangents (n, 3) and bitangent signs (n,) of the mesh's corners, object space: MikkTSpace's.

    Of the mesh's own faces, quadrilaterals too, as Cycles has them: those of its triangles turn a ball's tangents by
    0.02, which is seen where lobes are sharp (in paint_frame 8 % of relative error).
    """
    mesh.calc_tangents(uvmap=mesh.uv_layers.active.name)
    found = np.array([loop.tangent[:] for loop in mesh.loops]), np.array([loop.bitangent_sign for loop in mesh.loops])
    mesh.free_tangents()
    return found


def _across(directions):
    """Two unit vectors perpendicular to `directions` (..., 3) and to each other."""
    axis = np.eye(3)[np.argmin(np.abs(directions).reshape(-1, 3)[0])]
    first = _unit(cross(directions, axis))
    return first, cross(directions, first)


def _unit(vectors):
    return vectors / np.sqrt(dot(vectors, vectors))[..., None]
