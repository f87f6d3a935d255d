"""Where a run starts."""

from contextlib import suppress

import numpy as np

from diagrams.scenario.scenario import Scenario, ScenarioError
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.newton_inverse import InverseSolver, inverse_kinematics
from robots.kinematics.analytic_inverse import UnreachableError
from systems.controller_model import ControllerModel
from systems.reference.paths import CartesianPath
from systems.servo.law import LARGEST_STEP

_STEP = 4e-3  # s, between the poses at which a path is tried before it is run
_SAME = 1e-6  # rad, between joints at the ends of a lap that winds none of them up


def start_position(model: ControllerModel, scenario: Scenario, path: CartesianPath) -> np.ndarray:
    """Motor positions in rad at which the robot, as the controller knows it, is off by the initial error.

    The whole path is tried first, so that an unreachable one is refused before anything moves.

    Raises:
        ScenarioError: if the start or the path is out of reach.
    """
    inverse = inverse_kinematics(model.robot, model.payload)
    home = np.deg2rad(scenario.home_deg)
    try:
        q_path = _followed_in_full(inverse, path, home, model.robot)
        X_WE = path.sample(0.0)[0].copy()
        # The error is wanted minus true.
        X_WE[:3, 3] -= 1e-3 * scenario.initial_error_mm
        return inverse.nearest(X_WE, q_path[0])
    except ValueError as error:
        raise ScenarioError(
            f"{model.robot.name} cannot follow the path '{scenario.reference.path.kind}': {error}"
        ) from error


def _followed_in_full(
    inverse: InverseSolver, path: CartesianPath, home: np.ndarray, robot: RobotModel
) -> np.ndarray:
    """`_followed`; where joint 6 ends up at its limit, from a start at which it is a turn away from that."""
    try:
        return _followed(inverse, path, home)
    except UnreachableError:
        raise
    except ValueError:
        for turn in (2.0 * np.pi, -2.0 * np.pi):
            start = home + turn * (np.arange(NUM_JOINTS) == NUM_JOINTS - 1)
            with suppress(ValueError):
                if robot.upper[-1] - robot.lower[-1] > abs(turn):
                    return _followed(inverse, path, start)
        raise


def _followed(inverse: InverseSolver, path: CartesianPath, home: np.ndarray) -> np.ndarray:
    """Joint positions in rad along a path, (n, 6), from the branch nearest to ``home``.

    Of laps only the first one is followed if the joints end it where they began it: the others repeat it.

    Raises:
        ValueError: if the path is out of reach.
    """
    if len(path.lap_starts) > 1:
        begin = np.arange(0.0, path.path_start, _STEP)
        times = np.concatenate([begin, np.arange(path.path_start, path.lap_end, _STEP), [path.lap_end]])
        q = _along(inverse, path, times, home)
        if np.abs(q[-1] - q[len(begin)]).max() < _SAME:
            return q
    return _along(inverse, path, np.arange(0.0, path.duration, _STEP), home)


def _along(inverse: InverseSolver, path: CartesianPath, times: np.ndarray, home: np.ndarray) -> np.ndarray:
    q = inverse.along(path.sample(times)[0], home)
    jumps = np.flatnonzero(np.linalg.norm(np.diff(q, axis=0), axis=1) > LARGEST_STEP)
    if len(jumps):
        k = int(jumps[0])
        turns = np.abs(q[k + 1] - q[k])
        raise ValueError(
            f"after {times[k]:.2f} s joint {turns.argmax() + 1} would turn by "
            f"{np.rad2deg(turns.max()):.0f} deg at once: from this start the path goes on only on another "
            "branch of the arm; home_deg is where the start is looked for"
        )
    return q
