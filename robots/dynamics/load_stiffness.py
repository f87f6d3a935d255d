"""The stiffness that gravity and counterbalance add to springs, about rest."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context

from robots.dynamics.plant import PlantRobot

_STEP = 1e-4  # rad; central differences of a load that changes over radians are right to eight digits


def load_stiffness(parts: PlantRobot, context: Context, rows: Sequence[int]) -> np.ndarray:
    """-d(load) / d(positions) in N m / rad at the positions of a context, which is left as it was.

    Args:
        parts: the robot.
        context: of its plant.
        rows: of which positions, n numbers.

    Returns:
        Shape (n, n), symmetric.
    """
    plant = parts.plant
    rest = plant.GetPositions(context)
    stiffness = np.empty((len(rows), len(rows)))
    positions = rest.copy()
    for column, row in enumerate(rows):
        loads = []
        for step in (_STEP, -_STEP):
            positions[row] = rest[row] + step
            plant.SetPositions(context, positions)
            loads.append(parts.load(context)[rows])
        positions[row] = rest[row]
        stiffness[:, column] = -(loads[0] - loads[1]) / (2.0 * _STEP)
    plant.SetPositions(context, rest)
    # Loads with a potential have a symmetric stiffness; the differences have rounding.
    return 0.5 * (stiffness + stiffness.T)
