"""Motors in their control loops and the elastic arm that they move, along a measured motion."""
