"""What encoders, plan and camera say of one instant."""

from systems.estimation.kernels.history import cubic_at, row_at
from systems.estimation.kernels.poses import compiled


@compiled
def read(encoders, plan, exposure, lag, theta, then, now):
    """Encoders and plan at an exposure; there is a row of each at least.

    Args:
        encoders, plan: `Ring`.
        exposure: s, on the clock of both.
        lag: s, by which gears yield later than they are loaded.
        theta: positions of the motors in rad, (6,); then, now: rows of the plan, earlier by the lag and not;
            are written.
    """
    cubic_at(int(encoders.count[0]), encoders.times, encoders.rows, exposure, theta)
    number = int(plan.count[0])
    row_at(number, plan.times, plan.rows, exposure - lag, then)
    row_at(number, plan.times, plan.rows, exposure, now)
