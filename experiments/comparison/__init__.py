"""Laws side by side on one scenario, and their numbers."""
