"""The robot as believed and as identified in the full nonlinear simulation, beside what was measured."""
