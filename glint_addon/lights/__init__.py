"""The lights of a scene as hints: which there are, how large, where, and the drivers that follow them."""
