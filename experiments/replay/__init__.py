"""The robot in motion, live or recorded, in meshcat."""
