"""What drives are told, and what is learnt from how motors follow."""

from systems.estimation.kernels.drives.commands import command
from systems.estimation.kernels.drives.regression import MATCHED, deviate, features, learn, look_back

__all__ = ["MATCHED", "command", "deviate", "features", "learn", "look_back"]
