"""What laws work out in every tick, as loops that numba compiles; imported when a law is made."""
