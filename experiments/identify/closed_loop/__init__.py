"""Drives refined from recorded motions: commands go through them to the motors and the arm behind these."""
