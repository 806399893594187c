"""Blender's images as arrays and as normal maps: their pixels, whether they changed, and copies of them as data."""

from .data_copies import data_image, is_data_copy, remove_unused_copies
from .files import Frames, image_files, image_path, is_several, is_still, sequence_frames
from .generated import (
    Pictures,
    check_unchanged,
    flake_images,
    is_edited,
    is_generated_map,
    is_preview,
    new_generated_map,
    parts,
    pictures,
    recipe_of,
    show,
)
from .normal_map import flake_color_image, normal_map_image, presence_image
from .pixels import image_pixels, image_shape, is_layered, layer_pixels, read_pixels
from .state import ImageStates, file_digest, image_stamp, image_state, is_unsaved

__all__ = (
    "Frames",
    "ImageStates",
    "Pictures",
    "check_unchanged",
    "data_image",
    "file_digest",
    "flake_color_image",
    "flake_images",
    "image_files",
    "image_path",
    "image_pixels",
    "image_shape",
    "image_stamp",
    "image_state",
    "is_data_copy",
    "is_edited",
    "is_generated_map",
    "is_layered",
    "is_preview",
    "is_several",
    "is_still",
    "is_unsaved",
    "layer_pixels",
    "new_generated_map",
    "normal_map_image",
    "parts",
    "pictures",
    "presence_image",
    "read_pixels",
    "recipe_of",
    "remove_unused_copies",
    "sequence_frames",
    "show",
)
