"""The two commands that run laws: `compare` and `run`."""
