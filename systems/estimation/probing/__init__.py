"""Motion before a path, which shows what it needs: a knock for the dead time, oscillations for the robot."""
