"""How far the true tip is from its path, over many robots: the tables of the manual."""
