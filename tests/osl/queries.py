"""Maps, hints and queries for tests of osl/*.h: as OSL's structs, by their fields, and as their twins take them."""

from __future__ import annotations

import numpy as np

from tests.reference import light_hint

FORMS = ("f1", "f2", "f3")
TURNS = ("turn_u1", "turn_v1", "turn_u2", "turn_v2")
MAP = """
  Map map;
  map.table = "{file}"; map.width = {width}; map.height = {height};
  map.inverse_padded_width = 1.0 / padded_size({width}); map.inverse_padded_height = 1.0 / padded_size({height});
  map.strength = 1.0; map.is_linear = {is_linear}; map.low = 0; map.high = 0; map.kept = 0; map.costs = no_costs();
  map.counts.table = map.table; map.counts.first = 0; map.counts.levels = 0; map.counts.low = 0; map.counts.high = 0;
  map.index = map.table; map.is_indexed = 0; map.visits = {visits}; map.flakes.table = map.table;
  map.flakes.are_there = {has_flakes}; map.flakes.have_colors = 0;
  map.variation = 0; map.tile_u = 0; map.tile_v = 0; map.cut_u = 0; map.cut_v = 0;
"""


def declared_map(file, normals, *, is_linear, visits=4096, has_flakes=False):
    """OSL statements for a Map of strength 1 without counts and index; normals: (height, width, 3), baked as `file`."""
    height, width = normals.shape[:2]
    return MAP.format(file=file.as_posix(), width=width, height=height, is_linear=int(is_linear), visits=visits,
                      has_flakes=int(has_flakes))


def random_hints(rng, count, *, radius=(0.02, 0.5), turn=0.05):
    """Hints with all that a query reads, in frames that are sheared a little."""
    frames = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] + 0.05 * rng.normal(size=(count, 3, 3))
    forms = frames * np.where(frames[:, 2:3, 2:3] < 0, -1.0, 1.0)
    turns = turn * rng.normal(size=(count, 2, 2))
    return whole_hint(forms, turns, rng.uniform(*radius, count))


def whole_hint(forms, turns, radius, extent=1.0):
    """A hint for elements that lie up to `extent` texels, one or (n, 2), from the hit point."""
    turn = 0.5 * np.linalg.norm(turns, axis=1).sum(axis=-1)
    hint = light_hint.HalfVector(None, None, forms, turns, radius, turn)
    return light_hint.turn_over_texels(np.broadcast_to(extent, (len(radius), 2)), hint)


def give_hints(given, hints):
    """Give OSL's `query` these hints; the same hints as OSL gets them. `declared_query` declares the variables."""
    rounded = []
    for number, hint in enumerate(hints):
        forms = given.vectors(", ".join(f"hint{number}.{name}" for name in FORMS), hint.forms)
        turns = given.floats(", ".join(f"hint{number}.{name}" for name in TURNS), hint.turns)
        bounds = np.stack([hint.radius, hint.patch_turn, hint.ball_growth], axis=1)
        names = ("radius", "patch_turn", "ball_growth")
        radius, turn, growth = given.floats(", ".join(f"hint{number}.{name}" for name in names), bounds).T
        given.statements.append(f"  query.hints[{number}] = hint{number};")
        rounded.append(light_hint.HalfVector(None, None, forms, turns, radius, turn, ball_growth=growth))
    return rounded


def declared_query(hints):
    """OSL declarations for `give_hints`."""
    names = ", ".join(f"hint{number}" for number in range(len(hints)))
    return f"  HalfVector {names};\n  Query query;\n  query.hint_count = {len(hints)};\n"


def normals_near(rng, hint, spread):
    """Tangent-space normals (n, 3) whose slopes around the half vectors are `spread` radii wide."""
    slopes = rng.normal(size=(len(hint.radius), 2)) * spread * hint.radius[:, None]
    wanted = np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1)
    n = np.linalg.solve(hint.forms, wanted[..., None])[..., 0]
    return n * rng.uniform(0.3, 1.0, (len(n), 1))
