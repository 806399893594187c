"""Call functions of osl/*.h on arrays: a plane whose every pixel shows what the function returns for one input row.

The inputs go through a float texture fetched at texel centres and the outputs through an Emission, both exactly, so a
comparison sees only the rounding of the function itself. A picture shows three outputs; there are as many as needed,
all of the same points and of a shader that is compiled once: the plane's pass index says which outputs it shows.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.helpers import cycles
from tests.helpers.osl_plane import ROWS, SHOWN, shader_source, shown_by

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


def assert_whole_agree(osl, twin, is_clear, least=0.97):
    """Whole numbers (n,) or yes and no are the same where rounding does not decide: nearly everywhere; and they differ
    from row to row."""
    is_clear = np.broadcast_to(is_clear, np.shape(twin))
    assert is_clear.mean() > least
    assert len(np.unique(np.asarray(twin)[is_clear])) > 1, "the inputs do not exercise more than one answer"
    np.testing.assert_array_equal(np.asarray(osl)[is_clear], np.asarray(twin)[is_clear])


class Inputs:
    """Columns of input rows, and the OSL statements that give them to variables.

    The methods that take values return them as OSL gets them, rounded to float32.
    """

    def __init__(self):
        self.columns, self.statements = [], []

    def floats(self, names: str, values) -> np.ndarray:
        """Give the variables `names` ("a, float b") one column each of `values` (n, ...); (n, ...) float64."""
        return self._give(names, values, "in[{0}]", 1)

    def ints(self, names: str, values) -> np.ndarray:
        return self._give(names, values, "(int)in[{0}]", 1)

    def vectors(self, names: str, values) -> np.ndarray:
        return self._give(names, values, "vector(in[{0}], in[{1}], in[{2}])", 3)

    def _give(self, names, values, expression, size):
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

    def add(self, name: str, values) -> np.ndarray:
        """Give a field, an array's element, or a variable that is declared here, its values: (n,) int64 of whole
        numbers, or float64 of others (n,) and of vectors (n, 3)."""
        values = np.asarray(values)
        kind = "vector" if values.ndim == 2 else "int" if values.dtype.kind in "iub" else "float"
        give = {"vector": self.vectors, "int": self.ints, "float": self.floats}[kind]
        known = give(name if "." in name or "[" in name else f"{kind} {name}", values)
        if kind != "int":
            return known
        assert (known == values).all()
        return known.astype(np.int64)

    def fill(self, name: str, **fields) -> SimpleNamespace:
        """Give a struct that is declared already these fields."""
        return SimpleNamespace(**{field: self.add(f"{name}.{field}", values) for field, values in fields.items()})

    def structure(self, kind: str, name: str, **fields) -> SimpleNamespace:
        """Declare a struct of the type `kind` and give it its fields."""
        self.statements.append(f"  {kind} {name};")
        return self.fill(name, **fields)

    def evaluate(self, headers, declarations: str, body: str, results, **settings) -> np.ndarray:
        """(n, len(results)) float64: the OSL expressions `results` after `body`; `declarations` come before the
        variables get their inputs."""
        shown = [f"  out[{number}] = {result};" for number, result in enumerate(results)]
        text = "\n".join([declarations, *self.statements, body, *shown])
        return evaluate(headers, text, np.concatenate(self.columns, axis=1), len(results), **settings).astype(float)

    def call(self, header: str, body: str, results) -> Results:
        """The OSL expressions `results` after the statements `body`, by expression."""
        results = [*dict.fromkeys(results)]
        return Results(zip(results, self.evaluate((header,), "", body, results).T, strict=True))

    def reflected(self, headers, declarations: str, body: str, sun, **settings) -> np.ndarray:
        """What the closure Result, set by `body`, reflects of a sun: see the function `reflected`."""
        text = "\n".join([declarations, *self.statements, body])
        return reflected(headers, text, np.concatenate(self.columns, axis=1), sun, **settings)


class Results(dict):
    """Values (n,) float64 of OSL expressions, by expression."""

    def stacked(self, *names: str) -> np.ndarray:
        """Several results as columns: (n, len(names))."""
        return np.stack([self[name] for name in names], axis=-1)

    def joined(self, expression: str) -> np.ndarray:
        """The whole number that `split` gave as two results."""
        high, low = split(expression)
        return 4096 * self[high] + self[low]


def split(expression: str) -> tuple[str, str]:
    """A whole number as two results, because a float of the picture is exact only below 2^24."""
    return f"({expression}) / 4096", f"({expression}) % 4096"


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
        scene, plane = shown_by(source, rotation, shape)
        scene.render.use_persistent_data = True  # or each picture would compile the shader again
        values = np.empty((ROWS, pictures, 3), np.float32)
        for picture in range(pictures):
            plane.pass_index = picture
            values[:, picture] = cycles.rendered(scene)[..., :3].reshape(ROWS, 3)
    return values.reshape(ROWS, 3 * pictures)[:count, :outputs]


def reflected(headers, body: str, inputs, sun, *, rotation=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Radiance (n,) float64 that the closure color Result, set by `body`, reflects of a sun without width and of
    irradiance 1 that shines from the world direction `sun`; the rest as `evaluate`. Nothing of it is random."""
    with tempfile.TemporaryDirectory() as folder:
        source, count = shader_source(headers, body, inputs, Path(folder), 3, "closure color", "")
        scene, _ = shown_by(source, rotation, cycles.add_plane)
        cycles.add_sun(scene, sun)
        scene.cycles.light_sampling_threshold = 0.0  # or dim pixels would be black or lighter at random
        return cycles.rendered(scene)[..., 0].reshape(ROWS).astype(float)[:count]
