"""The built zip validates, holds what users need and nothing else, installs, works in Blender and goes away again."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.helpers.extension import write_flake_map
from tools import package

ROOT = Path(__file__).resolve().parents[2]
TOP_LEVEL = {"__init__.py", "blender_manifest.toml", "LICENSE", "README.md", "CHANGELOG.md", "farm", "glint_addon",
             "osl"}
SAME_PICTURE = 1e-5  # two renders with one seed differ only by the order of summing
CHILD = Path(__file__).parents[1] / "helpers" / "installed_extension.py"


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """The zip, built and validated by Blender's own packer."""
    return package.build(tmp_path_factory.mktemp("dist"))


def test_the_zip_holds_the_extension_and_nothing_of_the_development(archive):
    with zipfile.ZipFile(archive) as content:
        names = content.namelist()
    assert {name.split("/")[0] for name in names} <= TOP_LEVEL
    assert {"__init__.py", "blender_manifest.toml", "LICENSE", "glint_addon/__init__.py", "osl/glint.osl",
            "farm/glint.openjd.yaml"} <= set(names)
    assert not [name for name in names if name.endswith((".pyc", ".oso", ".blend1"))]


def test_every_source_file_of_the_extension_is_in_the_zip(archive):
    with zipfile.ZipFile(archive) as content:
        names = set(content.namelist())
    sources = [*ROOT.glob("glint_addon/**/*.py"), *ROOT.glob("osl/*.osl"), *ROOT.glob("osl/*.h")]
    assert {str(file.relative_to(ROOT)) for file in sources} <= names


def test_a_broken_manifest_does_not_pass(tmp_path):
    text = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    (tmp_path / "blender_manifest.toml").write_text(text.replace('type = "add-on"', 'type = "adon"'), encoding="utf-8")
    (tmp_path / "__init__.py").touch()
    with pytest.raises(subprocess.CalledProcessError) as error:
        package.run_packer("validate", tmp_path)
    assert "type" in error.value.output


def test_the_zip_installs_works_and_leaves_nothing_behind(archive, tmp_path):
    """Slow: a Blender of its own, which installs, bakes, renders and unregisters."""
    flake_map = write_flake_map(tmp_path / "flakes.png")
    result = subprocess.run(
        # Without the script's folder on the path: its cycles.py is not Blender's.
        [sys.executable, "-P", str(CHILD), str(archive), str(flake_map), str(tmp_path / "saved.blend")],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "home")},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    facts = json.loads(result.stdout.strip().splitlines()[-1])
    assert facts["enabled"] and facts["osl"]
    assert facts["material"] == "Glint flakes"
    assert len(facts["baked"]) == 1 and facts["baked_again"] == []
    assert Path(facts["baked"][0]).parent == tmp_path / "glint_tables"
    # The extension's folder may be read-only: nothing is written there.
    assert facts["files_before"] == facts["files_after"]
    assert facts["state_after"] == facts["state_before"]
    # The file renders the same where the extension is not enabled.
    assert facts["brightness_after"] == pytest.approx(facts["brightness"], rel=SAME_PICTURE)
    assert facts["brightness"] > 0.0
    assert facts["folder_left"] is False
