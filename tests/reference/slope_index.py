"""Numpy twin of osl/slope_index.h, of one sample: texels are visited one by one, whatever the index lists."""

from __future__ import annotations

import numpy as np

from . import slope_cells
from .constants import constants
from .slope_cells import SIDE

NUMBERS = constants("slope_index.h")
SELECTION = constants("selection.h")
REGION = constants("light_hint.h")["REGION"]
CLOSE = 1e-5  # relative distance from a condition's limit at which rounding may decide


def strengthened(n, strength):
    """Normals (..., 3) with the Strength of a Normal Map node; those that are 0 stay so."""
    share = np.clip(strength, 0.0, 1.0)
    strong = np.stack([n[..., 0] * strength, n[..., 1] * strength, 1 + (n[..., 2] - 1) * share], axis=-1)
    return np.where(n.any(axis=-1, keepdims=True), strong, 0.0)


def slopes_at(normals, hint, offset):
    """Slopes (m, 2) around a half vector of normals (m, 3) at offsets (m, 2), and the height above it."""
    forms = normals @ hint.forms.T
    height = np.where(forms[:, 2:] == 0, np.nan, forms[:, 2:])
    return forms[:, :2] / height + offset @ hint.turns.T, forms[:, 2]


def selected_sums(normals, settings, hints, middle, texels, weights, wanted):
    """What selections of the texels (m, 2) of the plane in which the map repeats sum up to, by the hints in `wanted`
    that select them first: the least and the largest number of texels and sum of importances, as rounding may have it.

    normals: (height, width, 3); settings: strength, alpha; hints: namespaces of forms, turns, radius; middle: (2,), as
    the shader's query has it.
    """
    height, width = normals.shape[:2]
    found = strengthened(normals[texels[:, 1] % height, texels[:, 0] % width].astype(float), settings.strength)
    offset = texels + 0.5 - middle
    free = np.ones(len(texels), bool)
    sure = np.zeros(len(texels), bool)
    doubtful = sure.copy()
    importance = np.zeros(len(texels))
    for k, hint in enumerate(hints):
        p, along = slopes_at(found, hint, offset)
        distance = np.linalg.norm(p, axis=1)
        is_near = (along > 0) & (np.abs(distance / hint.radius - 1) < CLOSE)
        inside = (along > 0) & (distance < hint.radius) & free
        if k in wanted:
            width2 = settings.alpha**2 + 0.5 * (hint.radius - REGION * settings.alpha) ** 2
            importance = np.where(
                inside | is_near, weights * (SELECTION["LEAST_IMPORTANCE"] + np.exp(-distance**2 / width2)), importance)
            sure |= inside & ~is_near
        doubtful |= is_near & free
        free &= ~inside
    sure &= ~doubtful
    return (sure.sum(), (sure | doubtful).sum(), importance[sure].sum(), importance[sure | doubtful].sum())


def kernel_of(axes, texels, middle):
    """Weights (m,) of the kernel at the middles of texels (m, 2), and whether each lies so near the rim that rounding
    decides whether it counts."""
    t = (np.linalg.solve(axes, (texels + 0.5 - middle).T) ** 2).sum(axis=0)
    return np.where(t < 1, (1 - t) ** 2, 0.0), np.abs(t - 1) < 1e-4


def visit_listed(normals, settings, hints, middle, axes, block, codes, k):
    """Sums of a visit of elements of a block for hint k. codes: their places in the block; block: first texels in the
    plane `plane` (2,), size (2,), and the bounds low, high (2,) of the tile whose texels are seen there."""
    places = np.stack([codes % SIDE, codes // SIDE], axis=1)
    places = places[places[:, 0] < block.size[0]]
    return plane_sums(normals, settings, hints, middle, axes, seen(block, block.plane + places), {k})


def seen(block, texels):
    """Those of the texels (m, 2) of the plane that lie in the block's own tile."""
    return texels[((texels >= block.low) & (texels < block.high)).all(axis=1)]


def visit_block(normals, settings, hints, middle, axes, block, k):
    """Sums of a visit of all elements of a block for hint k."""
    x, y = np.meshgrid(np.arange(block.size[0]), np.arange(block.size[1]))
    texels = block.plane + np.stack([x, y], axis=-1).reshape(-1, 2)
    return plane_sums(normals, settings, hints, middle, axes, seen(block, texels), {k})


def visit_blocks(normals, settings, hints, middle, axes, low, high):
    """Sums over the texels from low to before high (2,) of the plane that lie under the footprint."""
    x, y = (np.arange(*ends) for ends in zip(low, high, strict=True))
    texels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return plane_sums(normals, settings, hints, middle, axes, texels, set(range(len(hints))))


def index_query(normals, settings, hints, middle, axes):
    """Sums over all elements under the footprint, and the integral of its kernel."""
    reach = np.linalg.norm(axes, axis=1)
    x, y = (np.arange(np.floor(m - r) - 1, np.ceil(m + r) + 1) for m, r in zip(middle, reach, strict=True))
    texels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(int)
    sums = plane_sums(normals, settings, hints, middle, axes, texels, set(range(len(hints))))
    return sums, abs(np.linalg.det(axes)) * np.pi / 3


def plane_sums(normals, settings, hints, middle, axes, texels, wanted):
    """Sums over those of the texels (m, 2) of the plane that lie under the footprint."""
    weights, is_near = kernel_of(axes, texels, middle)
    under = weights > 0
    sums = selected_sums(normals, settings, hints, middle, texels[under], weights[under], wanted)
    # Texels on the rim weigh nothing, but count.
    return sums[0] - is_near.sum(), sums[1] + is_near.sum(), *sums[2:]


def index_serves(texels, map_, hints, query):
    """Whether the index serves each sample (n,), and whether rounding does not decide it.

    texels: the index's list; map_: size (2,), is_linear (n,), strength (n,), visits (n,), is_indexed (n,);
    hints: namespaces of arrays; query: middle (n, 2), axes, area, short_axis.
    """
    count = len(query.area)
    boxes = 2 * np.linalg.norm(query.axes, axis=2) / SIDE + 1
    blocks = boxes.prod(axis=1)
    limits = ((query.area, NUMBERS["INDEX_AREA"], 1), (query.short_axis, NUMBERS["INDEX_SHORT_AXIS"], 1),
              (blocks, NUMBERS["INDEX_BLOCKS"], -1))
    serves, is_clear = (map_.is_indexed != 0) & (map_.is_linear == 0), np.ones(count, bool)
    for value, limit, sign in limits:
        serves = serves & (sign * value >= sign * limit)
        is_clear &= np.abs(value / limit - 1) > CLOSE
    sizes = np.array(map_.size)
    place = np.stack([slope_cells.block_start(np.floor(query.middle[:, k]).astype(int), sizes[k])[1]
                      for k in range(2)], axis=1)
    sides = np.minimum(sizes - SIDE * place, SIDE).prod(axis=1)
    columns = -(-sizes[0] // SIDE)
    record = slope_cells.RECORD * (place[:, 1] * columns + place[:, 0])
    candidates = np.zeros(count)
    zero = np.zeros(count)
    for hint in hints:
        basis = slope_cells.slope_basis(hint.forms)
        upright, margin = slope_cells.region_is_upright(
            basis, zero, zero, hint.radius + hint.reach + SIDE * hint.patch_turn)
        serves &= upright
        is_clear &= ~serves | (np.abs(margin) > 1e-4)
        cells, cells_are_clear = slope_cells.block_cells(
            texels, map_.strength, record, basis, zero, zero, hint.radius + hint.patch_turn)
        is_clear &= cells_are_clear | ~upright
        serves &= cells.is_intact
        for row in range(slope_cells.ROWS):
            start, end = slope_cells.row_elements(texels, record, cells, np.full(count, row))
            candidates += np.where((row >= cells.from2) & (row <= cells.to2), end - start, 0)
        candidates += sides - cells.listed - cells.absent
    share = candidates / sides
    found_cost = NUMBERS["INDEX_TEXEL_COST"]
    listed = SIDE**2 * share * NUMBERS["INDEX_LISTED_COST"]
    index_cost = blocks * (len(hints) * NUMBERS["INDEX_BLOCK_COST"] + listed) + query.area * share * found_cost
    visit_cost = np.where(query.area > map_.visits, map_.visits * found_cost, query.area * NUMBERS["TEXEL_COST"])
    is_clear &= (np.abs(index_cost / visit_cost - 1) > 1e-4) & (np.abs(query.area / map_.visits - 1) > CLOSE)
    return serves & (index_cost < visit_cost), is_clear
