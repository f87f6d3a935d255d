"""Whatever fails before the guard, no joint is commanded to move, or change its speed, faster than it may."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description.model import RobotModel, load_robot
from robots.kinematics.forward import Kinematics
from systems.guard.guard import GuardConfig
from tests.systems.rigs import PERIOD, GuardRig, assert_within_limits

ROBOT = load_robot("irb1200")
MIDDLE = 0.5 * (ROBOT.lower + ROBOT.upper)
NOTHING = np.full(6, np.nan)
FAULTS = (
    "none",
    "silent law",
    "half a command",
    "jump",
    "standing speed",
    "unknown joints",
    "blind",
    "beyond",
)

sequences = st.lists(
    st.tuples(st.sampled_from(FAULTS), st.integers(1, 25), st.floats(-2.0, 2.0)), min_size=2, max_size=7
)


class Swing:
    """A law that swings all joints, and fails as it is told."""

    def __init__(self, share: float, config: GuardConfig, robot: RobotModel = ROBOT, **options) -> None:
        self.rig = GuardRig(robot, config, MIDDLE, **options)
        self.rate, self.share = 4.0, share
        self.positions, self.velocities = [MIDDLE, MIDDLE], [np.zeros(6), np.zeros(6)]
        self.counts: dict[Any, int] = {}
        self.tick()

    def tick(self, fault: str = "none", size: float = 0.0) -> None:
        phase = self.rate * self.rig.time
        speed = self.share * ROBOT.speed
        position = MIDDLE + size + speed / self.rate * (1.0 - np.cos(phase))
        velocity, seen, correction = speed * np.sin(phase), np.inf, None
        if fault == "silent law":
            position = velocity = NOTHING
        elif fault == "half a command":
            velocity = np.array([0.0, np.inf, 0.0, 0.0, 0.0, 0.0])
        elif fault == "standing speed":
            velocity = np.zeros(6)
        elif fault == "blind":
            seen = -np.inf
        elif fault == "beyond":
            correction = np.array([0.0, 0.0, size, 0.0, 0.0, 10.0])
        self.rig.start = NOTHING if fault == "unknown joints" else MIDDLE
        issued, moving, self.counts = self.rig.tick(position, velocity, seen=seen, correction=correction)
        self.positions.append(issued)
        self.velocities.append(moving)

    def check(self) -> None:
        positions = np.array(self.positions)
        assert np.isfinite(positions).all()
        assert np.all((positions >= ROBOT.lower) & (positions <= ROBOT.upper))
        assert_within_limits(ROBOT, positions, np.array(self.velocities))


drawn = given(sequence=sequences, share=st.floats(0.02, 1.2), resume=st.booleans(), stops=st.booleans())


def check(sequence, share: float, resume: bool, stops: bool) -> None:
    config = GuardConfig(
        hold_after=0.02,
        stop_after=0.06,
        stop_time=0.05,
        resume=resume,
        resume_time=0.05,
        on_correction_limit="stop" if stops else "limit",
    )
    swing = Swing(share, config)
    for fault, ticks, size in sequence:
        for _ in range(ticks):
            swing.tick(fault, size if fault in ("jump", "beyond") else 0.0)
    swing.check()


@pytest.mark.slow
@settings(max_examples=40)
@drawn
def test_no_sequence_of_faults_moves_a_joint_beyond_its_limits(sequence, share, resume, stops):
    check(sequence, share, resume, stops)


@pytest.mark.slow
@settings(max_examples=250)
@drawn
def test_nor_does_one_of_many_sequences(sequence, share, resume, stops):
    check(sequence, share, resume, stops)


def test_a_law_that_comes_back_a_radian_off_after_100_ms_is_approached_smoothly():
    swing = Swing(0.3, GuardConfig())
    for fault, ticks, size in (("none", 99, 0.0), ("silent law", 25, 0.0), ("jump", 600, 1.0)):
        for _ in range(ticks):
            swing.tick(fault, size)
    swing.check()
    assert swing.counts["no_command"] == 25
    assert swing.counts["resumed"] * PERIOD >= GuardConfig().resume_time - 2 * PERIOD
    swing.rig.ticks -= 1  # what the law said last
    wanted = MIDDLE + 1.0 + 0.3 * ROBOT.speed / swing.rate * (1.0 - np.cos(swing.rate * swing.rig.time))
    np.testing.assert_allclose(swing.positions[-1], wanted, atol=1e-9)


def test_joints_that_are_not_known_are_held_and_then_stopped():
    swing = Swing(0.3, GuardConfig())
    for fault, ticks in (("none", 100), ("unknown joints", 200)):
        for _ in range(ticks):
            swing.tick(fault)
    swing.check()
    assert swing.counts["measurement_refused"] == 200
    assert swing.counts["stopped"] > 50
    np.testing.assert_array_equal(swing.velocities[-1], 0.0)
    np.testing.assert_array_equal(swing.positions[-1], swing.positions[-2])


def test_before_the_joints_are_known_nothing_is_commanded():
    rig = GuardRig(ROBOT, start=NOTHING)
    for position in (NOTHING, MIDDLE):
        issued, speed, _ = rig.tick(position)
        assert np.isnan(issued).all()
        np.testing.assert_array_equal(speed, 0.0)
    rig.start = MIDDLE
    np.testing.assert_array_equal(rig.tick(MIDDLE)[0], MIDDLE)


def test_a_law_that_corrects_too_much_is_limited_to_its_limit_and_a_step():
    """It wants the tip 0.3 m aside; the command is as if it had asked for 0.105 m."""
    rig = GuardRig(ROBOT, start=MIDDLE)
    kinematics, q = Kinematics(ROBOT), MIDDLE + np.array([0.0, 0.2, 0.3, 0.0, 0.4, 0.0])
    rig.start = q
    correction = np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    towards = np.linalg.solve(kinematics.jacobian(q), correction / 0.3)  # rad for a metre
    for _ in range(300):
        issued, _, counts = rig.tick(q + 0.02 * towards, correction=correction)
    wanted = q + 0.02 * towards
    too_far = np.linalg.solve(kinematics.jacobian(wanted), (1.0 - 0.105 / 0.3) * correction)
    np.testing.assert_allclose(issued, wanted - too_far, atol=1e-5)
    assert counts["correction_limit"] == 300
    assert counts["stopped"] == 0


def test_a_law_that_corrects_too_much_may_be_stopped_instead():
    rig = GuardRig(ROBOT, GuardConfig(on_correction_limit="stop"))
    for k in range(50):
        rig.tick(0.01 * PERIOD * k * ROBOT.speed, 0.01 * ROBOT.speed)
    for k in range(50, 200):
        _, speed, counts = rig.tick(
            0.01 * PERIOD * k * ROBOT.speed, 0.01 * ROBOT.speed, correction=np.array([0, 0, 0, 0, 0.3, 0.0])
        )
    assert counts["stopped"] == 150
    np.testing.assert_array_equal(speed, 0.0)


@pytest.mark.parametrize("limit", [0.5, 5.0])
def test_a_robot_file_may_say_the_acceleration(limit: float):
    robot = load_robot("irb1200")
    for joint in robot.joints:
        joint.limits.acceleration_deg_s2 = float(np.rad2deg(limit))
    rig = GuardRig(robot)
    found = [rig.tick(np.full(6, 0.2)) for _ in range(600)]
    steps = np.diff([np.zeros(6), *(row[0] for row in found)], axis=0)
    assert np.abs(np.diff(steps, axis=0)).max() == pytest.approx(limit * PERIOD**2)
    np.testing.assert_allclose(found[-1][0], 0.2)


def test_where_only_speeds_count_a_stop_is_one_of_positions_too():
    """What is logged as the command comes to rest with the speeds."""
    rig = GuardRig(ROBOT, GuardConfig(stop_time=0.1), start=MIDDLE, is_speed_only=True)
    for k in range(50):
        rig.tick(MIDDLE + 0.002 * k * PERIOD * ROBOT.speed, 0.002 * k * ROBOT.speed)
    found = [rig.tick(NOTHING, NOTHING) for _ in range(40)]
    np.testing.assert_array_equal(found[-1][1], 0.0)
    np.testing.assert_array_equal(found[-1][0], found[-10][0])
