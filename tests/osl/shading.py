"""A plane under a camera, seen by tests of osl/lobe.h: what OSL knows of its points, and views of random footprints."""

from __future__ import annotations

import numpy as np

from tests.helpers.osl_functions import ROWS, Inputs, each
from tests.reference import lobe

TURNED = (0.2, 0.3, 0.4)  # of the plane, Euler XYZ
SEEN = "vector step_x = Dx(P), step_y = Dy(P);"
SURFACE = (*each("step_x", "step_y", "P", "I", "Ng"), "length(Dx(I)) / length(Dx(P))")
VIEW = SEEN + "View view; Matrix2 texels; Footprint f; Query query;"
TEXELS = "texels.xx, texels.xy, texels.yx, texels.yy"
BASIS = "frame.tangent, frame.bitangent, frame.upright"


def surface_of(osl):
    """The last columns of `osl`, those of SURFACE."""
    vectors = osl[:, -16:-1].reshape(ROWS, 5, 3).transpose(1, 0, 2)
    return lobe.Surface(*vectors, osl[:, -1])


def surface():
    given = Inputs()
    given.floats("float unused", np.zeros(ROWS))
    return surface_of(given.evaluate((), SEEN, "", SURFACE, rotation=TURNED))


def give_view(given, texels, samples, diffuse_distance, *, on_grid=0):
    """Texels by Dx(P) and Dy(P), samples, and metres to a diffuse bounce, as OSL gets them."""
    texels = given.floats(TEXELS, texels)
    samples = given.floats("view.samples", samples)
    metres = given.floats("view.diffuse_distance", diffuse_distance)
    given.statements.append(f"view.texels = texels; view.on_grid = {on_grid};")
    return texels, samples, metres


def random_texels(rng, least, most):
    """Texels (ROWS, 2, 2) by the radius of the ray's cone: of all directions, stretched up to threefold."""
    turns = np.linalg.qr(rng.normal(size=(2, ROWS, 2, 2)))[0]
    size = np.exp(rng.uniform(np.log(least), np.log(most), (ROWS, 1))) * np.exp(rng.uniform(-1.1, 0, (ROWS, 2)))
    return turns[0] * size[:, None] @ turns[1]


def rotation_matrix():
    from mathutils import Euler

    return np.array(Euler(TURNED).to_matrix())
