"""Animation of the robot in Meshcat, live or recorded."""
