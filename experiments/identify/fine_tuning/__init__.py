"""Fine tuning of a feedforward on the robot: its model's numbers by how the tip truly moves."""
