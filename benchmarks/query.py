"""`python -m benchmarks.query`: what one query of the map costs, and how exact it is, by half-width of the footprint.

For the two maps of query_scene.py and each half-width:

* microseconds of one thread that a sample takes above the same material without hints, which is one closure;
* elements visited;
* relative RMSE of the NDF over many footprints and two half vectors, in units of its mean, less the noise of the binned
  truth (query_truth.py): of the enumerated closures alone, and of the whole answer of one sample, whose remainder is
  one random normal. The contrast is the RMSE of an answer that is 0: narrow footprints seldom meet a glint;
* the systematic part of the former, which no number of samples makes up for: far footprints are answered by a few
  groups of blocks drawn at random, and the noise of the draws is averaged away over DRAWS samples. What noise is left
  in their mean is estimated from the differences of its GROUPS, and subtracted.

Bytes a texel are those of the table as Cycles holds it, in 32-bit floats; a bake is timed from pixels to file.
"""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path

import numpy as np

from demo_scenes import measure, stage
from glint_addon.bake.normal_map import decoded_normals
from glint_addon.bake.openimageio import oiio
from glint_addon.bake.table import bake_table
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.nodes.script_node import compile_script_node

from . import query_scene, query_truth
from .command import run_command
from .cost import pinned_samples, render_cost
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "query.json"
REMAINDER = "remainder = plain;"  # the statement of osl/lobe.h that adds the sample's own normal
WALL_STEP = 0.1  # metres
TIMINGS = 3  # renders of `cost.LEAST_SECONDS` or more; their median counts
GROUPS = 4  # renders of independent random numbers
DRAWS = 128  # samples of them all: a noise of 30 % a sample, the most at far footprints, is 3 % in their mean
BAKES = 3  # their median counts


def run() -> dict:
    """Measure everything: {"machine", "alpha", "slope", "footprints", "maps": {name: bytes, bake and rows}}."""
    return {
        "machine": machine(),
        "alpha": query_scene.ALPHA,
        "slope": query_scene.SLOPE,
        "bump_width": query_scene.BUMP_WIDTH,
        "texels": query_scene.TEXELS,
        "footprints": query_scene.SIDE**2,
        "half_vectors": query_scene.HALF_VECTORS,
        "truth_samples": query_truth.SAMPLES,
        "maps": {name: _map_results(name) for name in query_scene.MAPS},
    }


def table(results) -> str:
    """The results of `run` as two Markdown tables."""
    lines = [
        "| map | half-width, texels | microseconds | elements | NDF, relative RMSE | its systematic part | "
        "with the remainder | contrast | truth's noise |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, found in results["maps"].items():
        for row in found["rows"]:
            percents = " | ".join(f"{row[key]:.1%}" for key in ("sample_rmse", "contrast", "noise"))
            time_taken = _three_digits(row["microseconds"])
            lines.append(f"| {name} | {row['half_width']} | {time_taken} | {row['visited']:.0f} | {row['rmse']:.1%} | "
                         f"{_systematic(row)} | {percents} |")
    lines += ["", "| map | interpolation | one closure, microseconds | bytes a texel | bake, seconds |",
              "| --- | --- | ---: | ---: | ---: |"]
    lines += [
        f"| {name} | {found['interpolation'].title()} | {found['plain_microseconds']:.2f} | "
        f"{found['bytes_a_texel']:.1f} | {found['bake_seconds']:.2f} |"
        for name, found in results["maps"].items()
    ]
    note = (
        f"Maps of {results['texels']} x {results['texels']}, slopes of standard deviation {results['slope']} (bumps "
        f"{results['bump_width']:g} texels wide), Beckmann alpha {results['alpha']}; time of one thread; "
        f"{results['footprints']} footprints and {len(results['half_vectors'])} half vectors, "
        f"{results['truth_samples']:.0e} binned samples a row. "
    )
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


def plain_microseconds(kind) -> float:
    """Of one thread for a sample of a QueryMap's material without hints: one closure."""
    scene = _timed_scene(kind, 1)
    query_scene.drop_hints(scene)
    return _microseconds(scene)


def query_microseconds(kind, half_width) -> float:
    """Of one thread for a sample whose footprint has `half_width` texels of a QueryMap, with a small sun hinted."""
    return _microseconds(_timed_scene(kind, half_width))


def ndf_error(kind, half_width, truth) -> dict:
    """Relative RMSE of the NDF of every footprint against an NdfTruth, whose own variance is subtracted."""
    alone, whole, draws = [], [], []
    for half_vector in query_scene.HALF_VECTORS:
        scene, _ = query_scene.query_scene(kind, half_width, half_vector)
        whole.append(measure.luminance(measure.rendered(scene)).ravel())
        drop_remainder(scene)
        alone.append(measure.luminance(measure.rendered(scene)).ravel())
        draws.append(independent_means(scene))
    systematic, uncertainty = systematic_error(np.stack(draws, axis=1), truth)
    return {
        "rmse": relative_rmse(np.stack(alone), truth),
        "systematic_rmse": systematic,
        "systematic_noise": uncertainty,
        "sample_rmse": relative_rmse(np.stack(whole), truth),
        "bias": float(np.mean(alone) / truth.mean.mean() - 1.0),
        "contrast": math.sqrt(np.mean(truth.mean**2) - truth.variance) / float(truth.mean.mean()),
        "noise": truth.noise,
    }


def independent_means(scene) -> np.ndarray:
    """GROUPS means (GROUPS, footprints) of DRAWS samples in all, whose footprints are those of one sample a pixel.

    The lobe takes its random numbers from the place in space, and the first sample of a pixel is always in its middle:
    so the wall is nearer to the camera in each group, which changes nothing else of an orthographic picture.
    """
    wall = scene.objects["Wall"]
    scene.cycles.samples = DRAWS // GROUPS
    means = []
    with pinned_samples(1):
        for group in range(GROUPS):
            wall.location.z = WALL_STEP * group
            means.append(measure.luminance(measure.rendered(scene)).ravel())
    return np.stack(means)


def systematic_error(means, truth) -> tuple[float, float]:
    """(relative RMSE of the expected answer, its standard deviation) against an NdfTruth; an RMSE of 0: cannot be told.

    means: independent answers (groups, half vectors, footprints) of equal variance. From the square of each footprint's
    error the variance of its mean and the truth's are subtracted. The standard deviation takes footprints for
    independent; it is that of the square, so of an RMSE near 0 it is the RMSE that the noise may hide.
    """
    variance = means.var(axis=0, ddof=1) / len(means)
    squares = (means.mean(axis=0) - truth.mean) ** 2 - variance - truth.variance
    scale = float(truth.mean.mean())
    rmse = math.sqrt(max(float(squares.mean()), 0.0)) / scale
    deviation = float(squares.std() / math.sqrt(squares.size)) / scale**2
    # d sqrt(x) = dx / (2 sqrt(x)), but no more than sqrt(dx), which it is at x = 0.
    return rmse, min(deviation / (2.0 * rmse) if rmse > 0.0 else math.inf, math.sqrt(deviation))


def relative_rmse(answer, truth) -> float:
    """Root mean square difference less the truth's variance, in units of the truth's mean; 0 if nothing is left."""
    square = np.mean((answer - truth.mean) ** 2) - truth.variance
    return float(math.sqrt(max(square, 0.0)) / truth.mean.mean())


def drop_remainder(scene):
    """Let the wall's shader return what it enumerates, without the remainder, which is one normal drawn at random.

    Raises RuntimeError if the shader has no such statement any more.
    """
    group, = glint_groups(scene.objects["Wall"].active_material)
    node = group.nodes[SCRIPT_NODE]
    source = node.script.as_string()
    if source.count(REMAINDER) != 1:
        raise RuntimeError(f'The glint shader does not say "{REMAINDER}" once: name what adds the remainder.')
    node.script.from_string(source.replace(REMAINDER, "remainder = 0;"))
    compile_script_node(node)


def visited(kind, half_width) -> float:
    """Mean number of elements that a query visits, told by the shader's counters."""
    scene, _ = query_scene.query_scene(kind, half_width, query_scene.HALF_VECTORS[0])
    group, = glint_groups(scene.objects["Wall"].active_material)
    emission = group.nodes.new("ShaderNodeEmission")
    output = next(node for node in group.nodes if node.bl_idname == "NodeGroupOutput")
    group.links.new(group.nodes[SCRIPT_NODE].outputs["Counters"], emission.inputs["Color"])
    group.links.new(emission.outputs["Emission"], output.inputs["BSDF"])
    return float(measure.rendered(scene)[..., 0].mean(dtype=np.float64))


def bake_cost(kind) -> dict:
    """Bytes a texel of the table in memory, and the seconds of its bake: the median of a few."""
    seconds = []
    for _ in range(BAKES):
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            file, _ = bake_table(decoded_normals(kind.encoded), Path(folder), interpolation=kind.interpolation)
            seconds.append(time.perf_counter() - start)
            spec = oiio.ImageBuf(str(file)).spec()
            bytes_held = spec.width * spec.height * spec.nchannels * 4
    return {"bytes_a_texel": bytes_held / kind.encoded[..., 0].size, "bake_seconds": float(np.median(seconds))}


def _map_results(name):
    kind = query_scene.query_map(name)
    plain = plain_microseconds(kind)
    rows = [
        {
            "half_width": width,
            "microseconds": query_microseconds(kind, width) - plain,
            "visited": visited(kind, width),
            **ndf_error(kind, width, query_truth.stored(name, width)),
        }
        for width in query_scene.HALF_WIDTHS
    ]
    return {"interpolation": kind.interpolation, "plain_microseconds": plain, **bake_cost(kind), "rows": rows}


def _timed_scene(kind, half_width):
    half_vector = query_scene.HALF_VECTORS[0]
    scene, report = query_scene.query_scene(kind, half_width, half_vector, sun_angle=stage.SUN_ANGLE)
    if not report["hints"]:
        raise RuntimeError("The sun of the query scene got no hint, so there is no query to measure.")
    return scene


def _microseconds(scene):
    """Of one sample: the footprint stays that of one sample a pixel, however many are timed."""
    start_up = measure.start_up_seconds(scene)
    times = []
    for _ in range(TIMINGS):
        cost = render_cost(scene, 1, start_up, guess=times[-1].seconds if times else None)
        times.append(cost)
    return float(np.median([cost.microseconds(query_scene.SIDE**2) for cost in times]))


def _systematic(row):
    """The systematic error with its standard deviation; "-" in results from before it was measured."""
    if "systematic_rmse" not in row:
        return "-"
    return f"{row['systematic_rmse']:.1%} ± {row['systematic_noise']:.1%}"


def _three_digits(value):
    """A positive number to three significant digits without an exponent."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


if __name__ == "__main__":
    run_command("query", run, table, FILE, query_truth.renew)
