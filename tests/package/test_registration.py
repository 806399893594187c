"""Registering adds what it should, and unregistering leaves Blender as it was."""

import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import glint_addon

ROOT = Path(__file__).resolve().parents[2]
MENUS = ("NODE_MT_category_shader_input", "NODE_MT_category_shader_shader", "NODE_MT_category_shader_texture",
         "NODE_MT_category_shader_vector", "VIEW3D_MT_object")


def menu_entries() -> dict[str, list]:
    """The draw functions of every menu, panel and header that has been extended."""
    entries = {}
    for name in dir(bpy.types):
        functions = getattr(getattr(getattr(bpy.types, name), "draw", None), "_draw_funcs", None)
        # The first is Blender's own; Blender keeps the list when the last extension leaves.
        if functions and len(functions) > 1:
            entries[name] = list(functions)
    return entries


def handlers() -> dict[str, list]:
    """Every application handler that is set."""
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    return {name: list(value) for name, value in lists.items() if isinstance(value, list)}


def properties() -> dict[str, set]:
    """The properties of the types that extensions add to."""
    kinds = ("Scene", "WindowManager", "Material", "Object", "Light", "Image", "ShaderNodeTree", "World")
    return {kind: set(getattr(bpy.types, kind).bl_rna.properties.keys()) for kind in kinds}


def blender_state() -> dict:
    """What an extension could leave behind."""
    return {
        "types": set(dir(bpy.types)),
        "operators": set(dir(bpy.ops.glint)),
        "menus": menu_entries(),
        "handlers": handlers(),
        "properties": properties(),
        "driver functions": set(bpy.app.driver_namespace),
        "subclasses": {cls.__name__ for cls in bpy.types.Operator.__subclasses__() if cls.is_registered},
        "data": {name: len(getattr(bpy.data, name)) for name in ("materials", "node_groups", "images", "texts")},
    }


def test_nothing_is_left_after_unregistering():
    before = blender_state()
    glint_addon.register()
    during = blender_state()
    glint_addon.unregister()
    after = blender_state()
    assert after == before
    # The comparison would see each of these.
    assert "GLINT_OT_prepare" in during["types"] - before["types"]
    assert set(during["menus"]) - set(before["menus"]) >= set(MENUS)
    assert "glint" in during["properties"]["Scene"] - before["properties"]["Scene"]


def test_registering_twice_over_works():
    for _ in range(2):
        glint_addon.register()
        assert bpy.ops.glint.prepare.get_rna_type().name == "Prepare Glints"
        glint_addon.unregister()


def test_the_operators_have_the_names_that_stay(registered):
    assert {"add_material", "prepare", "add_node_group"} <= set(dir(bpy.ops.glint))


@pytest.mark.parametrize("name", [
    "add_material", "change_map", "prepare", "keep_glints", "add_node_group", "generate_map", "regenerate_map",
    "change_parts", "add_radial_uvs",
])
def test_every_operator_and_setting_has_a_tooltip_without_a_final_period(registered, name):
    operator = getattr(bpy.ops.glint, name).get_rna_type()
    own = [p for p in operator.properties if p.identifier != "rna_type" and not p.is_hidden]
    for thing in (operator, *own):
        assert thing.description and not thing.description.endswith("."), thing.identifier


def test_every_operator_can_be_undone(registered):
    for name in ("GLINT_OT_add_material", "GLINT_OT_prepare", "GLINT_OT_keep_glints", "GLINT_OT_add_node_group",
                 "GLINT_OT_generate_map", "GLINT_OT_regenerate_map", "GLINT_OT_change_parts",
                 "GLINT_OT_add_radial_uvs"):
        assert {"REGISTER", "UNDO"} <= set(getattr(bpy.types, name).bl_options)


def test_importing_does_nothing_and_registering_loads_no_heavy_module():
    code = (
        "import bpy, sys\n"
        "loaded = lambda: {name for name in sys.modules if name.startswith('glint_addon.')}\n"
        "counts = lambda: {name: len(value) for name in dir(bpy.data)\n"
        "    if isinstance(value := getattr(bpy.data, name), bpy.types.bpy_prop_collection)}\n"
        "before = counts()\n"
        "import glint_addon\n"
        "assert not loaded(), loaded()\n"
        "glint_addon.register()\n"
        "assert counts() == before and len(before) > 20, counts()\n"
        "heavy = {f'glint_addon.{part}' for part in ('bake', 'choice', 'lights', 'prepare.scene', 'seen')}\n"
        "assert not loaded() & heavy, loaded() & heavy\n"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


def test_the_public_functions_come_from_their_modules():
    from glint_addon.materials.create import create_glint_material
    from glint_addon.prepare.scene import prepare_scene

    assert glint_addon.create_glint_material is create_glint_material
    assert glint_addon.prepare_scene is prepare_scene
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        _ = glint_addon.no_such_name
