"""``truetip zeros``: which robots have an exact inverse, and which do not."""
