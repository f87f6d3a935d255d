"""A path near the end of the arm: refused once a shorter robot is known well enough, and not before."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from robots.kinematics.forward import Kinematics
from robots.pose import pose_error, zyx_from_rotation
from systems.estimation import kernels
from systems.estimation.probing.path_needs import SCALE, PathNeeds
from systems.estimation.probing.path_reach import PathReach
from systems.reference.cartesian_path import OutOfReachError
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Points, Waypoint
from tests.systems.estimation.arms import CAMERA, tip_model

MODEL = tip_model()
START = np.deg2rad([0.0, 40.0, 0.0, 0.0, 50.0, 0.0])
SURE, UNKNOWN = 1e-6 * np.eye(MODEL.size), np.eye(MODEL.size)
TICKS = range(40)  # after which each instant has been looked at


def outwards(length: float) -> tuple[PathNeeds, PathReach]:
    """Of a straight line away from the robot, so many m."""
    X = Kinematics(MODEL.robot).forward(START)
    angles = np.rad2deg(zyx_from_rotation(X[:3, :3]))
    ends = [X[:3, 3], X[:3, 3] + [length, 0.0, 0.0]]
    path = make_path(ReferenceConfig(path=Points([Waypoint(1e3 * p, angles) for p in ends])))
    needs = PathNeeds(MODEL, 1.0 / CAMERA**2, path, START, 0.5)
    return needs, PathReach(needs, path)


@pytest.fixture(scope="module")
def line() -> tuple[PathNeeds, PathReach]:
    """Up to about 5 mm before the nominal arm is stretched."""
    inside, outside = 0.0, 0.5
    while outside - inside > 1e-3:
        middle = 0.5 * (inside + outside)
        try:
            outwards(middle)
            inside = middle
        except ValueError:
            outside = middle
    return outwards(inside - 0.005)


def shorter(needs: PathNeeds, by: float) -> np.ndarray:
    """The unknowns of a robot whose tip is so many m nearer to its base at the end of the line."""
    end = needs.times.argmax()
    along = needs.H[end, 3, MODEL.G] * MODEL.sigma[MODEL.G]
    x = MODEL.mean.copy()
    x[MODEL.G] -= by * along / (needs.H[end, 3, MODEL.G] @ needs.H[end, 3, MODEL.G])
    return x


@pytest.mark.parametrize("beyond", [0.0, 0.02, 0.1])
def test_what_is_missing_is_what_a_general_solver_finds(line, beyond: float):
    needs, _ = line
    c, x = MODEL.constants(MODEL.mean), MODEL.mean
    q = needs.q[needs.times.argmax()]
    X_WE = MODEL.forward(c, x, q[None])[0][0]
    X_WE[0, 3] += beyond

    def apart(joints: np.ndarray) -> np.ndarray:
        return SCALE * pose_error(X_WE, MODEL.forward(c, x, joints[None])[0][0])

    found = least_squares(apart, q, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    expected = float(np.linalg.norm(found.fun))
    # It has few steps, and of what is missing nobody wants more than two digits.
    assert kernels.plan.missing(c, x, X_WE, q.copy()) == pytest.approx(expected, rel=0.01, abs=1e-5)


def look(reach: PathReach, x: np.ndarray, covariance: np.ndarray) -> None:
    for tick in TICKS:
        reach.look(MODEL.constants(x), x, lambda: covariance, tick)


def test_a_robot_that_is_known_to_be_too_short_is_refused_with_what_is_missing(line):
    needs, reach = line
    with pytest.raises(OutOfReachError, match=r"does not reach its path: \d+ mm are missing \d\.\d s after"):
        look(reach, shorter(needs, 0.03), SURE)


def test_the_nominal_robot_goes_on_and_so_does_one_of_which_little_is_known(line):
    needs, reach = line
    look(reach, MODEL.mean, SURE)
    look(reach, shorter(needs, 0.03), UNKNOWN)
