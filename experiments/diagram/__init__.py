"""``truetip diagram``: the wiring as a picture."""
