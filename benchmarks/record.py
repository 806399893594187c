"""What was measured, on what machine, as JSON files that appear whole."""

from __future__ import annotations

import datetime
import json
import os
import platform
import tomllib
from importlib.metadata import version
from pathlib import Path

from demo_scenes.stage import THREADS

ROOT = Path(__file__).resolve().parent.parent
RESULTS = Path(__file__).resolve().parent / "results"


def machine() -> dict:
    """Processor, system, threads used, versions of Blender, numpy and Glint, and the date (UTC)."""
    import bpy

    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": THREADS,
        "system": f"{platform.system()} {platform.machine()}",
        "blender": bpy.app.version_string,
        "numpy": version("numpy"),
        "glint": manifest["version"],
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def machine_line(facts: dict) -> str:
    """One sentence of `machine()` for the foot of a table."""
    return (f"{facts['processor']}, {facts['threads']} threads, {facts['system']}; Blender {facts['blender']}, "
            f"Glint {facts['glint']}; {facts['date']}.")


def processor() -> str:
    """The processor's name, as the system tells it."""
    names = Path("/proc/cpuinfo")
    if names.is_file():
        for line in names.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "processor without a name"


def write_json(file: Path, values):
    """Write `values` to `file`, which is either the old one or the new one, never half of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    new = file.with_name(f"{file.name}.new")
    new.write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    new.replace(file)


def read_json(file: Path):
    """The values in `file`. Raises FileNotFoundError if there is none: run the benchmark."""
    return json.loads(file.read_text(encoding="utf-8"))
