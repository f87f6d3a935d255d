"""The self-calibrating law on a cell whose physics and drives are not ours: MuJoCo's, and written anew."""
