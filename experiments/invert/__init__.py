"""``truetip invert``: the stable inverse of an elastic robot against the causal ones."""
