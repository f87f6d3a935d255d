"""Benchmarks of a client that guides a virtual cell in a process of its own."""
