"""Robot programs for the robot as it is: ``truetip compensate``."""
