"""``truetip feedforward``: inverse models compared on an elastic robot."""
