"""A real station or a virtual cell: runs, latency, and ``truetip cell``."""
