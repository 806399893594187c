"""`python -m glint_addon prepare|render|info FILE.blend`, for the pip module bpy."""

import sys

from .cli.streams import blender_talks_to_stderr

with blender_talks_to_stderr():
    import bpy  # noqa: F401  (Blender's other modules are found only after it)

from . import register
from .cli.command import main

register()
sys.exit(main(sys.argv[1:], program="python -m glint_addon"))
