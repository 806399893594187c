"""Node groups, one file each; GROUPS maps the name in the menu to the function that gets or builds it."""

from . import glint_lights

GROUPS = {
    "Glint Lights": glint_lights.build,
}
