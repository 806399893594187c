"""Values of the sockets that belong to a kind of surface, checked at the door."""

from __future__ import annotations

from numbers import Real

from ..errors import MapError
from ..nodes.builder import Socket
from ..nodes.map_choices import SURFACE
from ..nodes.surface_kinds import EDGE_TINT, EXTINCTION, KINDS, METALS

# Names of the arguments of `create_glint_material`, in its order, and what they are called in refusals.
WORDS = {"color": "Color", "edge_tint": "Edge Tint", "ior": "IOR", "extinction": "Extinction"}


def surface_values(material: str, surface: str, *, metal="", **given) -> dict[str, object]:
    """{socket name: value} of the sockets of a kind of surface.

    metal: name in METALS, whose numbers are taken, or ""; given: the arguments color, edge_tint, ior and extinction;
    None is the metal's, else the socket's own default. Raises MapError for a value that the socket or the kind of
    surface has not.
    """
    if surface not in KINDS:
        raise MapError(f'{SURFACE.label} "{surface}" is unknown: use one of {", ".join(KINDS)}.')
    sockets = {_argument(socket): socket for socket in KINDS[surface].sockets}
    values = {name: socket.default for name, socket in sockets.items()} | _of_metal(material, surface, metal)
    for name, value in given.items():
        if value is None:
            continue
        if name not in sockets:
            kinds = ", ".join(f'"{each}"' for each, kind in KINDS.items() if name in map(_argument, kind.sockets))
            raise MapError(f'Glint material {material} has {WORDS[name]}, which the surface "{surface}" has not: leave '
                           f"it out, or use {kinds}.")
        values[name] = checked(material, sockets[name], WORDS[name], value)
    return {sockets[name].name: value for name, value in values.items()}


def _argument(socket: Socket) -> str:
    """The argument that gives the value of a socket: the colour of a kind is `color`, whatever its node calls it."""
    names = {EDGE_TINT: "edge_tint", EXTINCTION: "extinction"}
    return names.get(socket) or ("color" if socket.kind == "NodeSocketColor" else "ior")


def _of_metal(material, surface, metal) -> dict[str, object]:
    """Arguments that describe the metal of that name."""
    if metal == "":
        return {}
    if metal not in METALS:
        raise MapError(f'Metal "{metal}" of glint material {material} is unknown: use one of {", ".join(METALS)}.')
    found = METALS[metal]
    if surface == "METAL":
        return {"color": (*found.base_color, 1.0), "edge_tint": (*found.edge_tint, 1.0)}
    if surface == "CONDUCTOR":
        return {"ior": found.ior, "extinction": found.extinction}
    raise MapError(f'Glint material {material} is of metal, and its surface "{surface}" is not: use "METAL" or '
                   '"CONDUCTOR".')


def checked(material, socket, word, value):
    """What Blender's socket takes for `value`, called `word`; raises MapError for what it does not take."""
    if socket.kind == "NodeSocketFloat":
        if not isinstance(value, Real) or not socket.low <= value <= socket.high:
            raise MapError(f"{word} {value} of glint material {material} is out of range: use {socket.low:g} to "
                           f"{socket.high:g}.")
        return value
    try:
        numbers = [float(number) for number in value]
    except (TypeError, ValueError):
        numbers = []
    is_color = socket.kind == "NodeSocketColor"
    high = float("inf") if is_color else socket.high
    if len(numbers) not in ((3, 4) if is_color else (3,)) or not all(socket.low <= each <= high and each < float("inf")
                                                                     for each in numbers):
        kind, allowed = ("no color", f"from {socket.low:g}") if is_color else (
            "not three numbers in range", f"from {socket.low:g} to {socket.high:g}")
        raise MapError(f"{word} {value} of glint material {material} is {kind}: use three numbers {allowed}.")
    return (*numbers[:3], 1.0) if is_color else tuple(numbers)
