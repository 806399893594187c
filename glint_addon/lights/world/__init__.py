"""Lights of the world as hints: suns of skies, bright spots of pictures, and the directions in which they lie."""
