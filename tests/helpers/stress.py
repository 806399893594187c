"""One stress case: the same scene with Blender's own nodes and with the lobe must give the same light.

`compare` renders both tiny pictures with several seeds and notes what came out in the session's record (the fixture
`stress_record`, see stress_report.py). Choose lights and roughness for which Blender's nodes converge (alpha 0.04 to
0.1, a sun of 2 to 5 degrees, slopes of 0.05 to 0.1) unless the case is about those: rare bright samples are missed by
the variance too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import glint_addon
from demo_scenes import maps
from demo_scenes.measure import luminance
from demo_scenes.truth import truth_material
from tests.helpers import cycles
from tests.helpers.seeds import rendered_seeds

SIZE = (12, 12)  # pixels
# Spp and seeds. A start costs as much as 10^5 samples of the nodes, so few seeds; the pixels tell the variance.
NODES = (512, 2)
LOBE = (16, 2)
# Relative: the pixel filter's blur by the footprint at the picture's edge; also the largest energy the lobe may add.
FLOOR = 0.02
# A quarter has half of its edge inside the picture, where the blur moves light from one to the other.
QUARTER_FLOOR = 0.05
LARGEST_Z = 5.0  # one false alarm in two million comparisons, five of them a case
SURFACE = {"roughness": 0.25}


@dataclass(frozen=True)
class Outcome:
    """What a case rendered: luminance (seeds, rows, columns) of nodes and lobe, row 0 at the bottom."""

    nodes: np.ndarray
    lobe: np.ndarray
    report: dict  # of `prepare_scene`; empty if not prepared

    @property
    def energy(self) -> float:
        """Mean luminance of the lobe relative to the nodes'; nan where these are black."""
        return self.lobe.mean() / self.nodes.mean() if self.nodes.mean() > 0 else math.nan

    @property
    def deviations(self) -> float:
        """Difference of the mean luminance (lobe less nodes) in standard deviations; 0 where both are equal."""
        difference = self.lobe.mean() - self.nodes.mean()
        return difference / math.hypot(_deviation(self.nodes), _deviation(self.lobe)) if difference else 0.0


def compare(
    record,
    build,
    *,
    surface=None,
    normal_map=None,
    flakes=None,
    nodes=NODES,
    lobe=LOBE,
    size=SIZE,
    prepare=True,
    lit=True,
    osl_nodes=False,
    by_nodes=False,
    finite_only="",
    case="",
    note="",
) -> Outcome:
    """Render `build`'s scene with Blender's nodes and with the lobe, record the case, assert that they agree.

    build(scene, material) adds objects, camera, lights and settings to an empty Cycles scene. `surface`: arguments of
    `create_glint_material` (default `SURFACE`). `normal_map`: encoded pixels (height, width, 3), or a function without
    arguments that returns a bpy image (default `gentle_bumps`). `flakes`: a function without arguments that returns the
    images of flakes as arguments of `create_glint_material`. `nodes`, `lobe`: (spp, seeds), at least two seeds.
    `lit`: whether light must come out at all. `osl_nodes`: run the nodes through OSL too, slower and, rarely, another
    answer. `by_nodes`: render the glint material without OSL. `finite_only` says why the nodes are no truth here: then
    the lobe's pixels are only checked to be finite and not negative. `case` tells comparisons of one test apart.
    Raises AssertionError with the numbers.
    """
    surface = SURFACE if surface is None else surface
    scene, image = _scene(normal_map, size)
    images = flakes or dict
    build(scene, truth_material("Truth", image, **surface, **images()))
    scene.cycles.shading_system = osl_nodes
    first = pictures(scene, *nodes)

    scene, image = _scene(normal_map, size)
    build(scene, glint_addon.create_glint_material("Glint", image, **surface, **images()))
    report = glint_addon.prepare_scene(scene) if prepare else {}
    if by_nodes:
        scene.cycles.shading_system = False
    outcome = Outcome(first, pictures(scene, *lobe), report)

    faults = _faults_of_lobe(outcome) or ([] if finite_only else _faults(outcome, lit))
    verdict = "; ".join(faults) or (f"finite only: {finite_only}" if finite_only else "agrees")
    record(case=case, outcome=verdict, nodes=outcome.nodes.mean(), lobe=outcome.lobe.mean(),
           deviations=outcome.deviations, note=note)
    assert not faults, "; ".join(faults)
    return outcome


def pictures(scene, spp, seeds) -> np.ndarray:
    """Luminance (seeds, rows, columns) of renders with different seeds, each of `spp` samples a pixel."""
    return luminance(rendered_seeds(scene, spp, seeds))


def gentle_bumps() -> np.ndarray:
    """Encoded bumps of slope 0.08, on which Blender's nodes converge soon at roughness 0.25: (64, 64, 3)."""
    return maps.bumps(64, std=0.08, width=3.0, seed=4)


def _scene(normal_map, size):
    """An empty Cycles scene and the map as an image: built anew for each material, so that nothing is left over."""
    scene = cycles.empty_scene(size=size)
    source = gentle_bumps() if normal_map is None else normal_map
    return scene, source() if callable(source) else maps.blender_image("Map", source)


def _faults_of_lobe(outcome) -> list[str]:
    """What no picture of the lobe may show, whatever the nodes do."""
    faults = []
    if not np.isfinite(outcome.lobe).all():
        faults.append(f"{np.count_nonzero(~np.isfinite(outcome.lobe))} pixels of the lobe are not finite")
    elif outcome.lobe.min() < 0:
        faults.append(f"a pixel of the lobe is negative: {outcome.lobe.min():.3g}")
    return faults


def _faults(outcome, lit) -> list[str]:
    """Differences between the nodes and the lobe beyond their noise: of the picture and of its quarters."""
    a, b = outcome.nodes, outcome.lobe
    if not np.isfinite(a).all():
        return ["pixels of Blender's nodes are not finite"]
    if lit and not a.mean() > 0:
        return ["the picture is black"]
    faults = []
    rows, columns = (np.array_split(np.arange(n), 2) for n in a.shape[1:])
    parts = [("the picture", slice(None), FLOOR)]
    parts += [(f"quarter {2 * i + j}", (slice(None), r[:, None], c), QUARTER_FLOOR)
              for i, r in enumerate(rows) for j, c in enumerate(columns)]
    for name, part, floor in parts:
        difference = b[part].mean() - a[part].mean()
        deviation = math.hypot(_deviation(a[part]), _deviation(b[part]))
        if abs(difference) > floor * a.mean() + LARGEST_Z * deviation:
            faults.append(f"{name} has {b[part].mean():.4g} with the lobe, {a[part].mean():.4g} with nodes, "
                          f"{difference / max(deviation, 1e-30):.1f} deviations")
    return faults


def _deviation(renders) -> float:
    """Standard deviation of the mean of `renders` (seeds, rows, columns), whose pixels are independent.

    Cycles scrambles each pixel's sequence; where it spreads the error over neighbours as blue noise, this is too much.
    """
    variances = renders.var(axis=0, ddof=1) / len(renders)
    return math.sqrt(variances.mean() / variances.size)
