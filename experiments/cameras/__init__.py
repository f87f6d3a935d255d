"""``truetip cameras``: calibration of a cell, and what limits the accuracy of a pose."""
