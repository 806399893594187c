"""Settings of a scene as the command line names them: samples, resolution, view layers, options of Cycles."""

from __future__ import annotations

import math
import re
from difflib import get_close_matches
from typing import Any

from ..errors import SceneError

YES, NO = {"true", "on", "yes", "1"}, {"false", "off", "no", "0"}
# What an option of each of Blender's kinds holds, in words; other kinds, such as pointers, cannot be written as text.
KINDS = {"BOOLEAN": "true or false", "INT": "a whole number", "FLOAT": "a number", "ENUM": "one of a few words"}


def set_number(owner, name: str, value: float, words: str):
    """Set the property `name` of one of Blender's structs; `words` name the value in the sentence that refuses it.

    Raises SceneError if it is outside the property's limits, to which Blender would clip it without a word.
    """
    limits = owner.bl_rna.properties[name]
    if not limits.hard_min <= value <= limits.hard_max:
        form = "d" if limits.type == "INT" else ".7g"
        low, high = (format(limit, form) for limit in (limits.hard_min, limits.hard_max))
        raise SceneError(f"{words} cannot be used: give at least {low} and at most {high}.")
    setattr(owner, name, value)


def set_samples(scene, samples: int):
    """Let Cycles take `samples` a pixel.

    Raises SceneError if it takes no such number.
    """
    set_number(_cycles(scene), "samples", samples, f"{samples} samples")


def set_resolution(scene, words: str):
    """Set the picture's size: "1920x1080" in pixels, the scene's percentage then 100, or "50%" of the scene's own.

    Raises SceneError for anything else.
    """
    match = re.fullmatch(r"(\d+)x(\d+)|(\d+)%", words)
    if match is None:
        raise SceneError(f'The resolution "{words}" cannot be read: write it like 1920x1080, or 50% for half of it.')
    width, height, percentage = match.groups()
    if percentage is None:
        set_number(scene.render, "resolution_x", int(width), f"{width} pixels of width")
        set_number(scene.render, "resolution_y", int(height), f"{height} pixels of height")
    set_number(scene.render, "resolution_percentage", int(percentage or 100), f"{words} of the resolution")


def use_view_layers(scene, names: list[str]):
    """Let `scene` render the view layers `names` alone.

    Raises SceneError if it lacks one of them.
    """
    for name in names:
        if name not in scene.view_layers:
            known = ", ".join(scene.view_layers.keys())
            raise SceneError(f'Scene "{scene.name}" has no view layer named "{name}": choose among {known}.')
    for layer in scene.view_layers:
        layer.use = layer.name in names
    scene.render.use_single_layer = False


def set_engine_option(scene, words: str):
    """Set a property of `scene.cycles` as "NAME=VALUE" says, for example "use_denoising=false".

    Raises SceneError for an unknown name, which lists those near, and for a value that it cannot have.
    """
    name, equals, text = (part.strip() for part in words.partition("="))
    if not equals:
        raise SceneError(f'The engine option "{words}" has no value: write NAME=VALUE, such as use_denoising=false.')
    cycles = _cycles(scene)
    known = {item.identifier: item for item in cycles.bl_rna.properties if item.type in KINDS and not item.is_readonly}
    if name not in known:
        near = ", ".join(get_close_matches(name, known, cutoff=0.5)) or "none"
        raise SceneError(f'Cycles has no option named "{name}" (near to it: {near}): write it as scene.cycles has it.')
    kind = known[name].type
    if kind == "ENUM":
        _set_word(cycles, name, text)
    elif kind == "BOOLEAN":
        setattr(cycles, name, _flag(name, text))
    else:
        set_number(cycles, name, _number(name, text, kind), f"{text} for the engine option {name}")


def _cycles(scene) -> Any:
    """Settings of Cycles, which must be what renders `scene`."""
    if not hasattr(scene, "cycles"):
        raise SceneError("Cycles is switched off: switch it on in Edit > Preferences > Add-ons and try again.")
    if scene.render.engine != "CYCLES":
        raise SceneError(f'Scene "{scene.name}" is rendered by {scene.render.engine}, which takes no samples or '
                         "options of Cycles: choose Cycles in the file, or leave them out.")
    return scene.cycles


def _set_word(cycles, name: str, text: str):
    try:
        # Nearly all of these words are in capitals; they may be given in small letters.
        setattr(cycles, name, text.upper() if getattr(cycles, name).isupper() else text)
    except TypeError as error:  # its text lists the words there are: enum "x" not found in ('CPU', 'GPU')
        choices = ", ".join(re.findall(r"'([^']+)'", str(error)))
        raise SceneError(f'The engine option {name} cannot be "{text}": choose one of {choices}.') from error


def _flag(name: str, text: str) -> bool:
    if text.lower() not in YES | NO:
        raise _wrong_kind(name, text, "BOOLEAN")
    return text.lower() in YES


def _number(name: str, text: str, kind: str) -> float:
    try:
        value = int(text) if kind == "INT" else float(text)
    except ValueError as error:
        raise _wrong_kind(name, text, kind) from error
    if math.isnan(value):
        raise _wrong_kind(name, text, kind)
    return value


def _wrong_kind(name: str, text: str, kind: str) -> SceneError:
    return SceneError(f'The engine option {name} cannot be "{text}": it is {KINDS[kind]}.')
