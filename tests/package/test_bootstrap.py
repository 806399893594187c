"""Setting up ends well or in one sentence: Pythons that do not serve, libraries that are missing."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools import bootstrap

ROOT = Path(__file__).resolve().parents[2]
POSIX_SHELL = pytest.mark.skipif(os.name == "nt", reason="find_python.sh is for make, which comes with a POSIX shell")


def find_python(**environment) -> subprocess.CompletedProcess:
    """Run tools/find_python.sh with `environment` added."""
    command = ["sh", str(ROOT / "tools" / "find_python.sh")]
    environment = {**os.environ, **environment}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def fake_python(folder: Path, script: str) -> Path:
    """A program named python3 that is no usable Python."""
    file = folder / "python3"
    file.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    file.chmod(0o755)
    return file


@POSIX_SHELL
def test_a_python_is_found_on_this_machine_and_it_has_pip():
    result = find_python(PYTHON="")
    assert result.returncode == 0, result.stderr
    assert (
        subprocess.run([result.stdout.strip(), "-m", "pip", "--version"], capture_output=True, check=False).returncode
        == 0
    )


@POSIX_SHELL
def test_a_named_python_that_does_not_run_is_refused_in_one_sentence(tmp_path):
    result = find_python(PYTHON=str(fake_python(tmp_path, "exit 127")))
    assert result.returncode == 1 and result.stdout == ""
    assert len(result.stderr.splitlines()) == 1 and "is not a Python 3.11 or newer with pip" in result.stderr


@POSIX_SHELL
def test_a_shim_that_fails_is_passed_over(tmp_path):
    fake_python(tmp_path, "echo 'pyenv: version 3.13 is not installed' >&2; exit 127")
    result = find_python(PYTHON="", PATH=f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert result.returncode == 0 and str(tmp_path) not in result.stdout


def test_missing_libraries_become_packages_to_install(monkeypatch):
    words = "ImportError: libXi.so.6: cannot open shared object file: No such file or directory"
    monkeypatch.setattr(
        bootstrap, "_output", lambda *command: "\tlibSM.so.6 => not found\n\tlibm.so.6 => /lib/libm.so.6"
    )
    missing = bootstrap.missing_libraries(words)
    assert missing == ["libSM.so.6", "libXi.so.6"]
    assert "run `apt install libsm6 libxi6` as root" in bootstrap.missing_sentence(missing)


def test_an_unknown_library_is_named_without_a_guess():
    sentence = bootstrap.missing_sentence(["libnew.so.3"])
    assert "libnew.so.3" in sentence and "apt" not in sentence


@pytest.mark.skipif(shutil.which("readelf") is None, reason="reads the module's header with binutils' readelf")
def test_every_library_that_bpy_takes_from_the_system_has_a_package():
    module = Path(importlib.util.find_spec("bpy").origin)
    text = subprocess.run(["readelf", "-d", module], capture_output=True, text=True, check=False).stdout
    needed = {line.split("[")[1].rstrip("]") for line in text.splitlines() if "(NEEDED)" in line}
    own = {file.name for file in (module.parent / "lib").iterdir()}
    # The C library is there wherever a Python is.
    c_library = {"libc.so", "libdl.so", "libm.so", "libpthread.so", "librt.so", "libutil.so", "ld-linux-x86-64.so"}
    system = {name.partition(".so")[0] + ".so" for name in needed - own} - c_library
    assert system and system <= set(bootstrap.APT_PACKAGES)


def test_a_step_that_fails_says_what_to_do_and_shows_the_program_s_words(capfd):
    with pytest.raises(bootstrap.SetupError, match=r"^No luck: try again\.$"):
        bootstrap.run([sys.executable, "-c", "print('the cause'); exit(1)"], "No luck: try again")
    assert "the cause" in capfd.readouterr().err
