"""Laws against many robots: what is left of the error in the worst case and in the median."""
