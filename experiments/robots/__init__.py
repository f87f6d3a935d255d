"""``truetip robots``: which there are, and robots from URDF."""
