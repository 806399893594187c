"""What a Glint BSDF group reads, and how: Blender's own nodes inside the group say it.

No property repeats that: whoever changes these nodes changes what is prepared. An image in a custom property would be
lost, because each preview of a material takes one of its users away.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import bpy

from ..errors import MapError, SceneError
from ..images import Frames, is_several
from ..properties import OLD_CONVENTION, OLD_DISTRIBUTION, OLD_EXTENSION, OLD_IMAGE, OLD_INTERPOLATION, OLD_UV_MAP
from .builder import version_of
from .flake_nodes import FLAKE_COLOR_NODE, PRESENCE_NODE, flake_color_of, original_image, presence_of
from .map_choices import (
    CHOICES,
    CONVENTION,
    DISTRIBUTION,
    EXTENSION,
    FACETS_NODE,
    IMAGE_NODE,
    INTERPOLATION,
    NORMAL_NODE,
    SURFACE,
    VARIATION,
)
from .map_tables import stored_text
from .surface_kinds import KINDS, surface_of
from .tiles import variation_of

ORIGINAL_NODE = "Original"  # of an image that is shown as colour elsewhere: the group reads a copy, and this holds it

# Up to version 9 custom properties said what a group reads.
VERSION_OF_NODES = 10


@dataclass(frozen=True)
class MapBinding:
    """A normal map, the user's own image, and how it is read: by which value of each of CHOICES and which UV map.

    frames: of an image sequence, None of any other image. presence: image that says which texels are flakes, or None
    if all are; flake_color: image with a colour for each, or None; see `flake_nodes`. A surface whose node has but one
    distribution has that one.
    """

    image: bpy.types.Image | None = None
    interpolation: str = INTERPOLATION.default
    convention: str = CONVENTION.default
    distribution: str = DISTRIBUTION.default
    uv_map: str = ""
    extension: str = EXTENSION.default
    frames: Frames | None = None
    surface: str = SURFACE.default
    presence: bpy.types.Image | None = None
    flake_color: bpy.types.Image | None = None
    variation: str = VARIATION.default

    def __post_init__(self):
        for name in (name for name in READING if name in CHOICES):
            value, choice = getattr(self, name), CHOICES[name]
            if value not in choice.identifiers:
                raise MapError(f'{choice.label} "{value}" is unknown: use one of {", ".join(choice.identifiers)}.')
        if KINDS[self.surface].distribution:
            object.__setattr__(self, "distribution", KINDS[self.surface].distribution)
        self._check_flakes()
        self._check_variation()

    @property
    def has_flakes(self) -> bool:
        """Whether some texels are no flakes, or flakes have colours."""
        return self.presence is not None or self.flake_color is not None

    def _check_flakes(self):
        """Raise MapError for flakes that there cannot be."""
        if not self.has_flakes:
            return
        image = self.presence or self.flake_color
        if self.interpolation != "CLOSEST":
            raise MapError(f'Image "{image.name}" is of single flakes, and the normal map is read with '
                           f"{INTERPOLATION.value(self.interpolation).label} interpolation: choose Closest.")
        if self.flake_color is not None and KINDS[self.surface].color is None:
            raise MapError(f'Image "{self.flake_color.name}" has colours of flakes, and the surface '
                           f"{SURFACE.value(self.surface).label} has no colour: choose another surface.")
        for each in (self.image, self.presence, self.flake_color):
            if each is not None and is_several(each):
                raise MapError(f'Image "{each.name}" is not a single picture, as images of flakes and their normal map '
                               "have to be: choose an image.")


    def _check_variation(self):
        """Raise MapError for a variation of repeats that there cannot be."""
        if self.variation == VARIATION.default:
            return
        variation = f"Variation {CHOICES[VARIATION.name].value(self.variation).label}"
        if self.extension != EXTENSION.default:
            raise MapError(f"{variation} is of maps that repeat, and the Extension is "
                           f"{EXTENSION.value(self.extension).label}: choose {EXTENSION.values[0].label}.")
        if self.variation == "SHUFFLE" and self.interpolation != "CLOSEST":
            raise MapError(f"{variation} cuts between texels, and the normal map is read with "
                           f"{INTERPOLATION.value(self.interpolation).label} interpolation: choose Closest.")
        if self.image is not None and is_several(self.image):
            raise MapError(f'{variation} is of a single picture, which image "{self.image.name}" is not: choose '
                           "another image, or the Variation Repeat.")


# The choices that a property of a node says: not the kind of surface and the variation, which other nodes say.
PROPERTIES = {name: choice for name, choice in CHOICES.items() if choice not in (SURFACE, VARIATION)}
IMAGES = ("image", "presence", "flake_color")
# The fields that say how any map is read.
READING = tuple(field.name for field in fields(MapBinding) if field.name not in (*IMAGES, "frames"))


def map_of(group) -> bpy.types.Image | None:
    """The normal map of a Glint BSDF group: the user's own image, though the group may read a copy of it."""
    if IMAGE_NODE not in group.nodes:
        return group.get(OLD_IMAGE)
    return original_image(group, IMAGE_NODE, ORIGINAL_NODE)


def image_read(group) -> bpy.types.Image | None:
    """The image whose pixels a Glint BSDF group reads: its map, or the copy of that which is read as data."""
    texture = group.nodes.get(IMAGE_NODE)
    return texture.image if texture is not None else group.get(OLD_IMAGE)


def nodes_binding(group) -> MapBinding:
    """What the nodes of a Glint BSDF group say, or its properties if it is of version 9 or before.

    Raises MapError for a way of reading that glints cannot follow, SceneError if one of the nodes is missing.
    """
    if is_old(group):
        return _old_binding(group)
    nodes = {name: _node(group, name) for name in (IMAGE_NODE, NORMAL_NODE, FACETS_NODE)}
    chosen = {name: choice.identifier(getattr(nodes[choice.node], name)) for name, choice in PROPERTIES.items()}
    image = map_of(group)
    moves = image is not None and image.source == "SEQUENCE"
    frames = Frames.of(nodes[IMAGE_NODE].image_user) if moves else None
    return MapBinding(image, uv_map=nodes[NORMAL_NODE].uv_map, frames=frames, surface=surface_of(group),
                      presence=presence_of(group), flake_color=flake_color_of(group), variation=variation_of(group),
                      **chosen)


def write_reading(group, binding: MapBinding, copies=None):
    """Let Blender's own nodes in a group say how `binding` is read; see `glint_bsdf.follow_map` for its image.

    copies: {name of one of these nodes: names of the nodes that are to say the same instead}.
    """
    own = (IMAGE_NODE, NORMAL_NODE, FACETS_NODE, PRESENCE_NODE, FLAKE_COLOR_NODE)
    copies = copies or {name: (name,) for name in own}
    flakes = [copy for name in (PRESENCE_NODE, FLAKE_COLOR_NODE) if name in group.nodes for copy in copies[name]]
    copies = copies | {IMAGE_NODE: (*copies[IMAGE_NODE], *flakes)}
    values = [(choice.node, name, choice.value(getattr(binding, name)).native) for name, choice in PROPERTIES.items()]
    for original, name, value in (*values, (NORMAL_NODE, "uv_map", binding.uv_map)):
        for node in (group.nodes[copy] for copy in copies[original]):
            if getattr(node, name) != value:
                setattr(node, name, value)
    if binding.frames is not None:
        for copy in copies[IMAGE_NODE]:
            binding.frames.write_to(group.nodes[copy].image_user)


def is_old(group) -> bool:
    """Whether properties of the group, which is of version 9 or before, say what it reads."""
    return OLD_INTERPOLATION in group and version_of(group) < VERSION_OF_NODES


def drop_pointers():
    """Let groups of version 9 and before keep their map in a node alone, before a preview takes it from them."""
    for group in bpy.data.node_groups:
        if group.library is None and group.get(OLD_IMAGE) is not None and IMAGE_NODE in group.nodes:
            if group.nodes[IMAGE_NODE].image is None:
                group.nodes[IMAGE_NODE].image = group[OLD_IMAGE]
            del group[OLD_IMAGE]


def _old_binding(group) -> MapBinding:
    """What a group of version 9 or before reads; its node has the image where the property has lost it."""
    texture = group.nodes.get(IMAGE_NODE)
    return MapBinding(
        group.get(OLD_IMAGE) or (texture.image if texture is not None else None),
        group[OLD_INTERPOLATION],
        group.get(OLD_CONVENTION, CONVENTION.default),
        group.get(OLD_DISTRIBUTION, DISTRIBUTION.default),
        stored_text(group, OLD_UV_MAP),
        group.get(OLD_EXTENSION, EXTENSION.default),  # groups of version 3 and before have none
    )


def _node(group, name):
    node = group.nodes.get(name)
    if node is None:
        raise SceneError(f'Node group "{group.name}" has lost its node "{name}": add its material anew.')
    return node
