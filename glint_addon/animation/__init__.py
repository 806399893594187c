"""What moves in a scene: whether objects may, where they are at other frames, and which frames are looked at."""
