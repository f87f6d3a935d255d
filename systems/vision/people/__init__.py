"""People in a cell, seen by its cameras without learnt weights. An aid, not a safety function."""
