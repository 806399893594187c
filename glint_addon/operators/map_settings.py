"""A normal map and how it is read, as settings that operators share."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..errors import SceneError

HIDDEN = {"HIDDEN", "SKIP_SAVE"}


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

    distribution: EnumProperty(
        name="Distribution",
        description="Microfacet distribution around each normal of the map",
        items=(
            ("BECKMANN", "Beckmann", "Gaussian slopes: crisp glints without tails"),
            ("GGX", "GGX", "Long tails: a soft halo around each glint"),
        ),
    )
    interpolation: EnumProperty(
        name="Interpolation",
        description="How normals are read between texels",
        items=(
            ("LINEAR", "Linear", "Smooth maps: waves, scratches, brushed metal"),
            ("CLOSEST", "Closest", "One flat facet a texel: metallic flakes, sequins"),
        ),
    )
    convention: EnumProperty(
        name="Convention",
        description="Which way the map's green channel points",
        items=(
            ("OPENGL", "OpenGL", "Green points up (Y+), as in Blender"),
            ("DIRECTX", "DirectX", "Green points down (Y-)"),
        ),
    )
    extension: EnumProperty(
        name="Extension",
        description="What is outside the map's own square of UVs",
        items=(
            ("REPEAT", "Repeat", "The map again: no edge"),
            ("EXTEND", "Extend", "The map's outermost texels; rendered by Blender's own nodes, from the edge on"),
            ("CLIP", "Clip", "Nothing: black; the edge is rendered by Blender's own nodes"),
            ("MIRROR", "Mirror", "The map mirrored; rendered by Blender's own nodes, from the edge on"),
        ),
    )
    uv_map: StringProperty(
        name="UV Map", description="UV map that places the normal map; empty takes the one active for rendering"
    )

    def chosen_map(self, context):
        """The dropped file's path, the named image, or the image picked in the panel.

        Raises SceneError if there is none.
        """
        if self.filepath:
            return bpy.path.abspath(self.filepath)
        if self.image:
            image = bpy.data.images.get(self.image)
            if image is None:
                raise SceneError(f'There is no image named "{self.image}" in this file: open it first.')
            return image
        image = context.scene.glint.normal_map
        if image is None:
            raise SceneError(
                "No normal map is chosen: pick an image in Material Properties > Glint, or drop one there."
            )
        return image

    def draw_map(self, context):
        """The choices, in the Adjust Last Operation panel or a dialog."""
        for name in ("distribution", "interpolation", "convention", "extension"):
            self.layout.prop(self, name)
        if context.object and context.object.type == "MESH":
            self.layout.prop_search(self, "uv_map", context.object.data, "uv_layers")


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
