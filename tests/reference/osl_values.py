"""Inputs and results of OSL functions by name, for the tests that compare osl/*.h with the twins of this folder.

`Inputs` collects arrays and writes the OSL statements that read them back; `call` evaluates a body and gives its
expressions as arrays. What a twin gets is what OSL gets: numbers that float32 has rounded already.
"""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np

from glint_addon.paths import shader_file
from tests.helpers.osl_functions import ROWS, evaluate

EPSILON = 2.0**-23  # float32 rounding of one operation
ROUNDING = 64 * EPSILON  # of some thirty operations on numbers of equal size, some of which cancel partly
MARGIN = 1e-4  # of a condition, relative to the numbers compared: rounding must not decide it


def constants(header: str) -> dict[str, float]:
    """The numbers that osl/`header` defines, by name."""
    text = shader_file(header).read_text(encoding="utf-8")
    found = re.findall(r"^#define (\w+) (-?[\d.]+(?:e-?\d+)?)$", text, re.MULTILINE)
    return {name: float(value) for name, value in found}


class Inputs:
    """Columns of numbers for one body, and the statements that read them from in[]."""

    def __init__(self):
        self.columns = []
        self.lines = []

    def add(self, name: str, values):
        """Give OSL variable (or field, or array element) `name` its values: (n,) whole numbers, (n,) floats, or vectors
        (n, 3). Returns them as OSL sees them: int64, or float64 of what float32 holds."""
        values = np.asarray(values)
        first = len(self.columns)
        if values.ndim == 2:
            rounded = values.astype(np.float32)
            kind, expression = "vector", "vector({})".format(", ".join(f"in[{first + k}]" for k in range(3)))
            self.columns += [*rounded.T]
            known = rounded.astype(float)
        elif values.dtype.kind in "iub":
            kind, expression = "int", f"(int)in[{first}]"
            self.columns.append(values.astype(np.float32))
            known = values.astype(np.int64)
            assert (self.columns[-1] == known).all()
        else:
            kind, expression = "float", f"in[{first}]"
            self.columns.append(values.astype(np.float32))
            known = self.columns[-1].astype(float)
        is_declared = "." in name or "[" in name
        self.lines.append(f"{name} = {expression};" if is_declared else f"{kind} {name} = {expression};")
        return known

    def structure(self, kind: str, name: str, **fields) -> SimpleNamespace:
        """Declare a struct of the type `kind` and give it its fields. Returns them as OSL sees them."""
        self.lines.append(f"{kind} {name};")
        return self.fill(name, **fields)

    def fill(self, name: str, **fields) -> SimpleNamespace:
        """Give a struct that is declared already its fields. Returns them as OSL sees them."""
        return SimpleNamespace(**{field: self.add(f"{name}.{field}", values) for field, values in fields.items()})

    def statements(self, text: str):
        """OSL statements between those that read inputs."""
        self.lines.append(text)


def call(header: str, inputs: Inputs, body: str, results) -> dict[str, np.ndarray]:
    """float64 values (n,) of the OSL expressions `results` after the statements `body`, by expression."""
    results = [*dict.fromkeys(results)]
    assigned = [f"out[{k}] = {expression};" for k, expression in enumerate(results)]
    text = "\n".join([*inputs.lines, body, *assigned])
    values = evaluate((header,), text, np.stack(inputs.columns, axis=1), len(results)).astype(float)
    return dict(zip(results, values.T, strict=True))


def stacked(osl: dict[str, np.ndarray], *names: str) -> np.ndarray:
    """Several results as columns: (n, len(names))."""
    return np.stack([osl[name] for name in names], axis=-1)


def split(expression: str) -> tuple[str, str]:
    """A whole number as two results, because a float of the picture is exact only below 2^24."""
    return f"({expression}) / 4096", f"({expression}) % 4096"


def joined(osl: dict[str, np.ndarray], expression: str) -> np.ndarray:
    """The whole number that `split` gave as two results."""
    high, low = split(expression)
    return 4096 * osl[high] + osl[low]


def assert_whole_agree(osl, twin, is_clear, least=0.97):
    """Whole numbers (n,) or yes and no are the same where rounding does not decide: nearly everywhere; and they differ
    from row to row."""
    is_clear = np.broadcast_to(is_clear, np.shape(twin))
    assert is_clear.mean() > least
    assert len(np.unique(np.asarray(twin)[is_clear])) > 1, "the inputs do not exercise more than one answer"
    np.testing.assert_array_equal(np.asarray(osl)[is_clear], np.asarray(twin)[is_clear])


def random_frames(rng, count: int = ROWS, shear: float = 0.05) -> np.ndarray:
    """Forms f1, f2, f3 (n, 3, 3) of half vectors above the surface, in frames that are sheared a little."""
    frames = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] + shear * rng.normal(size=(count, 3, 3))
    return frames * np.where(frames[:, 2:3, 2:3] < 0, -1.0, 1.0)


def frames_near(rng, slopes, shear: float = 0.05) -> np.ndarray:
    """Forms f1, f2, f3 (n, 3, 3) of half vectors at about the slopes (n, 2), in frames that are sheared a little."""
    count = len(slopes)
    h = np.append(slopes, np.ones((count, 1)), axis=1)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    first = np.cross(h, rng.normal(size=(count, 3)))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(h, first), h], axis=1) + shear * rng.normal(size=(count, 3, 3))


def random_axes(rng, count: int = ROWS, *, largest: float = 3.0, thin: float = 1.0) -> np.ndarray:
    """Half axes (n, 2, 2) in texels of footprints, ((ux, uy), (vx, vy)): up to 10^largest wide, `thin` decades thin."""
    turn, other = rng.uniform(0, 2 * np.pi, (2, count))
    rotation = np.moveaxis(np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]), -1, 0)
    mix = np.moveaxis(np.array([[np.cos(other), -np.sin(other)], [np.sin(other), np.cos(other)]]), -1, 0)
    sizes = 10.0 ** np.stack([rng.uniform(0, largest, count), rng.uniform(-thin, 0, count)], axis=1)
    sizes[:, 1] *= sizes[:, 0]
    return rotation * sizes[:, None, :] @ mix


def footprint_fields(axes: np.ndarray) -> dict[str, np.ndarray]:
    """Fields of the OSL struct Footprint that are the footprint's size, of half axes (n, 2, 2)."""
    singular = np.linalg.svd(axes, compute_uv=False)
    return dict(ux=axes[:, 0, 0], uy=axes[:, 0, 1], vx=axes[:, 1, 0], vy=axes[:, 1, 1],
                area=np.pi * singular.prod(axis=1), long_axis=singular[:, 0], short_axis=singular[:, 1])
