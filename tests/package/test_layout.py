"""The source depends one way only: each room of the package imports the rooms above it in this table, none below."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "glint_addon"

# What each part of the package may import of the others, besides itself; "" is glint_addon/__init__.py.
ALLOWED = {
    "animation": set(),
    "errors": set(),
    "paths": set(),
    "properties": set(),
    "bake": {"errors"},
    "generate": {"errors"},
    "images": {"bake", "errors", "generate", "properties"},
    "nodes": {"bake", "errors", "images", "paths", "properties"},
    "materials": {"bake", "errors", "generate", "images", "nodes", "paths", "properties"},
    "lights": {"animation", "bake", "errors", "images", "materials", "nodes"},
    "seen": {"animation", "bake", "materials", "nodes"},
    "choice": {"animation", "lights", "materials", "nodes", "seen"},
    "prepare": {
        "animation", "bake", "choice", "errors", "images", "lights", "materials", "nodes", "paths", "properties",
        "seen",
    },
    "operators": {"errors", "generate", "images", "materials", "nodes", "prepare", "properties"},
    "cli": {"bake", "errors", "materials", "nodes", "operators", "paths", "prepare"},
    "ui": {"errors", "generate", "images", "materials", "nodes", "operators", "prepare"},
    "": {"cli", "operators", "prepare", "ui"},
    "__main__": {"", "cli"},
}
MODULES = sorted(ADDON.rglob("*.py"))
# Strings that begin like the name of a property and are none: names of files on disk, by the module they stand in.
FILE_NAMES = {"paths.py": {"glint_tables"}, "bake/float_image.py": {"glint_"}}


def part(file: Path) -> str:
    """Name of the part of the package that `file` belongs to: its folder, or its own name at the top."""
    top = file.relative_to(ADDON).parts[0].removesuffix(".py")
    return "" if top == "__init__" else top


def imports(file: Path) -> list[tuple[int, str, int]]:
    """Every import of `file`, at the top or inside functions, as (level of dots, dotted name, line)."""
    found = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(0, alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names] if node.module is None else [node.module]
            found += [(node.level, name, node.lineno) for name in names]
    return found


def imported_parts(file: Path) -> dict[str, int]:
    """The parts of the package that `file` imports, with the line of each."""
    folder = file.relative_to(ADDON).parent.parts
    result = {}
    for level, name, line in imports(file):
        if level == 0:
            continue
        # One dot is the file's own folder, each further dot one up.
        base = folder[: len(folder) - (level - 1)]
        target = (*base, *name.split("."))
        is_module = (ADDON / target[0]).is_dir() or (ADDON / f"{target[0]}.py").is_file()
        # `from . import register` takes a function of the package itself.
        result[target[0] if is_module else ""] = line
    return result


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ADDON)))
def test_a_module_imports_only_what_lies_below_it(file):
    own = part(file)
    assert own in ALLOWED, f"{own} is a new part of the package: say in this test what it may import"
    for target, line in imported_parts(file).items():
        assert target == own or target in ALLOWED[own], f"{file.name}:{line} imports {target} from {own or 'the top'}"


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ADDON)))
def test_a_module_names_its_own_package_only_by_relative_imports(file):
    for level, name, line in imports(file):
        assert level > 0 or name.split(".")[0] != "glint_addon", f"{file.name}:{line}"


@pytest.mark.parametrize("file", [file for file in MODULES if part(file) in ("bake", "generate")],
                         ids=lambda file: str(file.relative_to(ADDON)))
def test_baking_and_generating_never_import_bpy(file):
    blender = {"bpy", "mathutils", "bl_math", "gpu", "_cycles", "cycles"}
    for _, name, line in imports(file):
        assert name.split(".")[0] not in blender, f"{file.name}:{line} imports {name}"


def property_names(source: str) -> set[str]:
    """All strings in `source` that begin as the names of the extension's properties do."""
    strings = (node.value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant))
    return {text for text in strings if isinstance(text, str) and text.startswith("glint_") and " " not in text}


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ADDON)))
def test_names_of_custom_properties_stand_in_one_module(file):
    place = file.relative_to(ADDON).as_posix()
    if place != "properties.py":
        assert property_names(file.read_text(encoding="utf-8")) == FILE_NAMES.get(place, set())


def test_each_custom_property_has_a_name_of_its_own():
    source = (ADDON / "properties.py").read_text(encoding="utf-8")
    assert {"glint_table", "glint_prepared"} <= property_names(source)
    assert all(source.count(f'"{name}"') == 1 for name in property_names(source))


def test_a_name_inside_a_longer_string_is_seen_where_it_begins():
    assert property_names('group[f"glint_{name}"] = scene["glint_lights"]') == {"glint_", "glint_lights"}


def test_the_walk_sees_an_import_that_goes_up(tmp_path, monkeypatch):
    bad = tmp_path / "bake" / "tables.py"
    for folder in ("bake", "operators", "ui"):
        (tmp_path / folder).mkdir()
    bad.write_text(
        "def f():\n    from ..operators.prepare import x\n    from .. import ui\n    from .. import register\n",
        encoding="utf-8",
    )
    monkeypatch.setitem(globals(), "ADDON", tmp_path)
    assert imported_parts(bad) == {"operators": 2, "ui": 3, "": 4}


@pytest.mark.parametrize("folder", ["benchmarks", "demo_scenes"])
def test_what_is_measured_and_shown_needs_no_tests(folder):
    for file in (ROOT / folder).rglob("*.py"):
        for _, name, line in imports(file):
            assert name.split(".")[0] != "tests", f"{file.name}:{line} imports {name}"
