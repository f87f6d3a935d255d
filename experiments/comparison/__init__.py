"""Comparison of laws on one scenario."""
