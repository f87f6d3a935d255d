"""The law that learns what robot, drives and load it has: what it learns, what it plans, and its ports."""
