"""A normal map and how it is read, as settings that operators share."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..errors import SceneError
from ..images import flake_images, recipe_of
from ..nodes.map_binding import READING, MapBinding
from ..nodes.map_choices import CHOICES, CONVENTION, DISTRIBUTION, EXTENSION, INTERPOLATION, SURFACE, VARIATION, Choice
from ..nodes.surface_kinds import KINDS

FLAKES = ("presence", "flake_color")  # images of single flakes
HIDDEN = {"HIDDEN", "SKIP_SAVE"}


def choice_property(choice: Choice):
    """The setting of an operator for a choice of how the map is read."""
    return EnumProperty(name=choice.label, description=choice.help, items=choice.items, default=choice.default)


class MapSettings:
    """Mixin for operators: where the map comes from, and the choices that belong to it."""

    filepath: StringProperty(
        name="Normal Map File", description="Image file with the normal map", subtype="FILE_PATH", options=HIDDEN
    )
    image: StringProperty(
        name="Normal Map Image", description="Name of the image data-block with the normal map", options=HIDDEN
    )
    filter_image: BoolProperty(default=True, options=HIDDEN)
    filter_folder: BoolProperty(default=True, options=HIDDEN)

    surface: choice_property(SURFACE)
    distribution: choice_property(DISTRIBUTION)
    interpolation: choice_property(INTERPOLATION)
    convention: choice_property(CONVENTION)
    extension: choice_property(EXTENSION)
    variation: choice_property(VARIATION)
    uv_map: StringProperty(
        name="UV Map", description="UV map that places the normal map; empty takes the one active for rendering"
    )

    presence: StringProperty(
        name="Presence", description="Image that says which texels are flakes, for Closest; empty: all are"
    )
    flake_color: StringProperty(
        name="Flake Color", description="Image with a color for each flake, for Closest; empty: that of the surface"
    )

    def reading(self) -> dict:
        """How the map is read: arguments of `create_glint_material` and of `MapBinding`.

        Raises SceneError for an image that is not there.
        """
        flakes = {name: image_named(getattr(self, name)) for name in FLAKES}
        return {name: getattr(self, name) for name in READING} | flakes

    def follow_generated(self, normal_map):
        """Read a generated map as its kind wants it, with its flakes, unless the user chose; `normal_map` is a path or
        an image."""
        recipe = recipe_of(normal_map) if isinstance(normal_map, bpy.types.Image) else None
        if recipe is None:
            return
        if not self.properties.is_property_set("interpolation"):
            self.interpolation = recipe.generator.interpolation
        for name, image in flake_images(normal_map).items():
            if image is not None and self.interpolation == "CLOSEST" and not getattr(self, name):
                setattr(self, name, image.name)

    def start_from(self, binding: MapBinding):
        """Let the settings be those of `binding`; its image is left to the caller."""
        for name in READING:
            setattr(self, name, getattr(binding, name))
        for name in FLAKES:
            image = getattr(binding, name)
            setattr(self, name, image.name if image is not None else "")

    def chosen_map(self, context):
        """The dropped file's path, the named image, or the image picked in the panel.

        Raises SceneError if there is none.
        """
        if self.filepath:
            return bpy.path.abspath(self.filepath)
        if self.image:
            return image_named(self.image)
        image = context.scene.glint.normal_map
        if image is None:
            raise SceneError(
                "No normal map is chosen: pick an image in Material Properties > Glint, or drop one there."
            )
        return image

    def draw_map(self, context):
        """The choices, in the Adjust Last Operation panel or a dialog."""
        for name in CHOICES:
            if name != DISTRIBUTION.name or not KINDS[self.surface].distribution:
                self.layout.prop(self, name)
        if self.interpolation == "CLOSEST":
            for name in FLAKES:
                self.layout.prop_search(self, name, bpy.data, "images")
        if context.object and context.object.type == "MESH":
            self.layout.prop_search(self, "uv_map", context.object.data, "uv_layers")


def image_named(name: str) -> bpy.types.Image | None:
    """The image of that name, None for no name. Raises SceneError if there is none."""
    if name and name not in bpy.data.images:
        raise SceneError(f'There is no image named "{name}" in this file: open it first.')
    return bpy.data.images[name] if name else None


def check_uv_map(target, uv_map: str, context):
    """Raise SceneError if the mesh of `target` has no UV map, or none named `uv_map`; modifiers may make it."""
    if target.type != "MESH":
        return
    names = set(target.data.uv_layers.keys())
    if not names or (uv_map and uv_map not in names):
        names |= set(target.evaluated_get(context.evaluated_depsgraph_get()).data.uv_layers.keys())
    if not names:
        raise SceneError(
            f'"{target.name}" has no UV map to place the normal map: unwrap it (UV > Unwrap) and try again.'
        )
    if uv_map and uv_map not in names:
        raise SceneError(f'"{target.name}" has no UV map named "{uv_map}": choose one of {", ".join(sorted(names))}.')
