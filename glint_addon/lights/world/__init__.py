"""What the world holds for glints to look for: suns of skies and bright spots of pictures, and which way they lie."""
