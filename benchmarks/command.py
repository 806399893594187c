"""What the benchmarks' own commands share: a Blender away from the user's settings, results as JSON, a table."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile

from .record import ROOT, write_json

USER_FOLDER = "BLENDER_USER_RESOURCES"


def run_command(name, run, table, file, renew_truth=None):
    """`python -m benchmarks.NAME [--renew-truth]`: store what `run()` measures in `file` and write its `table`.

    renew_truth: makes the truth that the results are compared with again; None if there is none.
    """
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    if renew_truth is not None:
        parser.add_argument("--renew-truth", action="store_true", help="make the stored truth again (minutes), no more")
    options = parser.parse_args()
    if USER_FOLDER not in os.environ:
        # Blender reads its folders once, when it is imported: start again with one that is thrown away.
        with tempfile.TemporaryDirectory(prefix="glint-bench-") as folder:
            command = [sys.executable, "-m", f"benchmarks.{name}", *sys.argv[1:]]
            sys.exit(subprocess.run(command, cwd=ROOT, env={**os.environ, USER_FOLDER: folder}).returncode)
    if renew_truth is not None and options.renew_truth:
        renew_truth()
        return
    results = run()
    write_json(file, results)
    sys.stdout.write(table(results) + "\n")
