"""Time- and energy-optimal motion, planned, driven in the plant and compared with the usual timing."""
