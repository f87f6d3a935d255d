"""The cameras of a cell from what they saw of a wand and a frame of known size."""
