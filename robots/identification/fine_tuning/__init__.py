"""Tuning of an inverse model on the robot: what may change, and by how much it does."""
