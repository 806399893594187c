"""Sentences in panels: Blender's labels do not wrap, so the words are put on lines here."""

import textwrap

# Mean width in pixels at scale 1 of a character of a sentence in Blender 5.2's default font: decision 57.
CHARACTER_WIDTH = 5.9
MARGIN = 70  # pixels at scale 1: the panel's borders, the box and the icon
SHORTEST_LINE = 20  # characters; below this the panel is too narrow to care


def line_length(context) -> int:
    """How many characters of a sentence fit on a line of the region being drawn."""
    pixels = context.region.width / context.preferences.system.ui_scale - MARGIN
    return max(SHORTEST_LINE, int(pixels / CHARACTER_WIDTH))


def draw_sentence(layout, context, sentence: str, icon: str = "NONE"):
    """Draw `sentence` in as many labels as it needs, the icon before the first."""
    column = layout.column(align=True)
    column.scale_y = 0.8  # labels of one sentence belong together
    for number, line in enumerate(textwrap.wrap(sentence, line_length(context))):
        later = "BLANK1" if icon != "NONE" else "NONE"
        column.label(text=line, icon=icon if number == 0 else later)
