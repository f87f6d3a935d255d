"""What this machine has of what truetip can use."""
