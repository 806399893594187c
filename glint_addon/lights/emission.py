"""How brightly a material shines: an estimate from its shader nodes, to rank emissive meshes by.

As Cycles' own estimate (`output_estimate_emission` in scene/shader.cpp), which decides what is sampled as a light: a
linked colour or strength that only rendering could tell counts as 1, mixed shaders by their factor. Numbers that are
animated count at their highest key.
"""

from __future__ import annotations

from .node_numbers import number, source

# Cycles samples emission on its own account ("Auto") above this radiance [W/(m^2 sr)].
LEAST_SAMPLED = 0.5
UNKNOWN = 1.0  # a colour or strength that is not a plain number


def sampled_radiance(material) -> float:
    """Highest channel of the radiance [W/(m^2 sr)] that `material` sends out; 0 if Cycles meets it by chance alone.

    Hints would not help there: what a chosen facet mirrors is found no sooner than what a random one does.
    """
    tree = material.node_tree if material else None
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None or material.cycles.emission_sampling == "NONE":
        return 0.0
    found = max(_radiance(material, output.inputs["Surface"], ()))
    return found if found > LEAST_SAMPLED or material.cycles.emission_sampling != "AUTO" else 0.0


def _radiance(material, socket, groups) -> tuple[float, float, float]:
    """Linear RGB that comes in at a shader socket within `groups`."""
    end, groups = source(socket, groups)
    node = end.node if end is not None and end.is_output else None
    if node is None:
        return 0.0, 0.0, 0.0
    if node.bl_idname == "ShaderNodeEmission":
        return _emission(material, node.inputs["Color"], node.inputs["Strength"], groups)
    if node.bl_idname == "ShaderNodeBsdfPrincipled":
        return _emission(material, node.inputs["Emission Color"], node.inputs["Emission Strength"], groups)
    if node.bl_idname == "ShaderNodeAddShader":
        first, second = (_radiance(material, entry, groups) for entry in node.inputs)
        return tuple(a + b for a, b in zip(first, second, strict=True))
    if node.bl_idname == "ShaderNodeMixShader":
        factor, *shaders = node.inputs
        known = number(material, factor, groups)
        weights = (1.0, 1.0) if known is None or known.moves else (1.0 - known.value, known.value)
        first, second = (_radiance(material, entry, groups) for entry in shaders)
        return tuple(weights[0] * a + weights[1] * b for a, b in zip(first, second, strict=True))
    return 0.0, 0.0, 0.0


def _emission(material, colour, strength, groups):
    end, _ = source(colour, groups)
    is_plain = end is not None and (not end.is_output or end.node.bl_idname == "ShaderNodeRGB")
    tint = tuple(end.default_value)[:3] if is_plain else (UNKNOWN,) * 3
    known = number(material, strength, groups)
    peak = UNKNOWN if known is None or known.moves and known.peak <= 0.0 else known.peak
    return tuple(peak * channel for channel in tint)
