"""``truetip modes``: natural frequencies and shapes."""
