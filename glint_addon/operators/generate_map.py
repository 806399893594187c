"""Generate a normal map, and make one anew."""

import json
from dataclasses import replace

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ..errors import GenerateError, SceneError
from ..generate import GENERATORS, PRESETS, Generator, Recipe, as_data, of_data
from ..images import check_unchanged, is_generated_map, new_generated_map, pictures, show
from ..materials.find import glint_groups
from ..materials.replace_group import follow_generated
from ..nodes.map_binding import map_of
from .failing_softly import FailsSoftly
from .generated_settings import RESOLUTIONS, changed, fill, kind_settings, recipe_from, set_problem, unheard

# What a new map begins with, by the value of the operator's Kind: the kinds, then named sets of their settings.
STARTS: dict[str, Generator] = {kind: cls() for kind, cls in GENERATORS.items()}
STARTS |= {name.upper().replace(" ", "_"): generator for name, generator in PRESETS.items()}
_LABELS = [cls.label for cls in GENERATORS.values()] + list(PRESETS)


class GLINT_OT_generate_map(FailsSoftly, bpy.types.Operator):
    """Make a normal map of flakes, scratches, grains... as an image, and pick it for the next Glint material"""

    bl_idname = "glint.generate_map"
    bl_label = "Generate Normal Map"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(
        name="Kind",
        description="What the surface is made of",
        items=[(kind, label, start.help) for (kind, start), label in zip(STARTS.items(), _LABELS, strict=True)],
    )
    name: StringProperty(name="Name", description="Name of the image; empty takes the kind's name")
    resolution: EnumProperty(
        name="Resolution", description="Texels along a side of the map", default="2048",
        items=[(str(side), str(side), f"{side} x {side} texels") for side in RESOLUTIONS],
    )
    seed: IntProperty(
        name="Seed", description="Another number gives another surface of the same kind", default=1, min=0
    )
    settings: StringProperty(
        name="Settings", description='Other settings of the kind as JSON, for scripts: {"coverage": 0.5}'
    )

    def run(self, context):
        """Make the images and pick the map."""
        start = replace(STARTS[self.kind], seed=self.seed)
        recipe = Recipe(_with(start, self.settings), int(self.resolution))
        image = new_generated_map(self.name or _LABELS[list(STARTS).index(self.kind)], recipe)
        fill(image.glint, recipe)
        context.scene.glint.normal_map = image
        self.report({"INFO"}, f'Generated "{image.name}": press Add Glint Material, and edit it under Generate')
        return {"FINISHED"}

    def draw(self, _context):
        """Settings in the Adjust Last Operation panel; those of the kind are in the panel Generate."""
        self.layout.use_property_split = True
        for name in ("kind", "name", "resolution", "seed"):
            self.layout.prop(self, name)


class GLINT_OT_regenerate_map(FailsSoftly, bpy.types.Operator):
    """Make a generated map anew from its settings, at its full resolution"""

    bl_idname = "glint.regenerate_map"
    bl_label = "Generate Again"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Image", description="Name of the normal map; empty takes the one that is shown")
    overwrite: BoolProperty(
        name="Overwrite Edits", description="Lose what was painted on the map since it was generated"
    )

    @classmethod
    def poll(cls, context):
        if active_map(context) is None and not any(map(is_generated_map, bpy.data.images)):
            cls.poll_message_set("There is no generated map: generate one first")
            return False
        return True

    def run(self, context):
        """Make the map."""
        image = bpy.data.images.get(self.image) if self.image else active_map(context)
        if not is_generated_map(image):
            raise SceneError(f'Image "{self.image}" is no generated map: choose one that is, or generate a new map.')
        check_unchanged(image, overwrite=self.overwrite)
        recipe = recipe_from(image.glint)
        show(image, recipe, pictures(recipe, name=image.name), overwrite=self.overwrite)
        follow_generated(image)
        set_problem(image.glint, None)
        return {"FINISHED"}


class GLINT_OT_change_parts(FailsSoftly, bpy.types.Operator):
    """Add a population of flakes or a color of the ramp like the last one, or remove one"""

    bl_idname = "glint.change_parts"
    bl_label = "Change Parts of Map"
    bl_options = {"REGISTER", "UNDO"}

    part: EnumProperty(
        name="Part", description="What is added or removed",
        items=[("populations", "Population", "Flakes of one make"), ("stops", "Stop", "Color of a ramp")],
    )
    remove: IntProperty(name="Remove", description="Number of the part to remove from 0 on; -1 adds one", default=-1)

    @classmethod
    def poll(cls, context):
        if active_map(context) is None:
            cls.poll_message_set("There is no generated map: generate one first")
            return False
        return True

    def run(self, context):
        """Change the collection, and let the map follow."""
        state = active_map(context).glint
        owner = state.coloring if self.part == "stops" else kind_settings(state)
        parts = getattr(owner, self.part, None)
        if parts is None:
            raise SceneError("Only flakes have populations: choose the Kind Flakes first.")
        with unheard():
            if self.remove < 0:
                _add_like_last(parts)
            elif self.remove < len(parts) and len(parts) > 1:
                parts.remove(self.remove)
            else:
                raise SceneError(f"Part {self.remove} cannot be removed: choose one of those there are, not the last.")
        changed(state)
        return {"FINISHED"}


def active_map(context):
    """The generated map that the panel shows: the one picked, else the first that the material reads; None without."""
    picked = context.scene.glint.normal_map
    if is_generated_map(picked):
        return picked
    material = getattr(context, "material", None)
    if material is None and context.object is not None:
        material = context.object.active_material
    maps = map(map_of, glint_groups(material)) if material is not None else ()
    return next(filter(is_generated_map, maps), None)


def _with(start, settings):
    """A generator with other settings, given as JSON or not at all."""
    if not settings:
        return start
    try:
        others = json.loads(settings)
    except ValueError as error:
        raise GenerateError(f"Settings {settings} cannot be read ({error}): write them as JSON.") from error
    if not isinstance(others, dict):
        raise GenerateError(f'Settings {settings} are no names and values: write them as {{"coverage": 0.5}}.')
    return of_data({**as_data(start), **others})


def _add_like_last(parts):
    """Add a part with the settings of the last one."""
    parts.add()
    if len(parts) > 1:
        new, last = parts[-1], parts[-2]
        for name in type(new).__annotations__:
            setattr(new, name, getattr(last, name))
