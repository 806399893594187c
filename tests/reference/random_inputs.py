"""Random footprints, hints and cells as inputs of OSL bodies."""

from __future__ import annotations

import numpy as np

from tests.helpers.osl_functions import ROWS


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


def footprint_inputs(inputs, axes: np.ndarray):
    """A struct Footprint named footprint with the size of half axes (n, 2, 2), which are `axes` of what is returned."""
    singular = np.linalg.svd(axes, compute_uv=False)
    fields = inputs.structure(
        "Footprint", "footprint", ux=axes[:, 0, 0], uy=axes[:, 0, 1], vx=axes[:, 1, 0], vy=axes[:, 1, 1],
        area=np.pi * singular.prod(axis=1), long_axis=singular[:, 0], short_axis=singular[:, 1],
    )
    fields.axes = matrices([[fields.ux, fields.uy], [fields.vx, fields.vy]])
    return fields


def matrices(entries) -> np.ndarray:
    """(n, 2, 2) of the entries ((n,), (n,)), ((n,), (n,))."""
    return np.array(entries).transpose(2, 0, 1)


def hint_inputs(rng, inputs, name, slopes, largest_turn=1.0, turn=1e-3):
    """A struct HalfVector at about the slopes (n, 2) of tangent space. largest_turn: over a footprint, relative to the
    radius; turn: by texel."""
    forms = frames_near(rng, slopes)
    world = frames_near(rng, rng.uniform(-0.7, 0.7, (ROWS, 2)), shear=0.0)
    radius = np.exp(rng.uniform(np.log(0.03), np.log(0.6), ROWS))
    turns = turn * rng.normal(size=(4, ROWS))
    hint = inputs.structure(
        "HalfVector", name, h=world[:, 2], t1=world[:, 0], t2=world[:, 1], f1=forms[:, 0], f2=forms[:, 1],
        f3=forms[:, 2], turn_u1=turns[0], turn_v1=turns[1], turn_u2=turns[2], turn_v2=turns[3], radius=radius,
        turn=rng.uniform(0, largest_turn, ROWS) * radius,
    )
    hint.forms = np.stack([hint.f1, hint.f2, hint.f3], axis=1)
    hint.turns = matrices([[hint.turn_u1, hint.turn_v1], [hint.turn_u2, hint.turn_v2]])
    return hint


def cells_inputs(rng, inputs, count, most=5, **more):
    """`count` hints' cells on random grids that often overlap, up to most x most cells each, or none: namespaces of
    grid, centre and reach, and of the matrices a and p if their fields a11, ... are given. more: fields (hint, n)."""
    inputs.statements.append("Cells cells[HINT_COUNT];")
    found = []
    for k in range(count):
        columns, rows = rng.integers(1, most + 1, (2, ROWS))
        none = rng.random(ROWS) < 0.2
        columns, rows = np.where(none, 0, columns), np.where(none, 0, rows)
        start, stride = rng.integers(-2, 14, (2, ROWS)), rng.integers(1, 4, (2, ROWS))
        grid = inputs.structure(
            "Grid", f"grid_{k}", columns=columns, rows=rows, start1=start[0], start2=start[1], stride1=stride[0],
            stride2=stride[1], end1=start[0] + columns * stride[0], end2=start[1] + rows * stride[1],
        )
        size = stride * np.stack([columns, rows])
        own = inputs.structure(
            "Cells", f"cells_{k}", centre1=start[0] + rng.uniform(0.2, 0.8, ROWS) * size[0],
            centre2=start[1] + rng.uniform(0.2, 0.8, ROWS) * size[1], reach1=rng.uniform(0.2, 0.7, ROWS) * size[0],
            reach2=rng.uniform(0.2, 0.7, ROWS) * size[1], **{name: values[k] for name, values in more.items()},
        )
        inputs.statements.append(f"cells_{k}.grid = grid_{k}; cells[{k}] = cells_{k};")
        own.grid = grid
        own.centre = np.stack([own.centre1, own.centre2], axis=1)
        own.reach = np.stack([own.reach1, own.reach2], axis=1)
        for name in {field[0] for field in more if field.endswith("11")}:
            setattr(own, name, matrices([[getattr(own, f"{name}{i}{j}") for j in (1, 2)] for i in (1, 2)]))
        found.append(own)
    return found
