"""Laws on a path that the robot does not reach: as near as the arm gets, never thrown about, and back."""

from collections.abc import Callable

import numpy as np
import pytest

from robots.description.model import RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics, UnreachableError
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error
from tests.systems.rigs import PERIOD, LawRig
from tests.systems.servo.test_laws import HOME, ROBOT, joints_at

LASTS = 8.0  # s, from near the robot to far from it and back
FAST = 0.5 * ROBOT.speed.min()  # rad/s
Path = Callable[[float], tuple[np.ndarray, np.ndarray]]


def reach() -> float:
    """How far out the tool can be in m, in the orientation of HOME at its height."""
    near, far = HOME[0, 3], 1.2
    while far - near > 1e-9:
        X = HOME.copy()
        X[0, 3] = 0.5 * (near + far)
        try:
            InverseKinematics(ROBOT).nearest(X, joints_at(HOME))
            near = X[0, 3]
        except UnreachableError:
            far = X[0, 3]
    return near


def outward(beyond: float) -> Path:
    """From HOME straight out to where the nominal arm is stretched, and by so many m beyond, and back."""
    way = reach() + beyond - HOME[0, 3]

    def path(time: float) -> tuple[np.ndarray, np.ndarray]:
        phase = np.pi * min(time, LASTS) / LASTS
        X, V = HOME.copy(), np.zeros(6)
        X[0, 3] += way * np.sin(phase) ** 2
        V[3] = way * np.pi / LASTS * np.sin(2.0 * phase)
        return X, V

    return path


def shorter(by: float) -> RobotModel:
    """A robot whose tool ends so many m nearer to its base."""
    robot = load_robot("irb1200")
    R_WE = Kinematics(robot).forward(joints_at(HOME))[:3, :3]
    R_FE = robot.tool.pose().rotation().matrix()
    robot.tool.translation = robot.tool.translation - R_FE @ R_WE.T @ [by, 0.0, 0.0]
    return robot


def driven(rig: LawRig, path: Path) -> tuple[np.ndarray, np.ndarray, int]:
    """Errors at all ticks in m, the fastest joint from 1 s on in rad/s, and how many ticks had no command."""
    joints, silent = [rig.q], 0
    for _ in range(round((LASTS + 2.0) / PERIOD)):
        silent += int(np.isnan(rig.tick()).any())
        joints.append(rig.q)
    wanted = np.array([path(PERIOD * k)[0] for k in range(len(rig.tips))])
    off = np.linalg.norm(pose_error(wanted, np.array(rig.tips))[:, 3:], axis=1)
    return off, np.abs(np.diff(joints, axis=0)[250:]).max() / PERIOD, silent


@pytest.mark.slow
@pytest.mark.parametrize("law", ["numerical_ik", "pbvs"])
@pytest.mark.parametrize("delay", [1, 36])
def test_where_only_the_true_robot_is_too_short_the_tip_is_off_by_what_is_missing(law: str, delay: int):
    """The nominal arm reaches the path with 5 mm to spare, the true one misses it by 25 mm."""
    path = outward(-0.005)
    rig = LawRig(law, ROBOT, path, joints_at(HOME), true=shorter(0.03), delay=delay, preview=PERIOD)
    off, fastest, silent = driven(rig, path)
    assert off[250:].max() == pytest.approx(0.025, abs=2e-3)
    assert fastest < FAST
    assert not silent
    assert off[-1] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("law", ["numerical_ik", "pbvs"])
@pytest.mark.parametrize("beyond", [0.02, 0.1])
def test_beyond_the_reach_of_the_nominal_robot_there_is_no_command_until_the_path_is_back(
    law: str, beyond: float
):
    path = outward(beyond)
    rig = LawRig(law, ROBOT, path, joints_at(HOME), delay=1, preview=PERIOD)
    off, fastest, silent = driven(rig, path)
    assert silent > 100
    assert off.max() < beyond + 2e-3
    assert fastest < 2.0 * FAST
    assert off[-1] < 1e-4
    assert (np.abs(rig.q - joints_at(HOME)) < 0.01).all()  # bent as it was
