"""What a controller learns while it works: the robot's geometry and springs, its load, delays and drives."""
