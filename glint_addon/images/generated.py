"""Ordinary images of a generated microstructure: a normal map, and where flakes are and their colours if it has any.

Their pixels are packed into the .blend file. Each image keeps the recipe that it was made from, and what was packed
then, so that it can be made anew and nothing that a user painted is lost without a word.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import bpy
import numpy as np

from ..errors import EditedError, GlintError, MapError
from ..generate import CLOSEST, Recipe, encoded, recipe_of_text, srgb
from ..properties import GENERATED, GENERATED_COLOR, GENERATED_CONTENT, GENERATED_PART, GENERATED_PRESENCE

NORMAL = "Normal"
PARTS = {GENERATED_PRESENCE: "Presence", GENERATED_COLOR: "Color"}  # what else belongs to it, and its name
WHITE = 8  # texels a side of the image of a part that the microstructure no longer has


@dataclass(frozen=True)
class Pictures:
    """PNG files: `normal` of 16 bits a channel, the others of 8, by the property that points to their image."""

    normal: bytes
    others: dict[str, bytes]


def pictures(recipe: Recipe, resolution: int | None = None, name: str = "Generated") -> Pictures:
    """What the images of a recipe show, at `resolution` instead of its own; uses no Blender, so any thread may call.

    name: of the normal map, for messages. Raises GenerateError for settings that are not allowed, MapError if the disk
    for temporary files is full.
    """
    from ..bake.image_bytes import image_bytes  # OpenImageIO, which no other image needs

    surface, colors = recipe.made(resolution or recipe.resolution)
    others = {}
    if surface.presence is not None:
        others[GENERATED_PRESENCE] = image_bytes(_grey(surface.presence), is_float=False, name=name)
    if colors is not None:
        others[GENERATED_COLOR] = image_bytes(srgb(colors), is_float=False, name=name)
    return Pictures(image_bytes(encoded(surface.normals), is_float=False, name=name, bits=16), others)


def new_generated_map(name: str, recipe: Recipe) -> bpy.types.Image:
    """A new normal map of a recipe, with the images that belong to it; see `parts`.

    Raises GenerateError or MapError as `pictures` does, and then leaves nothing behind.
    """
    shown = pictures(recipe, name=name)
    image = _new_image(name, NORMAL)
    show(image, recipe, shown)
    return image


def show(image: bpy.types.Image, recipe: Recipe, shown: Pictures, *, overwrite: bool = False) -> None:
    """Let the images of a generated map show pictures of `recipe`; they remain the same data-blocks.

    overwrite: also where a user edited them. Raises MapError for linked images and EditedError for edited ones; then
    nothing has changed.
    """
    check_unchanged(image, overwrite=overwrite)
    _fill(image, shown.normal, recipe)
    for key, part in PARTS.items():
        other = parts(image).get(key)
        if other is None and key in shown.others:
            other = image[key] = _new_image(f"{image.name} {part}", part)
        if other is not None:
            _fill(other, shown.others.get(key) or _white(image.name), recipe)


def recipe_of(image: bpy.types.Image | None) -> Recipe | None:
    """The recipe of a generated image; None of another, and of one whose recipe cannot be read."""
    text = image.get(GENERATED) if image is not None else None
    if not isinstance(text, str):
        return None
    try:
        return recipe_of_text(text)
    except GlintError:
        return None


def is_generated_map(image: bpy.types.Image | None) -> bool:
    """Whether an image is the normal map of a generated microstructure; reads neither pixels nor recipe."""
    return image is not None and image.get(GENERATED_PART) == NORMAL


def is_preview(image: bpy.types.Image) -> bool:
    """Whether a generated image has another size than its recipe says."""
    recipe = recipe_of(image)
    return recipe is not None and image.size[0] != recipe.resolution


def parts(image: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """The images that belong to a generated normal map, by the property that points to each."""
    found = {key: image.get(key) for key in PARTS}
    return {key: other for key, other in found.items() if isinstance(other, bpy.types.Image)}


def flake_images(image: bpy.types.Image) -> dict[str, bpy.types.Image | None]:
    """What a Glint BSDF reads of the flakes of a generated map, by the name of its setting; None of any other image,
    and of a map that is read between its texels, where no single flakes are."""
    recipe = recipe_of(image)
    found = {} if recipe is None or recipe.generator.interpolation != CLOSEST else parts(image)
    # A part that the microstructure no longer has is a small white image.
    now = {key: part for key, part in found.items() if part.size[:] == image.size[:]}
    return {"presence": now.get(GENERATED_PRESENCE), "flake_color": now.get(GENERATED_COLOR)}


def check_unchanged(image: bpy.types.Image, *, overwrite: bool = False) -> None:
    """Raise MapError if an image of a generated map is linked, EditedError if it is not what was generated, unless
    `overwrite`."""
    for each in (image, *parts(image).values()):
        if not each.is_editable:
            raise MapError(f'Image "{each.name}" is linked from another file: make it local to generate it again.')
        if not overwrite and GENERATED_CONTENT in each and is_edited(each):
            raise EditedError(f'Image "{each.name}" was edited after it was generated: choose Overwrite Edits to lose '
                              "that, or generate a new map.")


def is_edited(image: bpy.types.Image) -> bool:
    """Whether a generated image was painted, or given another file, since it was generated."""
    return image.is_dirty or image.packed_file is None or image[GENERATED_CONTENT] != _content(image)


def _new_image(name, part):
    image = bpy.data.images.new(name, 1, 1, is_data=part != PARTS[GENERATED_COLOR])
    image.source, image.alpha_mode = "FILE", "NONE"
    image[GENERATED_PART] = part
    return image


def _fill(image, contents, recipe):
    """Give an image the pixels of a PNG file."""
    # With a path Blender would replace what is packed by the file as soon as it is told to reload.
    if image.filepath:
        image.filepath = ""
    image.pack(data=contents, data_len=len(contents))
    image.buffers_free()
    image[GENERATED], image[GENERATED_CONTENT] = recipe.text(), _content(image)
    image.update_tag()


def _content(image):
    return hashlib.sha256(image.packed_file.data).hexdigest()[:32]


def _grey(presence):
    return presence[..., None].astype(np.float32)


def _white(name):
    from ..bake.image_bytes import image_bytes

    return image_bytes(np.ones((WHITE, WHITE, 1), np.float32), is_float=False, name=name)
