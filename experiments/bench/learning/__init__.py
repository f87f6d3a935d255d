"""Benchmarks of the self-calibrating law: what a tick costs, and how it works for hours."""
