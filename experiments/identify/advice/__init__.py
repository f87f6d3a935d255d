"""Which further motions or sensors would show what a recording does not."""
