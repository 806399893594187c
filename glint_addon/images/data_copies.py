"""Copies of images that read them as data, so that images shown as colour need not be touched.

Blender regenerates or reloads an image when its colour space is set, even to the same one, and discards what was
painted since the image was saved. A copy is marked by strings, not by a pointer, which would keep the original in the
file.
"""

from __future__ import annotations

import bpy

from ..errors import MapError
from ..properties import COPY_CONTENT, COPY_OF, COPY_STATE
from .files import image_path, is_several
from .pixels import read_pixels
from .state import ImageStates, image_state, is_in_memory, is_unsaved


def data_image(
    image: bpy.types.Image, copy: bpy.types.Image | None = None, states: ImageStates | None = None
) -> bpy.types.Image:
    """`image` itself if it is read as data, else a copy "<name> (Non-Color)" that holds its values now as data.

    copy: the copy in use until now, which is brought up to date instead of making another. The copy of a clean file
    reads the same file; packed or painted pixels are packed into the copy. states: of the images that were looked at.
    Raises MapError if the pixels cannot be copied, and then leaves nothing behind.
    """
    if image.colorspace_settings.is_data:
        return image
    if is_several(image) and is_in_memory(image):
        kind = "UDIM set" if image.source == "TILED" else "sequence"
        raise MapError(f'Normal map "{image.name}" is a {kind} that is shown as colour and not saved in files: set its '
                       "Color Space to Non-Color, or save it (Image > Save).")
    state = image_state(image) if states is None else states[image]
    if copy is not None:
        _follow(copy, image, state)
    for known in bpy.data.images:
        if is_data_copy(known) and (known[COPY_OF], known[COPY_STATE]) == (image.name_full, state):
            return known
    copy = bpy.data.images.new(f"{image.name} (Non-Color)", 1, 1, is_data=True)
    try:
        copy.source, copy.alpha_mode = "FILE", "CHANNEL_PACKED"  # alpha scales no values
        _fill(copy, image, state)
    except Exception:
        bpy.data.images.remove(copy)
        raise
    return copy


def is_data_copy(image: bpy.types.Image | None) -> bool:
    """Whether `image` is such a copy and nobody has painted on it since or given it another file."""
    if image is None or image.library is not None or COPY_CONTENT not in image or not image.colorspace_settings.is_data:
        return False
    return not image.is_dirty and image[COPY_CONTENT] == _content(image)


def remove_unused_copies():
    """Remove the copies without users."""
    bpy.data.batch_remove([image for image in bpy.data.images if is_data_copy(image) and image.users == 0])


def _follow(copy, original, state):
    """Bring a copy up to date with its original, whose `image_state` is `state`, in place.

    Leaves alone what is not a copy, a copy of another image, and a copy whose original's file is missing. Raises
    MapError if the pixels cannot be copied; the copy is as it was then.
    """
    if state == "" or copy == original or not is_data_copy(copy) or not _belongs(copy, original):
        return
    copy[COPY_OF] = original.name_full
    if copy[COPY_STATE] != state:
        _fill(copy, original, state)


def _belongs(copy, original) -> bool:
    """Whether `copy` was made of `original`, which may have been renamed, unless another image has its old name now."""
    if copy[COPY_OF] == original.name_full:
        return True
    return all(image.name_full != copy[COPY_OF] for image in bpy.data.images)


def _fill(copy, original, state):
    """Give `copy` the values of `original`, whose `image_state` is `state`."""
    contents = _contents(original)
    if contents is None:
        if copy.packed_file is not None:
            copy.unpack(method="REMOVE")
        if copy.source == "TILED":
            copy.source = "FILE"
        copy.filepath = _path_here(original)  # Blender reads the file anew, even if it is the same
        if copy.source != original.source and is_several(original):
            copy.source = original.source  # Blender then looks for the other tiles
    else:
        # With a path Blender would replace what is packed by the file as soon as it is told to reload.
        if copy.filepath:
            copy.filepath = ""
        copy.pack(data=contents, data_len=len(contents))
        copy.buffers_free()
    copy[COPY_OF], copy[COPY_STATE], copy[COPY_CONTENT] = original.name_full, state, _content(copy)
    copy.update_tag()


def _contents(image) -> bytes | None:
    """An image file with the values of `image` as data; None if the image's file holds them already."""
    if not is_unsaved(image):
        return None if image.packed_file is None else image.packed_file.data
    from ..bake.image_bytes import image_bytes  # OpenImageIO, which no other image needs
    from .color_spaces import stored_values

    pixels = read_pixels(image)
    # Pixels that were never in a file are as somebody wrote them; Blender decodes a file's floats when it loads it.
    if image.is_float and image.source == "FILE":
        pixels = stored_values(pixels, image)
    return image_bytes(pixels, is_float=image.is_float, name=image.name)


def _path_here(image) -> str:
    """The path of an image's file as an image of this .blend file has it: relative if the image's path is relative."""
    if image.library is None or not image.filepath.startswith("//") or not bpy.data.filepath:
        return image.filepath if image.library is None else str(image_path(image))
    try:
        return bpy.path.relpath(str(image_path(image)))
    except ValueError:  # another drive
        return str(image_path(image))


def _content(copy) -> str:
    """What tells an image's pixels cheaply, wherever the .blend file is moved: name of its file, bytes packed."""
    packed = copy.packed_file.size if copy.packed_file is not None else ""
    return f"{copy.source}|{image_path(copy).name}|{packed}"
