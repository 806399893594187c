"""Numpy twin of osl/counts_groups.h, one row for each sample. Structs are namespaces of arrays."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from .constants import constants

NUMBERS = constants("counts_groups.h")
KERNEL_VARIANCE = constants("footprint.h")["KERNEL_VARIANCE"]
FAR_GROUPS = int(constants("counts_table.h")["FAR_GROUPS"])
PLASTIC = np.array([constants("query.h")[f"PLASTIC_{k}"] for k in (1, 2)])
MOST_GROUPS = int(NUMBERS["MOST_GROUPS"])
DRAWN_GROUPS = int(NUMBERS["DRAWN_GROUPS"])
SHARED_GROUPS = int(NUMBERS["SHARED_GROUPS"])


def kernel(t):
    """The footprint's kernel at a squared distance from its middle."""
    return np.where(t < 1.0, (1.0 - np.minimum(t, 1.0)) ** 2, 0.0)


def sides(level):
    """Sides (n, 2) of a group along u and v."""
    return np.stack([level.group_u, level.group_v], axis=1)


def blocks_under(level, query):
    """The groups under each footprint. query.middle: (n, 2) texels; query.axes: (n, 2, 2). `ellipse` is the form
    (n, 2, 2) that is 1 on the rim; `edges`: the places (n, 4), in groups, whose whole parts bound the groups."""
    side = 0.5 * sides(level)
    square = query.axes @ query.axes.transpose(0, 2, 1)
    wide = square + (side**2 / (12.0 * KERNEL_VARIANCE))[:, :, None] * np.eye(2)
    reach = np.sqrt(np.einsum("nii->ni", wide))
    # Blocks count whose middles the widened ellipse can contain.
    edges = np.concatenate([query.middle - reach + 0.5 * side, query.middle + reach - 0.5 * side], axis=1)
    edges /= np.tile(2 * side, 2)
    ends = np.floor(edges)
    columns, rows = ends[:, 2] - ends[:, 0] + 1, ends[:, 3] - ends[:, 1] + 1
    is_random = columns * rows > MOST_GROUPS
    some = np.where(level.columns * level.rows == 1, 1, FAR_GROUPS)
    return SimpleNamespace(
        side_u=side[:, 0], side_v=side[:, 1], ellipse=np.linalg.inv(wide), reach=reach, edges=edges,
        first_column=ends[:, 0], first_row=ends[:, 1], columns=columns, rows=rows,
        groups=np.where(is_random, some, columns * rows), is_random=is_random,
        is_thin=side.max(axis=1) > np.linalg.svd(query.axes, compute_uv=False)[:, 1],
    )


def random_group(blocks, level, query, g):
    """Column and row (n, 2) of the group at the g-th random point, weights (n, 4) of its blocks, and the point (n, 2)
    in groups."""
    share = (query.random[:, :2] + np.asarray(g)[:, None] * PLASTIC) % 1.0
    radius = np.sqrt(1.0 - np.cbrt(1.0 - share[:, 0]))
    angle = 2 * np.pi * share[:, 1]
    point = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    place = (query.middle + np.einsum("nij,nj->ni", query.axes, point)) / sides(level)
    group = np.floor(place)
    upper = place - group >= 0.5
    at = np.arange(4) == (upper @ [1, 2])[:, None]
    return group, np.where(blocks.is_thin[:, None], at, 1.0), place


def group_under(blocks, level, query, g):
    """Column and row (n, 2) of the g-th group under the footprint, and weights (n, 4) of its blocks: the kernel in
    their middles."""
    group = np.stack([blocks.first_column + g % blocks.columns, blocks.first_row + g // blocks.columns], axis=1)
    weights = []
    for corner in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
        offset = (group + corner) * sides(level) - query.middle
        weights.append(kernel(np.einsum("ni,nij,nj->n", offset, blocks.ellipse, offset)))
    return group, np.stack(weights, axis=1)


def groups_read(hint_count):
    """How many groups a sample reads for each of its hints."""
    return np.minimum(DRAWN_GROUPS, -(-SHARED_GROUPS // hint_count))


def sure_weight(weights, read):
    """The weight from which a group is always read, for one list of weights: that by which the expectation of how many
    are read is `read`; 0: all are read. Found by trying each number of groups that are always read."""
    if len(weights) <= read:
        return 0.0
    lightest = np.sort(weights)
    for large in range(read):
        light = lightest[: len(lightest) - large]
        sure = light.sum() / (read - large)
        if light[-1] <= sure:
            return sure
    raise AssertionError("no weight reads as many groups")


def drawn_groups(groups, weights, sure, odds):
    """Of one list of groups (m, 2) with weights (m, 4): those drawn, their weights, and whether rounding decides no
    draw. A light group is drawn where the sum of its own and all earlier odds reaches a whole number."""
    sums = weights.sum(axis=1)
    if not sure > 0.0:
        return groups, weights, True
    light = sums < sure
    before = odds + np.concatenate([[0.0], np.cumsum(np.where(light, sums / sure, 0.0))])
    is_drawn = ~light | (np.floor(before[1:]) > np.floor(before[:-1]))
    is_clear = (np.abs(before - np.round(before)) > 1e-4)[1:][light].all() and (np.abs(sums / sure - 1) > 1e-4).all()
    scaled = weights * np.where(light, sure / sums, 1.0)[:, None]
    return groups[is_drawn], scaled[is_drawn], bool(is_clear)
