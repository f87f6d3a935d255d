"""Whole images of a simulated cell with people in it."""
