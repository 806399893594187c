"""Make the development environment in .venv: Python 3.13 and the pinned packages of pyproject.toml.

Runs under any Python from 3.11 with pip and the standard library alone. `make` calls it when the stamp is older than
what it depends on; it may be run again at any time. Everything it makes is in .uv and .venv.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
UV_FOLDER = ROOT / ".uv"
STAMP = VENV / ".glint-stamp"  # named in the Makefile too
UV_VERSION = "0.13.9"
PYTHON_VERSION = (ROOT / ".python-version").read_text(encoding="utf-8").strip()
HTTP_TIMEOUT = "300"  # seconds; bpy is 350 MB, and uv's own 30 are short for a slow line

# Libraries that bpy takes from the system, and the package that holds each one on Debian and Ubuntu.
APT_PACKAGES = {
    "libEGL.so": "libegl1",
    "libGL.so": "libgl1",
    "libGLX.so": "libglx0",
    "libICE.so": "libice6",
    "libOpenGL.so": "libopengl0",
    "libSM.so": "libsm6",
    "libX11.so": "libx11-6",
    "libXext.so": "libxext6",
    "libXfixes.so": "libxfixes3",
    "libXi.so": "libxi6",
    "libXrender.so": "libxrender1",
    "libXt.so": "libxt6",
    "libXxf86vm.so": "libxxf86vm1",
    "libgcc_s.so": "libgcc-s1",
    "libgomp.so": "libgomp1",
    "libstdc++.so": "libstdc++6",
    "libxkbcommon.so": "libxkbcommon0",
}


class SetupError(Exception):
    """The environment cannot be made; the text is one sentence with the next step."""


def main() -> int:
    """Make the environment; exit code 0, or 1 with one sentence on standard error."""
    try:
        uv = installed_uv()
        make_venv(uv)
        install_packages(uv)
        check_bpy()
    except SetupError as error:
        print(f"bootstrap: {error}", file=sys.stderr)
        return 1
    STAMP.touch()
    return 0


def installed_uv() -> Path:
    """Path of uv `UV_VERSION` in .uv, put there by pip if it is missing; pip alone is needed, not the venv module."""
    uv = UV_FOLDER / "bin" / ("uv.exe" if os.name == "nt" else "uv")
    if _output(uv, "--version").startswith(f"uv {UV_VERSION}"):
        return uv
    say(f"Installing uv {UV_VERSION} into .uv")
    # A user's pip settings for their own environments must not apply to this private folder.
    settings = {"PIP_USER": "0", "PIP_REQUIRE_VIRTUALENV": "0", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--upgrade", "--target", UV_FOLDER]
    run(
        [*command, f"uv=={UV_VERSION}"],
        "uv cannot be installed with pip: check the network and run make again",
        settings,
    )
    return uv


def make_venv(uv: Path):
    """Make .venv with Python `PYTHON_VERSION`, found on this machine or downloaded by uv; keep one that is right."""
    if _output(venv_python(), "-c", "import sys; print('%d.%d' % sys.version_info[:2])").strip() == PYTHON_VERSION:
        return
    say(f"Making .venv with Python {PYTHON_VERSION}")
    run(
        [uv, "venv", "--quiet", "--clear", "--python", PYTHON_VERSION, VENV],
        f"Python {PYTHON_VERSION} is neither on this machine nor can it be downloaded: install it "
        f"(for example with `pyenv install {PYTHON_VERSION}`) and run make again",
    )


def install_packages(uv: Path):
    """Install the group `dev` of pyproject.toml into .venv."""
    say("Installing the pinned packages (bpy is about 350 MB the first time)")
    run(
        [uv, "pip", "install", "--quiet", "--python", venv_python(), "--group", ROOT / "pyproject.toml:dev"],
        "The packages of pyproject.toml cannot be installed: check the network and free space and run make again",
        {"UV_HTTP_TIMEOUT": os.environ.get("UV_HTTP_TIMEOUT", HTTP_TIMEOUT)},
    )


def check_bpy():
    """Import bpy in a process of its own.

    Raises SetupError with the system packages to install if libraries are missing.
    """
    result = _run([venv_python(), "-c", "import bpy"])
    if result.returncode == 0:
        return
    words = result.stderr + result.stdout
    if missing := missing_libraries(words):
        raise SetupError(missing_sentence(missing))
    last = words.strip().splitlines()[-1] if words.strip() else f"exit code {result.returncode}"
    raise SetupError(f"bpy cannot be imported ({last}): repair what it names and run make again.")


def missing_libraries(words: str) -> list[str]:
    """Shared libraries the loader did not find: the one named in `words`, and what ldd says of bpy's own file."""
    missing = set(re.findall(r"(\S+): cannot open shared object file", words))
    if not missing:
        return []
    for file in VENV.glob("lib/python*/site-packages/bpy/__init__*.so"):
        missing |= set(re.findall(r"(\S+) => not found", _output("ldd", file)))
    return sorted(missing)


def missing_sentence(libraries: list[str]) -> str:
    """One sentence that names the missing libraries and the packages that hold them."""
    packages = [APT_PACKAGES.get(name.partition(".so")[0] + ".so") for name in libraries]
    sentence = f"bpy needs system libraries that are missing ({', '.join(libraries)})"
    if None in packages:
        return f"{sentence}: install the packages that hold them and run make again."
    return f"{sentence}: run `apt install {' '.join(sorted(packages))}` as root and run make again."


def venv_python() -> Path:
    """The Python inside .venv."""
    return VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def say(text: str):
    """Tell what takes long."""
    print(f"bootstrap: {text}", flush=True)


def run(command: list, failure: str, settings: dict[str, str] | None = None):
    """Run `command` quietly with `settings` added to the environment; raise SetupError(failure) with its last words."""
    result = _run(command, settings)
    if result.returncode != 0:
        sys.stderr.write(result.stdout + result.stderr)
        raise SetupError(f"{failure}.")


def _run(command: list, settings: dict[str, str] | None = None) -> subprocess.CompletedProcess:
    environment = {**os.environ, **(settings or {})}
    words = [str(word) for word in command]
    try:
        return subprocess.run(words, capture_output=True, text=True, env=environment, cwd=ROOT, check=False)
    except OSError as error:  # not there, or not a program
        return subprocess.CompletedProcess(words, 127, "", str(error))


def _output(*command) -> str:
    result = _run(list(command))
    return result.stdout


if __name__ == "__main__":
    sys.exit(main())
