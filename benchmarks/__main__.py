"""`python -m benchmarks run|report|quick|truth`: measure, write the tables, gate on counts, renew a truth."""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
# Modules beside this one with a command line of their own.
OTHERS = ("query", "sweep", "dolly", "temporal", "no_hints", "lights", "light_size", "by_nodes", "denoise", "bake",
          "generate", "surfaces", "endless", "preset_cost")


def main(arguments=None) -> int:
    """Command line; returns the exit code. Results go to files, what is said to standard error."""
    options = _parser().parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="glint-benchmark-") as home:
        # Before Blender is imported: tables are not to be left in the user's folder.
        os.environ["BLENDER_USER_RESOURCES"] = home
        return options.command(options)


def _parser():
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure run time against error.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="measure scenes, each in a Blender of its own, then write the report")
    run.add_argument("--only", metavar="SCENE", nargs="+", help="these scenes alone, and nothing but scenes")
    run.add_argument("--largest", metavar="SECONDS", type=float, default=math.inf,
                     help="leave out larger budgets, but not the samples of the headline")
    run.set_defaults(command=_run)
    scene = commands.add_parser("scene", help="measure one scene in this process")
    scene.add_argument("name")
    scene.add_argument("--largest", metavar="SECONDS", type=float, default=math.inf)
    scene.set_defaults(command=_scene)
    report = commands.add_parser("report", help="write RESULTS.md, the plots and the table of benchmarks/README.md")
    report.set_defaults(command=_report)
    quick = commands.add_parser("quick", help="compare counts of two scenes with their limits")
    quick.add_argument("--renew", action="store_true", help="make the counts as they are the new limits")
    quick.set_defaults(command=_quick)
    truth = commands.add_parser("truth", help="render the stored truth of scenes again (minutes to hours each)")
    truth.add_argument("names", metavar="SCENE", nargs="+")
    truth.set_defaults(command=_truth)
    return parser


def _run(options):
    """Each part in a process of its own, so that none finds the other's memory or caches."""
    import bpy  # noqa: F401  (before the modules that need it)

    from . import suite

    unknown = set(options.only or ()) - set(suite.NAMES)
    if unknown:
        _say(f"There is no scene {', '.join(sorted(unknown))}: choose among {', '.join(suite.NAMES)}.")
        return 2
    names = options.only or suite.NAMES
    parts = [(name, ["benchmarks", "scene", name, "--largest", str(options.largest)]) for name in names]
    if not options.only:
        parts += [(name, [f"benchmarks.{name}"]) for name in OTHERS if (FOLDER / f"{name}.py").is_file()]
    failed = [name for name, arguments in parts if not _measured(name, arguments)]
    _report(options)
    if failed:
        _say(f"Not measured: {', '.join(failed)}; see the messages above. The report has what was measured before.")
    return 1 if failed else 0


def _measured(name, arguments) -> bool:
    """Run one part; whether it went well. Blender's own words are shown only if it did not."""
    start = time.monotonic()
    command = [sys.executable, "-m", *arguments]
    done = subprocess.run(command, cwd=FOLDER.parent, capture_output=True, text=True, check=False)
    if done.returncode:
        _say(done.stdout[-2000:] + done.stderr[-4000:])
    _say(f"{name}: {'failed' if done.returncode else 'measured'} in {time.monotonic() - start:.0f} s")
    return done.returncode == 0


def _scene(options):
    import bpy  # noqa: F401

    from . import run

    run.store(options.name, run.measure_scene(options.name, largest=options.largest))
    return 0


def _report(options):
    import bpy  # noqa: F401

    from .report import PAGE, write_report

    write_report()
    _say(f"Tables are in {PAGE.name}, plots in plots, the headline in README.md there")
    return 0


def _quick(options):
    import bpy  # noqa: F401

    from . import quick

    if options.renew:
        quick.renew()
        _say(f"New limits are in {quick.LIMITS.name}: look at what changed before committing them")
        return 0
    sentences = quick.check()
    for sentence in sentences:
        _say(sentence)
    for name in quick.SCENES:
        _say(f"{name}: a sample of Glint takes {quick.time_ratio(name):.3g} times one of Blender's nodes under OSL "
             "(for information)")
    _say("Counts exceed their limits" if sentences else "Counts are within their limits")
    return 1 if sentences else 0


def _truth(options):
    import bpy  # noqa: F401

    from . import truth
    for name in options.names:
        found = truth.renew(name)
        made = f"{found.seeds} x {found.spp} spp, its own noise {found.noise:.3f}" if found.seeds else "exact"
        _say(f"Truth of {name}: {made}")
    return 0


def _say(text):
    sys.stderr.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
