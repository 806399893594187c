"""States in which users' files and Blender's settings are found: each function brings the open file into one.

The open file is the one that `save_start` saved: a plane with a Glint material, a sun, a lamp and a camera, prepared.
"""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import bpy

from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

SIZE = (8, 8)  # pixels
MATERIAL = "Glint flakes"
STATES = {}


def save_start(folder: Path) -> Path:
    """Save the file that all states begin with, its map and its tables in `folder`."""
    scene = cycles.empty_scene(size=SIZE)
    plane = cycles.add_plane(scene)
    plane.name = "Plane"
    bpy.context.view_layer.objects.active = plane
    file = folder / "start.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.glint.add_material(filepath=str(write_flake_map(folder / "flakes.png")))
    bpy.data.images["flakes.png"].filepath = "//flakes.png"
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    add_object("Lamp", bpy.data.lights.new("Lamp", "POINT")).location = (0, 0, 2)
    cycles.add_camera(scene, (0, 0, 3))
    bpy.context.view_layer.objects.active = plane
    bpy.ops.glint.prepare()
    bpy.ops.wm.save_mainfile()
    return file


def state(function):
    """Note a function as a state; its name is the test's."""
    STATES[function.__name__] = function
    return function


def add_object(name, data):
    """An object in the scene, the active one."""
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    return thing


def plane():
    return bpy.data.objects["Plane"]


def material():
    return bpy.data.materials[MATERIAL]


def group():
    node = next(node for node in material().node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    return node.node_tree


def image():
    return bpy.data.images["flakes.png"]


def reopen(name="reopened.blend"):
    """Save the open file beside the one it is, and open it again."""
    file = str(Path(bpy.data.filepath).with_name(name))
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)


@state
def as_prepared():
    pass


# --- the scene ---


@state
def no_world():
    bpy.context.scene.world = None


@state
def a_world_without_nodes_of_its_own():
    bpy.context.scene.world = bpy.data.worlds.new("Empty world")
    bpy.context.scene.world.node_tree.nodes.clear()


@state
def no_camera():
    bpy.data.objects.remove(bpy.context.scene.camera)


@state
def a_camera_object_that_is_no_camera():
    bpy.context.scene.camera = plane()


@state
def everything_excluded():
    for child in bpy.data.collections:
        bpy.data.collections.remove(child)
    bpy.context.view_layer.layer_collection.exclude = True


@state
def all_in_an_excluded_collection():
    scene, inner = bpy.context.scene, bpy.data.collections.new("Away")
    scene.collection.children.link(inner)
    for thing in list(scene.collection.objects):
        inner.objects.link(thing)
        scene.collection.objects.unlink(thing)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True


@state
def all_view_layers_off():
    for layer in bpy.context.scene.view_layers:
        layer.use = False


@state
def everything_hidden():
    for thing in bpy.data.objects:
        thing.hide_render = thing.hide_viewport = True


@state
def an_empty_scene():
    bpy.data.batch_remove(bpy.data.objects)


@state
def nothing_in_the_file():
    cycles.empty_scene(size=SIZE)


@state
def a_second_scene_that_was_never_prepared():
    bpy.context.window.scene = bpy.data.scenes.new("Second")


@state
def a_full_copy_of_the_scene():
    bpy.ops.scene.new(type="FULL_COPY")


@state
def a_linked_copy_of_the_scene():
    bpy.ops.scene.new(type="LINK_COPY")


@state
def the_engine_is_eevee():
    bpy.context.scene.render.engine = "BLENDER_EEVEE"


@state
def the_engine_is_workbench():
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"


@state
def the_device_is_a_gpu():
    bpy.context.scene.cycles.device = "GPU"


@state
def osl_is_off():
    bpy.context.scene.cycles.shading_system = False


@state
def textures_are_limited():
    bpy.context.scene.render.use_simplify = True
    bpy.context.scene.cycles.texture_limit_render = "128"


# --- libraries ---


def link_from_library(kind, name, *, missing=True):
    """Link something of a copy of the file, which then goes away."""
    library = Path(bpy.data.filepath).with_name("library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(library), copy=True)
    with bpy.data.libraries.load(str(library), link=True, relative=True) as (_, wanted):
        setattr(wanted, kind, [name])
    found = getattr(wanted, kind)[0]
    if kind == "materials":
        plane().data.materials[0] = found
        bpy.data.materials.remove(bpy.data.materials[MATERIAL, None])
    elif kind == "objects":
        bpy.context.scene.collection.objects.link(found)
        bpy.context.view_layer.objects.active = found
    else:
        bpy.context.scene.background_set = found
    reopen()
    if missing:
        library.unlink()
        reopen("without_library.blend")


@state
def a_linked_glint_material():
    link_from_library("materials", MATERIAL, missing=False)


@state
def a_linked_glint_material_whose_library_is_missing():
    link_from_library("materials", MATERIAL)


@state
def a_linked_lamp_whose_library_is_missing():
    link_from_library("objects", "Lamp")


@state
def a_linked_plane_whose_library_is_missing():
    link_from_library("objects", "Plane")


@state
def a_linked_scene_whose_library_is_missing():
    link_from_library("scenes", "Scene")


@state
def a_linked_scene_is_shown():
    link_from_library("scenes", "Scene", missing=False)
    bpy.context.window.scene = next(scene for scene in bpy.data.scenes if scene.library)


@state
def a_missing_linked_scene_is_shown():
    link_from_library("scenes", "Scene")
    bpy.context.window.scene = next(scene for scene in bpy.data.scenes if scene.library)


@state
def a_missing_scene_that_could_not_be_found_is_shown():
    link_from_library("scenes", "Scene")
    bpy.context.window.scene.background_set = None
    bpy.ops.wm.save_mainfile()


# --- objects ---

DATA = {
    "curve": lambda: bpy.data.curves.new("Curve", "CURVE"),
    "text": lambda: bpy.data.curves.new("Text", "FONT"),
    "surface": lambda: bpy.data.curves.new("Surface", "SURFACE"),
    "metaball": lambda: bpy.data.metaballs.new("Metaball"),
    "hair": lambda: bpy.data.hair_curves.new("Hair"),
    "point_cloud": lambda: bpy.data.pointclouds.new("Points"),
    "volume": lambda: bpy.data.volumes.new("Volume"),
    "grease_pencil": lambda: bpy.data.grease_pencils.new("Pencil"),
    "empty": lambda: None,
    "armature": lambda: bpy.data.armatures.new("Armature"),
    "lattice": lambda: bpy.data.lattices.new("Lattice"),
    "camera": lambda: bpy.data.cameras.new("Other camera"),
    "sun": lambda: bpy.data.lights.new("Other sun", "SUN"),
    "area_light": lambda: bpy.data.lights.new("Area", "AREA"),
    "sphere_probe": lambda: bpy.data.lightprobes.new("Sphere", "SPHERE"),
    "volume_probe": lambda: bpy.data.lightprobes.new("Box", "VOLUME"),
    "speaker": lambda: bpy.data.speakers.new("Speaker"),
}


def _objects():
    for name, make in DATA.items():
        def bare(make=make):
            add_object("Active", make())

        def glinting(make=make):
            thing = add_object("Active", make())
            fill(thing)
            thing.data.materials.append(material())

        STATES[f"the_active_object_is_a_{name}"] = bare
        if name in {"curve", "text", "surface", "metaball", "hair", "point_cloud", "volume", "grease_pencil"}:
            STATES[f"the_active_object_is_a_{name}_with_glints"] = glinting


def fill(thing):
    """Give an object of no mesh something to show."""
    data = thing.data
    if thing.type == "FONT":
        data.body = "Glint"
    elif thing.type == "META":
        data.elements.new()
    elif thing.type == "CURVE":
        data.bevel_depth = 0.1
        data.splines.new("POLY").points.add(1)
    elif thing.type == "POINTCLOUD":
        data.resize(3)
    elif thing.type == "CURVES":
        data.add_curves([2])


_objects()


@state
def no_active_object():
    bpy.context.view_layer.objects.active = None


@state
def the_active_object_is_in_edit_mode():
    plane().select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    assert plane().mode == "EDIT"


@state
def the_mesh_has_no_faces():
    plane().data.clear_geometry()


@state
def the_mesh_has_no_uv_map():
    plane().data.uv_layers.remove(plane().data.uv_layers[0])


@state
def the_mesh_has_another_uv_map_only():
    plane().data.uv_layers[0].name = "Other"
    node = group().nodes["Tangent Space"]
    node.uv_map = "Gone"


@state
def the_plane_is_squashed_flat():
    plane().scale = (0, 0, 0)


@state
def the_plane_is_not_a_number():
    plane().location = (float("nan"),) * 3


@state
def an_object_without_users():
    bpy.data.objects.new("Lonely", plane().data)


@state
def a_mesh_that_was_removed():
    bpy.data.meshes.remove(plane().data)


@state
def light_data_that_was_removed():
    bpy.data.lights.remove(bpy.data.lights["Lamp"])


@state
def a_lamp_that_was_removed():
    bpy.data.objects.remove(bpy.data.objects["Lamp"])


@state
def an_instanced_collection_that_shows_itself():
    inner = bpy.data.collections.new("Loop")
    bpy.context.scene.collection.children.link(inner)
    empty = bpy.data.objects.new("Shower", None)
    inner.objects.link(empty)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = inner


@state
def a_slot_without_a_material():
    plane().data.materials.append(None)
    plane().active_material_index = 1


# --- materials and their groups ---


@state
def a_material_without_users():
    plane().data.materials.clear()


@state
def a_material_of_no_nodes():
    plane().data.materials[0] = bpy.data.materials.new("Plain")
    plane().data.materials[0].node_tree.nodes.clear()


@state
def an_empty_node_tree():
    material().node_tree.nodes.clear()


@state
def a_group_node_without_a_tree():
    for node in material().node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            node.node_tree = None


@state
def the_image_of_the_group_is_none():
    group().nodes["Normal Map Image"].image = None


@state
def the_map_was_removed():
    bpy.data.images.remove(image())


def _lost_nodes():
    for name in ("Normal Map Image", "Tangent Space", "Facets", "Glint", "Lights", "Caustics", "UV Map",
                 "OSL or native"):
        def lose(name=name):
            group().nodes.remove(group().nodes[name])

        STATES[f"the_group_lost_its_node_{name.lower().replace(' ', '_')}"] = lose
    for name in ("CUBIC", "SMART"):
        def read(name=name):
            group().nodes["Normal Map Image"].interpolation = name.capitalize()

        STATES[f"the_interpolation_is_{name.lower()}"] = read


_lost_nodes()


@state
def the_distribution_is_another():
    group().nodes["Facets"].distribution = "ASHIKHMIN_SHIRLEY"


@state
def the_normal_map_is_of_object_space():
    group().nodes["Tangent Space"].space = "OBJECT"


@state
def the_projection_is_a_box():
    group().nodes["Normal Map Image"].projection = "BOX"


@state
def the_group_lost_all_its_nodes():
    group().nodes.clear()


@state
def the_group_lost_its_sockets():
    group().interface.clear()


@state
def the_group_lost_its_properties():
    for name in list(group().keys()):
        if name != "glint_group":
            del group()[name]


@state
def the_properties_of_the_group_are_of_other_types():
    for name in list(group().keys()):
        if name != "glint_group":
            group()[name] = 1.5


@state
def the_stamp_of_the_group_is_a_text():
    group()["glint_group"] = "ten"


@state
def the_group_is_of_a_later_version():
    group()["glint_group"] = 1000


@state
def the_group_is_of_version_9():
    from tests.helpers.old_group import make_old

    make_old(group())


@state
def the_group_is_of_version_9_without_its_image():
    from tests.helpers.old_group import make_old

    make_old(group())
    bpy.data.images.remove(image())


@state
def the_group_is_of_version_9_without_its_properties():
    from tests.helpers.old_group import make_old

    make_old(group())
    for name in ("glint_convention", "glint_distribution", "glint_uv_map"):
        del group()[name]


@state
def the_text_of_the_script_was_deleted():
    for text in bpy.data.texts:
        bpy.data.texts.remove(text)


@state
def the_script_was_emptied():
    script = group().nodes["Glint"]
    script.script = None
    script.bytecode = ""


@state
def the_text_of_the_script_is_damaged():
    for text in bpy.data.texts:
        text.from_string("no shader")
    script = group().nodes["Glint"]
    script.script = script.script


@state
def the_lights_group_lost_a_node():
    lights = bpy.data.node_groups["Glint Lights"]
    lights.nodes.remove(lights.nodes["Shape 1"])


@state
def the_lights_group_was_removed():
    bpy.data.node_groups.remove(bpy.data.node_groups["Glint Lights"])


@state
def a_stranger_bears_the_name_of_the_lights_group():
    bpy.data.node_groups.remove(bpy.data.node_groups["Glint Lights"])
    bpy.data.node_groups.new("Glint Lights", "ShaderNodeTree")


@state
def a_stranger_bears_the_name_of_the_bsdf_group():
    group().name = "Mine"
    bpy.data.node_groups.new("Glint BSDF", "GeometryNodeTree")


@state
def an_image_texture_group_without_its_nodes():
    from glint_addon.nodes import GROUPS

    other = GROUPS["Glint Image Texture"]()
    other.nodes.clear()
    node = material().node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = other


@state
def an_image_texture_group_that_was_never_prepared():
    from glint_addon.nodes import GROUPS

    node = material().node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = GROUPS["Glint Image Texture"]()


# --- what Glint keeps ---


@state
def the_holder_of_the_lights_was_deleted():
    bpy.data.node_groups.remove(bpy.context.scene["glint_lights"])


@state
def the_holder_of_the_lights_lost_its_arrays():
    for name in list(bpy.context.scene["glint_lights"].keys()):
        del bpy.context.scene["glint_lights"][name]


@state
def the_arrays_of_the_lights_are_too_short():
    bpy.context.scene["glint_lights"]["lights_1"] = [0.0, 1.0]


@state
def the_arrays_of_the_lights_are_texts():
    bpy.context.scene["glint_lights"]["lights_1"] = "lights"


def _wrong_properties():
    values = {
        "a_number": 7, "a_text": "Lamp", "a_list": [1, 2], "a_group": {"a": 1}, "an_empty_text": "",
    }
    for name, value in values.items():
        def hold(value=value):
            bpy.context.scene["glint_lights"] = value

        def remember(value=value):
            bpy.context.scene["glint_prepared"] = value

        STATES[f"the_holder_of_the_lights_is_{name}"] = hold
        STATES[f"what_was_prepared_is_{name}"] = remember
    for name, text in {
        "no_json": "{", "a_json_list": "[]", "a_json_number": "7", "an_empty_object": "{}",
        "of_another_version": '{"version": 1}', "of_a_later_version": '{"version": 1000, "lights": []}',
        "of_another_shape": '{"version": 10, "lights": [], "materials": 7, "objects": null, "settings": "x"}',
        "of_other_entries": '{"version": 10, "lights": {"Light \\"Sun\\"": 7}, "materials": {"Glint flakes": [[1]]}, '
                            '"objects": {"Plane": 3}, "settings": {"Device": []}}',
    }.items():
        def store(name=name, text=text):
            digest = sha256(text.encode()).hexdigest()[:16]
            bpy.context.scene["glint_prepared"] = f"{digest} {text}" if "version" in name else text

        STATES[f"what_was_prepared_is_{name}"] = store


_wrong_properties()


@state
def the_holder_of_the_lights_is_the_plane():
    bpy.context.scene["glint_lights"] = plane()


@state
def tables_are_gone():
    for table in Path(bpy.data.filepath).parent.glob("glint_tables/*"):
        table.unlink()


@state
def tables_are_damaged():
    for table in Path(bpy.data.filepath).parent.glob("glint_tables/*"):
        table.write_bytes(b"damaged")


@state
def a_file_bears_the_name_of_the_folder_of_tables():
    tables_are_gone()
    folder = Path(bpy.data.filepath).with_name("glint_tables")
    folder.rmdir()
    folder.write_text("no folder", encoding="utf-8")


@state
def tables_are_folders():
    for table in Path(bpy.data.filepath).parent.glob("glint_tables/*"):
        table.unlink()
        table.mkdir()


# --- maps ---


@state
def the_file_of_the_map_vanished():
    Path(bpy.path.abspath(image().filepath)).unlink()
    image().reload()


@state
def the_file_of_the_map_vanished_before_the_file_was_opened():
    Path(bpy.path.abspath(image().filepath)).unlink()
    reopen()


@state
def the_files_of_map_and_tables_vanished():
    the_file_of_the_map_vanished()
    tables_are_gone()


@state
def the_file_of_the_map_is_damaged():
    Path(bpy.path.abspath(image().filepath)).write_bytes(b"damaged")
    image().reload()


@state
def the_map_became_udim():
    image().source = "TILED"


@state
def the_map_became_a_movie():
    image().source = "MOVIE"


@state
def the_map_became_a_sequence():
    image().source = "SEQUENCE"


@state
def the_map_was_painted():
    image().pixels[0] = 0.4
    image().update()


@state
def the_map_is_shown_as_colour():
    image().colorspace_settings.name = "sRGB"


@state
def the_map_was_scaled_to_a_pixel():
    image().scale(1, 1)


@state
def the_map_is_the_render_result():
    bpy.context.scene.cycles.shading_system = False  # takes no time to compile
    bpy.ops.render.render()
    group().nodes["Normal Map Image"].image = bpy.data.images["Render Result"]


@state
def the_map_is_a_generated_image():
    group().nodes["Normal Map Image"].image = bpy.data.images.new("Generated", 4, 4)


@state
def the_picked_map_is_missing():
    bpy.context.scene.glint.normal_map = bpy.data.images.new("Picked", 4, 4)
    bpy.context.scene.glint.normal_map.source = "FILE"
    bpy.context.scene.glint.normal_map.filepath = "//nowhere.png"
