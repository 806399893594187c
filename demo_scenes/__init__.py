"""Scenes that show what Glint does and measure it against Blender's own nodes; `python -m demo_scenes` renders them."""
