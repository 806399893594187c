"""Random hints and cells as inputs of OSL bodies."""

from __future__ import annotations

import numpy as np

from tests.helpers.osl_functions import ROWS

from .osl_values import frames_near


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
    hint.turns = np.array([[hint.turn_u1, hint.turn_v1], [hint.turn_u2, hint.turn_v2]]).transpose(2, 0, 1)
    return hint


def cells_inputs(rng, inputs, count, most=5, **more):
    """`count` hints' cells on random grids that often overlap, up to most x most cells each, or none: namespaces of
    grid, centre and reach. more: fields (hint, n)."""
    inputs.statements("Cells cells[HINT_COUNT];")
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
        inputs.statements(f"cells_{k}.grid = grid_{k}; cells[{k}] = cells_{k};")
        own.grid = grid
        own.centre = np.stack([own.centre1, own.centre2], axis=1)
        own.reach = np.stack([own.reach1, own.reach2], axis=1)
        found.append(own)
    return found
