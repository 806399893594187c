"""The scene made ready: tables, sets of lights, Open Shading Language, and what changed since."""
