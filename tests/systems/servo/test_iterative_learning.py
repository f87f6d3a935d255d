"""What is learnt of a lap is used at the same place of the next one, whatever its length and speed."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from robots.description.model import RobotModel, load_robot
from robots.pose import pose_error
from systems.samples import PoseSample
from tests.systems.rigs import PERIOD, LawRig, pose
from tests.systems.servo.test_laws import HOME, ROBOT, joints_at

START = 0.5  # s, of the path
SIZE = 0.03  # m, of a circle that turns the tool to and fro


def longer() -> RobotModel:
    """A robot whose upper arm is longer by a tenth: the error is another one all along the circle."""
    robot = load_robot("irb1200")
    robot.joints[2].placement.translation = 1.1 * robot.joints[2].placement.translation
    return robot


class Laps:
    """Circles, from and to any speed, of which a stretch of the station's time may be run at half of it."""

    def __init__(self, lap: float, slow: tuple[float, float] = (math.inf, math.inf)) -> None:
        self.lap, self.slow = lap, slow

    def path_time(self, t: float) -> float:
        return t - 0.5 * (min(max(t, self.slow[0]), self.slow[1]) - self.slow[0] if t > self.slow[0] else 0.0)

    def __call__(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        rate = 0.5 if self.slow[0] <= t < self.slow[1] else 1.0
        since, w = self.path_time(t) - START, 2.0 * np.pi / self.lap
        X, V = HOME.copy(), np.zeros(6)
        if since > 0.0:
            X[:3, 3] += SIZE * np.array([0.0, np.cos(w * since) - 1.0, np.sin(w * since)])
            V[4:] = SIZE * w * rate * np.array([-np.sin(w * since), np.cos(w * since)])
        return X, V


def errors(laps: Laps, count: int, every: int = 1) -> np.ndarray:
    """The distance of the tip in m at the ticks of the last but one of so many laps.

    Without the first ticks of the lap, before which nothing may have been learnt; the camera sees the tool at
    one tick of ``every``.
    """
    rig = LawRig("iterative_learning", ROBOT, laps, joints_at(HOME), longer(), preview=PERIOD)
    wanted = rig.law.GetInputPort("reference").Eval(rig.context)
    object.__setattr__(wanted, "path_time", laps.path_time)
    starts = START + laps.lap * np.arange(count)
    path = SimpleNamespace(path_start=START, lap_starts=starts, dwell_start=starts[-1] + laps.lap)
    rig.law.check_path(path)  # pyright: ignore[reportArgumentType]
    sample = PoseSample()
    while laps.path_time(rig.ticks * PERIOD) < path.dwell_start:
        if rig.ticks and (rig.ticks - 1) % every == 0:
            sample = PoseSample((rig.ticks - 1) * PERIOD, pose(rig.tips[-1]), True)
        rig.tick(sample)
    times = PERIOD * np.arange(rig.ticks)
    off = pose_error(np.array([laps(t)[0] for t in times]), np.array(rig.tips))
    then = np.array([laps.path_time(t) for t in times])
    return np.linalg.norm(off[:, 3:], axis=1)[(then >= starts[-2]) & (then < starts[-1])][6:]


def test_a_lap_need_not_last_a_whole_number_of_ticks():
    """Rounded, each lap of 25.45 ticks would be learnt for places half a tick off."""
    whole, not_whole = errors(Laps(25.0 * PERIOD), 9), errors(Laps(25.45 * PERIOD), 9)
    assert not_whole.mean() < 1.06 * whole.mean()


@pytest.mark.slow
@pytest.mark.parametrize("slow", [(0.7, 1.1), (0.6, 0.7)])
def test_a_path_that_is_slowed_is_learnt_by_its_own_time(slow: tuple[float, float]):
    """In the first lap; the rest of the path comes later by half as long."""
    planned, slowed = errors(Laps(0.4), 3), errors(Laps(0.4, slow), 3)
    assert slowed.max() < 1.05 * planned.max()


def test_a_camera_that_sees_an_eighth_of_it_shows_the_whole_lap():
    all_of_it, seldom = errors(Laps(0.4), 3), errors(Laps(0.4), 3, every=8)
    assert seldom.max() < 2.0 * all_of_it.max()
