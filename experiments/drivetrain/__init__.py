"""``truetip drivetrain``: figures of the drive-train models."""
