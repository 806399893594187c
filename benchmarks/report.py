"""Tables from the stored results, never typed: RESULTS.md, and the headline in the marked block of README.md here."""

from __future__ import annotations

from importlib import import_module
from statistics import median

from . import headline, methods, plots
from .flip import PERCENTILE
from .headline import BIAS_SPP, FLIP_SPP, HEADLINE_SPP
from .record import RESULTS, ROOT, machine_line, read_json
from .run import FILE

README = ROOT / "benchmarks" / "README.md"
PAGE = ROOT / "benchmarks" / "RESULTS.md"
BEGIN, END = "<!-- bench table: begin -->", "<!-- bench table: end -->"
NOTHING = "Not measured yet: `make bench` does."
MISSING = "-"  # in a cell
# Measured by modules of their own: each writes RESULTS/NAME.json and has `table(results) -> str`.
OTHERS = {
    "query": "One evaluation of the lobe",
    "sweep": "A sample, by the texels in its footprint",
    "dolly": "From one texel in a pixel to a million",
    "temporal": "Moving pictures",
    "no_hints": "A scene without small lights",
    "lights": "Kinds of light",
    "light_size": "A sun of any size",
    "surfaces": "Kinds of surface, and flakes",
    "endless": "Endless surfaces",
    "by_nodes": "By nodes alone, without Open Shading Language",
    "gpu": "By nodes alone, on a GPU",
    "denoise": "Denoising",
    "bake": "Baking, and the start of a render",
    "generate": "Generating microstructure",
    "preset_cost": "What a preset costs",
}
STRESS = RESULTS / "stress.json"
MEGABYTE = 1e6
_STAR = "\\*"


def write_report():
    """Draw the plots, write RESULTS.md and the README's block, all from the results that there are.

    Raises ValueError if the README has no block for the table.
    """
    results = stored_results()
    lines = headline.headlines(results)
    if lines:
        plots.draw_all(results, lines)
    PAGE.write_text(page(results, lines), encoding="utf-8")
    readme = README.read_text(encoding="utf-8")
    README.write_text(with_block(readme, readme_block(lines, results)), encoding="utf-8")


def stored_results() -> dict:
    """What was measured of the scenes so far."""
    return read_json(FILE) if FILE.is_file() else {"scenes": {}}


def with_block(readme: str, table: str) -> str:
    """The text `readme` with `table` between the marks. Raises ValueError if there is not one such block."""
    if readme.count(BEGIN) != 1 or readme.count(END) != 1:
        raise ValueError(f"benchmarks/README.md needs one block between {BEGIN} and {END}: put the marks back.")
    before, rest = readme.split(BEGIN)
    return f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}"


def readme_block(lines, results) -> str:
    """Markdown for the README: the summary picture and the headline figures."""
    return f"{_picture('../docs/benchmark.png')}\n\n{headline_table(lines, results)}" if lines else NOTHING


def headline_table(lines, results) -> str:
    """Markdown: the headline figures over the suite, and over the scenes that only small lights light."""
    small = [line for line in lines if line.small_lights]
    groups = (f"all {len(lines)} scenes", f"the {len(small)} lit by small lights only")
    rows = [("samples of Glint", *(f"median of {group}" for group in groups), "worst scene", "best scene")]
    rows.append(("---", *["---:"] * 4))
    for spp in HEADLINE_SPP:
        ordered = headline.sorted_speed_ups(lines, spp)
        medians = (_median_text(chosen, spp) for chosen in (lines, small))
        rows.append((spp, *medians, _scene_text(ordered[:1]), _scene_text(ordered[-1:])))
    figures = (
        *((f"HDR-FLIP of Glint at {spp} spp / of Blender's nodes in the same time: medians",
           lambda chosen, spp=spp: _flips_text(chosen, spp)) for spp in FLIP_SPP),
        (f"worst energy bias of Glint at {BIAS_SPP} spp, with its own uncertainty", _bias_text),
        ("cost of a sample of Glint / of Blender's nodes under OSL: median, worst", _sample_text),
    )
    others = [("", *groups), ("---",) * 3]
    others += [(name, *(text(chosen) if chosen else "" for chosen in (lines, small))) for name, text in figures]
    return "\n\n".join((
        "Time that Blender's nodes take to Glint's error, in units of Glint's time, both without start-up:",
        _markdown(rows),
        "\\* extrapolated by the nodes' law, error² = c / spp, from the largest budget measured. ≥ Glint's error is "
        "less than the truth's own noise, for which it is taken. (n of m): of the scenes measured at so many samples.",
        _markdown(others),
        machines(results),
    ))


def page(results, lines) -> str:
    """The whole of RESULTS.md."""
    parts = ["# Results", "Written by `python -m benchmarks report` from the files in `results/`; what each number "
             "means is in [README.md](README.md).", "## Headline", *_overview(lines, results)]
    for name, title in OTHERS.items():
        file = RESULTS / f"{name}.json"
        if file.is_file():
            parts += [f"## {title}", import_module(f".{name}", __package__).table(read_json(file)).strip()]
    parts += ["## Error against time"]
    for name, result in results["scenes"].items():
        parts += [f"### {name}", _about(result), f"![Error against time](plots/{name}.png)", row_table(result)]
    if STRESS.is_file():
        parts += ["## Stress", stress_table(read_json(STRESS)["cases"])]
    return "\n\n".join(parts) + "\n"


def scene_table(lines) -> str:
    """Markdown: one line for each scene, how long Blender's nodes take to the lobe's error."""
    rows = [
        ("scene", "texels a pixel", *(f"ratio at {spp} spp" for spp in HEADLINE_SPP),
         *(f"FLIP at {spp} spp / nodes' in that time" for spp in FLIP_SPP), "nodes' exponent", "bias at 64 spp",
         "µs a sample: Glint", "nodes, OSL", "nodes"),
        ("---", *["---:"] * (len(HEADLINE_SPP) + len(FLIP_SPP) + 6)),
    ]
    for line in lines:
        ratios = [_ratio(line.speed_ups[spp]) if spp in line.speed_ups else MISSING for spp in HEADLINE_SPP]
        rows.append((
            line.scene + ("" if line.small_lights else " (large lights)"), f"{line.texels:g}", *ratios,
            *(_flip_pair(line.flips[spp]) if spp in line.flips else MISSING for spp in FLIP_SPP),
            f"{line.law.exponent:.2f}", _bias(line), f"{line.lobe_microseconds:.2f}",
            f"{line.nodes_osl_microseconds:.2f}", f"{line.nodes_microseconds:.2f}",
        ))
    return _markdown(rows)


def row_table(result) -> str:
    """Markdown: every measurement of one scene."""
    rows = [("method", "spp", "seconds", "relative RMSE", "relMSE", "FLIP", f"its {PERCENTILE} %", "bias",
             "µs a sample", "memory, MB", "tables, MB", "start-up, s", "pictures", "R"), ("---", *["---:"] * 13)]
    labels = {method.name: method.label for method in methods.METHODS}
    for row in result["rows"]:
        rows.append((
            labels[row["method"]], row["spp"], f"{row['seconds']:.3f}", f"{row['rmse']:.4f}", f"{row['relmse']:.3g}",
            _flip(row.get("flip")), _flip(row.get("flip_99")), f"{row['bias']:+.1%}", f"{row['microseconds']:.2f}",
            f"{row['memory'] / MEGABYTE:.0f}", f"{row['table_bytes'] / MEGABYTE:.1f}", f"{row['start_up']:.2f}",
            row["seeds"], row["repeats"],
        ))
    return _markdown(rows)


def stress_table(cases) -> str:
    """Markdown: every stress case with its outcome."""
    rows = [("group", "case", "outcome", "nodes", "Glint", "deviations", "note")]
    rows.append(("---",) * 3 + ("---:",) * 3 + ("---",))
    for case in cases:
        values = (case.get(key) for key in ("group", "case", "outcome", "nodes", "lobe", "deviations", "note"))
        rows.append(tuple(_cell(value) for value in values))
    return _markdown(rows)


def machines(results) -> str:
    """One sentence for each machine and state of the program that measured scenes."""
    return " ".join(sorted({machine_line(result["machine"]) for result in results["scenes"].values()}))


def _overview(lines, results):
    if not lines:
        return [NOTHING]
    return [headline_table(lines, results), _picture("../docs/benchmark.png"), "## Scenes", scene_table(lines)]


def _picture(path):
    return f"![How many times longer Blender's nodes take to Glint's error, by scene]({path})"


def _about(result):
    truth = result["truth"]
    flip = f", HDR-FLIP of this noise {truth['flip']:.3f}" if "flip" in truth else ""
    rendered = (f"{truth['seeds']} x {truth['spp']} spp, own noise {truth['noise']:.2%}, of its mean "
                f"{truth['bias_noise']:.2%}{flip}")
    return (f"About {result['texels']:g} texels in a pixel. Truth: {rendered if truth['seeds'] else 'exact'}. "
            f"Scene {result['scene_hash']}, {machine_line(result['machine'])}")


def _ratio(*found):
    """The ratio of one speed-up, or the median of two, marked if one of them is a bound or extrapolated."""
    value = headline.median_ratio(found)
    return f"{'≥ ' * any(each.is_bound for each in found)}{value:.3g}{_STAR * any(each.extrapolated for each in found)}"


def _median_text(lines, spp):
    ordered = headline.sorted_speed_ups(lines, spp)
    if not ordered:
        return MISSING
    return f"**{_ratio(*headline.middle_speed_ups(ordered))}**{_share(len(ordered), lines)}"


def _scene_text(found):
    """At most one speed-up with its scene."""
    return f"{_ratio(*found)} ({found[0].scene})" if found else MISSING


def _flip(value):
    return MISSING if value is None else f"{value:.3f}"


def _flip_pair(pair):
    return f"{_flip(pair.lobe)} / {_flip(pair.nodes)}"


def _flips_text(lines, spp):
    found = headline.median_flips(lines, spp)
    return MISSING if found is None else f"{_flip_pair(found[0])}{_share(found[1], lines)}"


def _share(count, lines):
    """Of how many scenes a median is, unless of all."""
    return "" if count == len(lines) else f" ({count} of {len(lines)})"


def _bias(line):
    spp = "" if line.bias_spp == BIAS_SPP else f" at {line.bias_spp} spp"
    return f"{line.bias:+.2%} ± {line.bias_noise:.2%}{spp}"


def _bias_text(lines):
    worst = headline.worst_bias(lines)
    return f"{_bias(worst)} ({worst.scene})"


def _sample_text(lines):
    worst = max(lines, key=lambda line: line.sample_ratio)
    return f"{median(line.sample_ratio for line in lines):.3g}, {worst.sample_ratio:.3g} ({worst.scene})"


def _cell(value):
    """A value as it may stand in a Markdown cell."""
    if value is None:
        return ""
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.replace("|", "\\|").replace("\n", " ")


def _markdown(rows):
    return "\n".join("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)
