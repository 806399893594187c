"""Build dist/glint-<version>.zip with Blender's own packer, and validate the source and the zip with it.

Runs in the development environment; Blender's packer is a plain Python script inside the bpy module.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def packer() -> Path:
    """Blender's blender_ext.py, found without importing bpy."""
    module = Path(importlib.util.find_spec("bpy").origin).parent
    return next(module.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))


def build(folder: Path) -> Path:
    """Build and validate the extension's zip in `folder`; returns its path.

    Raises CalledProcessError, its output holding Blender's words, if Blender refuses the manifest or the files.
    """
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    archive = folder / f"{manifest['id']}-{manifest['version']}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    run_packer("validate", ROOT)
    run_packer("build", "--source-dir", ROOT, "--output-filepath", archive)
    run_packer("validate", archive)
    return archive


def run_packer(*words):
    """Run Blender's packer quietly."""
    command = [sys.executable, packer(), *words]
    subprocess.run(
        [str(word) for word in command], check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def main() -> int:
    """Build into dist/; exit code 0, or 1 with Blender's words on standard error."""
    try:
        archive = build(ROOT / "dist")
    except subprocess.CalledProcessError as error:
        print(error.output, file=sys.stderr)
        return 1
    print(f"{archive.relative_to(ROOT)}  {archive.stat().st_size / 1024:.0f} KB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
