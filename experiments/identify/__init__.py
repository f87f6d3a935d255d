"""``truetip identify``: stiffness and damping of a robot from recorded motions."""
