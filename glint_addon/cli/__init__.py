"""The command line: what `blender --command glint` and `python -m glint_addon` do."""
