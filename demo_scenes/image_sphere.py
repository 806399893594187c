"""Seed figure: an image on a sphere, here a small planet painted by code."""

from __future__ import annotations

import numpy as np

from glint_addon.nodes import image_choice

from . import maps, stage

NAME = "image_sphere"
TITLE = "Image-textured sphere"
SPP = 32
DENOISE = True
SEED = 8
WAVES = 160  # plane waves in the planet's relief
OCEAN, SHALLOW, LAND, DESERT, ICE = (
    np.array(color) for color in ((10, 38, 92), (30, 96, 140), (40, 104, 42), (176, 150, 90), (240, 244, 248))
)


def build(scene):
    """The room with the planet on the floor."""
    stage.add_room(scene, stage.diffuse_material("Wall", stage.WHITE))
    stage.add_sphere(scene, planet_material())


def planet_material():
    """Diffuse, coloured by the node group Glint Image Texture on a sphere."""
    material = stage.diffuse_material("Planet")
    tree = material.node_tree
    image = maps.blender_image("Planet", planet(), is_data=False)
    texture = image_choice.add_node(tree, image, mapping="SPHERICAL", filter="MIPMAP", up="Z")
    tree.links.new(texture.outputs["Color"], tree.nodes["Diffuse"].inputs["Color"])
    return material


def planet(width=1024) -> np.ndarray:
    """An sRGB picture (width / 2, width, 3), 0..1: longitude along u, height of the unit sphere along v.

    The relief is a sum of plane waves in space, so that it has neither seam nor poles.
    """
    longitude = (np.arange(width) + 0.5) / width * 2 * np.pi
    z = ((np.arange(width // 2) + 0.5) / width * 4 - 1)[:, None]
    ring = np.sqrt(1 - z * z)
    place = np.stack([ring * np.cos(longitude), ring * np.sin(longitude), z + 0 * longitude])

    rng = np.random.default_rng(SEED)
    relief = np.zeros(place.shape[1:])
    for _ in range(WAVES):
        direction = rng.normal(size=3)
        frequency = 2.0 * 2 ** rng.uniform(0, 4)
        wave = np.tensordot(direction / np.linalg.norm(direction) * frequency, place, 1)
        relief += np.cos(wave + rng.uniform(0, 2 * np.pi)) / frequency**0.9
    relief = (relief - relief.mean()) / relief.std()

    # Sea, coast, land, desert by height; ice by latitude; a graticule of 30 degrees shows the mapping.
    steps = [relief < -0.1, relief < 0.12, relief < 0.9]
    picture = np.select([step[..., None] for step in steps], [OCEAN, SHALLOW, LAND], DESERT).astype(float)
    picture[np.abs(z + 0.05 * relief) > 0.9] = ICE
    latitude = np.arcsin(z) + 0 * longitude
    nearest = [np.abs((angle + np.pi / 12) % (np.pi / 6) - np.pi / 12) for angle in (latitude, longitude + 0 * z)]
    on_line = (nearest[0] < 0.006) | (nearest[1] * ring < 0.006)
    picture[on_line] = picture[on_line] * 0.6 + 90
    return picture / 255


def panels(rendered):
    """(label, pixels) pairs; rendered(**options) renders `build(scene, **options)`."""
    return [("Spherical mapping, mipmapped", rendered())]
