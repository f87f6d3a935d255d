"""Parts of one kind as one part whose parameters are arrays, so that many are evaluated at once."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def stacked(parts: Sequence[Any]) -> Any:
    """One part with arrays of the parameters of all, along the first axis; parts within parts likewise."""
    values = {}
    for entry in fields(parts[0]):
        if entry.init:
            each = [getattr(part, entry.name) for part in parts]
            values[entry.name] = stacked(each) if is_dataclass(each[0]) else np.array(each, dtype=float)
    return type(parts[0])(**values)
