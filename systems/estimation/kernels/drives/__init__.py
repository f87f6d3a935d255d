"""What drives are told, and what is learnt from how motors follow."""

from systems.estimation.kernels.drives.commands import WAITING, command
from systems.estimation.kernels.drives.regression import MATCHED, deviate, features, learn, look_back

__all__ = ["MATCHED", "WAITING", "command", "deviate", "features", "learn", "look_back"]
