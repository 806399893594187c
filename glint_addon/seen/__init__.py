"""What cameras see: of objects, of their surfaces, and of the maps on them, in texels."""
