"""Node groups, one file each; GROUPS maps the name in the menu to the function that gets or builds it."""

from . import checker, glint_bsdf, glint_lights, image_texture, scale

GROUPS = {
    "Glint BSDF": glint_bsdf.build,
    "Glint Lights": glint_lights.build,
    "Glint Checker": checker.build,
    "Glint Image Texture": image_texture.build,
    "Glint Scale": scale.build,
}
