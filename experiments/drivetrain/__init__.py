"""``truetip drivetrain``: what drive trains are made of, as figures."""
