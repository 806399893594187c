"""`python -m demo_scenes`: render the demo pictures and print what was measured; see README.md beside this file."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

SHOWCASE = ("car_paint", "snow", "metal_and_glitter")
FIGURES = ("constant_colour", "checker_sphere", "image_sphere", "glint_before_after")
COMPARISONS = ("flakes_close", "flakes_far", "scratches_close", "brushed_far")
SHEETS = ("three_ways", "endless")  # several scenes in one picture
ALL = (*SHOWCASE, *FIGURES, *COMPARISONS, *SHEETS)
# What three minutes on two cores do not suffice for.
GALLERY = ("flakes_far", "brushed_far", *SHEETS)
DEMO = tuple(name for name in ALL if name not in GALLERY)


def main(arguments=None) -> int:
    """Command line; returns the exit code. The table goes to standard output, progress to standard error."""
    options = _parser().parse_args(arguments)
    out = Path(options.out)
    _start_blender(out)
    if options.renew_truth:
        return _renew(options.renew_truth)
    if options.preset_list:
        from . import report

        report.update_guide()
        return 0
    if options.presets is not None:
        return _draw_presets(out, options.presets)
    _draw(options.only or (ALL if options.all or options.readme else DEMO), out, readme=options.readme)
    _say(f"Pictures are in {out}")
    return 0


def _parser():
    parser = argparse.ArgumentParser(prog="python -m demo_scenes", description="Render the demo pictures of Glint.")
    parser.add_argument("--only", metavar="NAME", nargs="+", choices=ALL, help=f"scenes: {', '.join(ALL)}")
    parser.add_argument("--all", action="store_true", help=f"all scenes, also {', '.join(GALLERY)}")
    parser.add_argument("--out", default="out", help="folder for pictures and table (default: out)")
    parser.add_argument("--readme", action="store_true",
                        help="all scenes, and put the table into demo_scenes/README.md and pictures into docs")
    parser.add_argument("--presets", metavar="NAME", nargs="*",
                        help="render these presets and their thumbnails instead, or all and the contact sheet")
    parser.add_argument("--preset-list", action="store_true", help="write the presets' list into docs/guide.md instead")
    parser.add_argument("--renew-truth", metavar="NAME", nargs="+", choices=COMPARISONS,
                        help="render the stored truth of these scenes again (minutes each)")
    return parser


def _start_blender(out):
    """Import Blender with a user folder of the demo's own, so that tables are not left in the user's."""
    os.environ["BLENDER_USER_RESOURCES"] = str((out / "user").resolve())
    import bpy  # noqa: F401  (before any other module of Blender)

    import glint_addon

    glint_addon.register()


def _draw(names, out, *, readme):
    """Render scenes, and write the table of those that are compared."""
    from . import report, showcase
    from .comparison import compare
    from .figure import draw_figure

    rows = []
    for name in names:
        _say(f"Rendering {name}")
        if name in SHOWCASE:
            showcase.draw(name, out)
            continue
        scene_module = import_module(f".{name}", __package__)
        if name in COMPARISONS:
            rows += compare(scene_module, out)
        elif name in SHEETS:
            scene_module.draw(out)
        else:
            draw_figure(scene_module, out)
    if rows:
        table = report.table(rows)
        sys.stdout.write(table + "\n")
        report.save(rows, out / "table.json")
        if readme:
            report.update_readme(table, out)


def _draw_presets(out, names) -> int:
    import glint_addon

    from . import presets

    unknown = [name for name in names if name not in glint_addon.presets()]
    if unknown:
        _say(f"There is no preset {', '.join(unknown)}: choose among {', '.join(glint_addon.presets())}.")
        return 2
    presets.draw(out, tuple(names))
    _say(f"Pictures are in {out / 'presets'}")
    return 0


def _renew(names):
    from .comparison import SIZE
    from .stored_truth import renew_truth

    for name in names:
        truth = renew_truth(import_module(f".{name}", __package__), SIZE)
        _say(f"Truth of {name}: {truth.spp} spp, its own noise {truth.noise:.3f}")
    return 0


def _say(text):
    sys.stderr.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
