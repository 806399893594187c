"""How a normal map may be read: each choice, its values, and what they are called on screen and in Blender's nodes.

This is the one list: the node group, the checks, the operators and the panel read it, so a value that is added here
appears in all of them. tests/nodes/test_map_choices.py names the places that have to learn what it means.
"""

from __future__ import annotations

from dataclasses import dataclass

# Blender's own nodes, which say what the group reads.
IMAGE_NODE, NORMAL_NODE, FACETS_NODE = "Normal Map Image", "Tangent Space", "Facets"
SHUFFLE_NODE = "Shuffle"  # moves the coordinates of all images in the group: see tiles


@dataclass(frozen=True)
class Value:
    """One value of a choice; `in_node` is Blender's own name for it, where that differs from the identifier, and
    `number` what the input of the OSL node is, where the choice has one."""

    identifier: str
    label: str
    help: str
    in_node: str = ""
    number: int = 0

    @property
    def native(self) -> str:
        """What Blender's own node calls it."""
        return self.in_node or self.identifier


@dataclass(frozen=True)
class Choice:
    """A choice of how a map is read; its first value is the default.

    name: field of `MapBinding`, setting of the operators, and property of the group's node `node` (of SURFACE the kind
    of that node says it, see surface_kinds; of VARIATION whether it is there, see tiles); number: input of the OSL node
    that takes the value's number, or empty where the tables say it; expected: the value that the panel does not
    mention.
    """

    name: str
    label: str
    help: str
    node: str
    values: tuple[Value, ...]
    number: str = ""
    expected: str = ""

    @property
    def default(self) -> str:
        """Identifier of the first value."""
        return self.values[0].identifier

    @property
    def identifiers(self) -> tuple[str, ...]:
        """The values, as in files and arguments."""
        return tuple(value.identifier for value in self.values)

    @property
    def items(self) -> tuple[tuple[str, str, str], ...]:
        """The values as Blender's EnumProperty takes them."""
        return tuple((value.identifier, value.label, value.help) for value in self.values)

    def value(self, identifier: str) -> Value:
        """The value of that identifier. Raises KeyError if there is none."""
        return {value.identifier: value for value in self.values}[identifier]

    def identifier(self, native: str) -> str:
        """Identifier of the value that Blender's own node calls `native`; of any other name the name in capitals."""
        return {value.native: value.identifier for value in self.values}.get(native, native.upper())


SURFACE = Choice(
    "surface",
    "Surface",
    "What a facet of the surface is made of",
    FACETS_NODE,
    (
        Value("TINT", "Tint", "One colour at all angles, as Glossy BSDF"),
        Value("METAL", "Metal", "Metal by base colour and edge tint, as Metallic BSDF (F82 Tint)", number=1),
        Value("CONDUCTOR", "Conductor", "Metal by IOR and extinction, as Metallic BSDF (Physical Conductor)", number=2),
        Value("DIELECTRIC", "Dielectric", "Ice, mica, sand, lacquer: the reflection of Principled BSDF, always GGX",
              number=3),
    ),
    number="Surface",
    expected="TINT",
)
DISTRIBUTION = Choice(
    "distribution",
    "Distribution",
    "Microfacet distribution around each normal of the map",
    FACETS_NODE,
    (
        Value("BECKMANN", "Beckmann", "Gaussian slopes: crisp glints without tails"),
        Value("GGX", "GGX", "Long tails: a soft halo around each glint", number=1),
    ),
    number="GGX",
)
INTERPOLATION = Choice(
    "interpolation",
    "Interpolation",
    "How normals are read between texels",
    IMAGE_NODE,
    (
        Value("LINEAR", "Linear", "Smooth maps: waves, scratches, brushed metal", in_node="Linear", number=1),
        Value("CLOSEST", "Closest", "One flat facet a texel: metallic flakes, sequins", in_node="Closest"),
    ),
    number="Linear",
)
CONVENTION = Choice(
    "convention",
    "Convention",
    "Which way the map's green channel points",
    NORMAL_NODE,
    (
        Value("OPENGL", "OpenGL", "Green points up (Y+), as in Blender"),
        Value("DIRECTX", "DirectX", "Green points down (Y-)"),
    ),
)
EXTENSION = Choice(
    "extension",
    "Extension",
    "What is outside the map's own square of UVs",
    IMAGE_NODE,
    (
        Value("REPEAT", "Repeat", "The map again: no edge", number=1),
        Value("EXTEND", "Extend", "The map's outermost texels; rendered by Blender's own nodes, from the edge on"),
        Value("CLIP", "Clip", "Nothing: black; the edge is rendered by Blender's own nodes"),
        Value("MIRROR", "Mirror", "The map mirrored; rendered by Blender's own nodes, from the edge on"),
    ),
    number="Repeats",
    expected="REPEAT",
)

VARIATION = Choice(
    "variation",
    "Variation",
    "How the repeats of a map differ",
    SHUFFLE_NODE,
    (
        Value("REPEAT", "Repeat", "They do not: each is the whole map"),
        Value("SHUFFLE", "Shuffle", "Flakes, endless: each repeat is another cut of the map; for Closest", number=1),
    ),
    number="Variation",
    expected="REPEAT",
)

# By name, in the order of the dialog.
CHOICES = {choice.name: choice for choice in (SURFACE, DISTRIBUTION, INTERPOLATION, CONVENTION, EXTENSION, VARIATION)}
