"""Laws to compare others with: what repetition, or observation, reaches without a better model."""
