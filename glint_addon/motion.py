"""Whether an object may move or change its shape: what is judged at one frame must hold at every other."""

from __future__ import annotations

# Modifiers that leave a mesh within its box, or very nearly.
KEEPS_THE_BOX = {"BEVEL", "EDGE_SPLIT", "SUBSURF", "TRIANGULATE", "WEIGHTED_NORMAL"}


def is_fixed(thing) -> bool:
    """Whether object `thing` stays as it is at every frame, as far as can be told; False in doubt."""
    shapes = getattr(thing.data, "shape_keys", None)
    return (
        not any(_is_animated(block) for block in (thing, thing.data, shapes))
        and not thing.constraints
        and thing.rigid_body is None
        and all(modifier.type in KEEPS_THE_BOX for modifier in thing.modifiers)
        and (thing.parent is None or thing.parent_type == "OBJECT" and is_fixed(thing.parent))
    )


def _is_animated(block) -> bool:
    animation = getattr(block, "animation_data", None)
    return animation is not None and bool(animation.action or animation.nla_tracks or animation.drivers)
