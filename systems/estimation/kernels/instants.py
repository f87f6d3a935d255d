"""What encoders, plan and camera say of one instant."""

import numpy as np

from robots.compiled import compiled
from systems.estimation.kernels.history import cubic_at, row_at
from systems.estimation.kernels.poses import move
from systems.estimation.kernels.tip import largest_change


@compiled
def read(encoders, plan, exposure, lag, theta, then, now, twist, ahead, X_WE):
    """Encoders and plan at an exposure; there is a row of each at least.

    Args:
        encoders, plan: `Ring`.
        exposure: s, on the clock of both.
        lag: s, by which gears yield later than they are loaded.
        theta: positions of the motors in rad, (6,); then, now: rows of the plan, earlier by the lag and not;
            are written. Rows begin with positions of the motors.
        twist: of the tip, as it lies in ``now``, (6,).
        ahead: s, by which the exposure is later than its stamp.
        X_WE: the pose that was seen, (4, 4), is moved along by that.

    Returns:
        By how much a motor is off its plan at most, rad.
    """
    cubic_at(int(encoders.count[0]), encoders.times, encoders.rows, exposure, theta)
    number = int(plan.count[0])
    row_at(number, plan.times, plan.rows, exposure - lag, then)
    row_at(number, plan.times, plan.rows, exposure, now)
    step = np.empty(6)
    for i in range(6):
        step[i] = ahead * twist[i]
    move(X_WE, step)
    return largest_change(now, theta, 6)
