"""Corrections over RSI bring the robot where it is wanted, whatever is lost, and never faster than it may."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.kinematics.forward import Kinematics
from systems.link.kuka.robot_link import RsiCodec, RsiCommand
from systems.link.kuka.telegrams import (
    RobotTelegram,
    SensorTelegram,
    read_robot,
    read_sensor,
    write_robot,
    write_sensor,
)
from tests.systems.link.kuka.rsi_loop import CYCLE, ROBOT, START, RsiLoop

MODES = ("relative", "absolute")


def sway(time: float) -> np.ndarray:
    """6 degrees of every axis, from rest."""
    return START + np.deg2rad(6.0) * (1.0 - np.cos(2.0 * time))


@pytest.mark.parametrize("mode", MODES)
def test_without_losses_the_robot_is_where_it_was_commanded_one_cycle_ago(mode):
    planned = RsiLoop(correction=mode).run(500, sway)
    wanted = np.array([sway(CYCLE * cycle) for cycle in range(500)])
    # Nine decimals of a degree are written; relative ones are summed, and repaired from the set-point.
    np.testing.assert_allclose(planned[1:], wanted[:-1], atol=2e-10)


class OtherController:
    """Set-points contain a correction ``behind`` replies later, or never for None; no time of its own."""

    def __init__(self, behind: int | None) -> None:
        self.behind, self.sums = behind, [np.zeros(6)]

    def run(self, client: RsiCodec, cycles: int) -> np.ndarray:
        """The steps that are asked for, (cycles, 6) in rad."""
        for cycle in range(cycles):
            seen = 0 if self.behind is None else max(0, cycle - self.behind)
            telegram = RobotTelegram(4 * cycle, START, START + self.sums[seen], np.zeros(6), 0)
            report = client.decode(write_robot(telegram))
            if not report.is_ready:
                break
            command = RsiCommand(sway(CYCLE * cycle), np.zeros(6))
            answer = read_sensor(client.encode(command, report, cycle, CYCLE * cycle))
            assert answer.axes is not None
            self.sums.append(self.sums[-1] + answer.axes)
        return np.diff(self.sums, axis=0)


@pytest.mark.parametrize("configured", [0, 1, 2])
@pytest.mark.parametrize("true", [0, 1, 2, 3])
def test_corrections_do_not_swing_whatever_set_points_contain(configured: int, true: int):
    """With one reply too many or too few taken for seen they would reach the speed of the axes to and fro."""
    client = RsiCodec(ROBOT.speed, CYCLE, True, "ImFree", configured)
    steps = OtherController(true).run(client, 400)
    assert client.behind == true
    wanted = np.diff([sway(CYCLE * cycle) for cycle in range(-1, 400)], axis=0)
    assert np.rad2deg(np.abs(steps - wanted).max()) < 0.02
    np.testing.assert_allclose(steps[100:], wanted[100:], atol=1e-8)


def test_set_points_without_the_corrections_end_a_run_before_they_add_up():
    """Each answer would correct by the whole way from the start once more."""
    client = RsiCodec(ROBOT.speed, CYCLE, True, "ImFree")
    steps = OtherController(None).run(client, 400)
    assert not client.is_followed
    assert np.rad2deg(np.abs(steps.sum(axis=0)).max()) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@given(lost=st.lists(st.integers(5, 180), max_size=60))
@settings(max_examples=15)
def test_lost_replies_are_made_up_for_within_the_speed_of_the_axes(mode, lost):
    loop = RsiLoop(correction=mode, late_limit=100)
    planned = loop.run(250, lambda time: sway(min(time, 0.8)), set(lost).__contains__)
    np.testing.assert_allclose(planned[-1], sway(0.8), atol=1e-9)
    steps = np.abs(np.diff(planned, axis=0)).max(axis=0)
    assert (steps <= ROBOT.speed * CYCLE + 1e-9).all()


@pytest.mark.parametrize("mode", MODES)
def test_a_client_that_begins_anew_takes_the_robot_over_where_it_is(mode):
    loop = RsiLoop(correction=mode)
    loop.run(200, sway)
    there = loop.planned
    loop.change_client()
    planned = loop.run(50, lambda time: there)
    np.testing.assert_allclose(planned, np.broadcast_to(there, planned.shape), atol=1e-9)


SAG = np.deg2rad([0.0, 0.4, -0.3, 0.05, -0.1, 0.0])


@pytest.mark.parametrize("mode", MODES)
def test_a_following_error_that_the_controller_keeps_is_no_step_when_commands_begin(mode):
    """They begin at the measured joints, which the arm's weight keeps off the set-point, and move on."""
    loop = RsiLoop(SAG, correction=mode)
    joints = loop.measured
    planned = loop.run(500, lambda time: joints + sway(time) - START)
    wanted = joints + np.array([sway(CYCLE * cycle) for cycle in range(500)]) - START
    steps = np.diff(planned, axis=0)
    assert (np.abs(np.diff(steps, axis=0)) <= 0.1 * ROBOT.acceleration * CYCLE**2).all()
    np.testing.assert_allclose(planned[300:], wanted[299:-1], atol=1e-8)  # after a second as ever


@pytest.mark.parametrize("mode", MODES)
def test_nor_is_it_when_rsi_begins_anew(mode):
    loop = RsiLoop(SAG, correction=mode, late_limit=5, restart_after=0.1)
    loop.run(200, lambda time: START)
    loop.run(60, lambda time: START, lambda cycle: cycle < 10)
    assert loop.controller.restarts == 1
    there = loop.measured
    loop.change_client()
    planned = loop.run(400, lambda time: there)
    steps = np.diff(planned, axis=0)
    assert (np.abs(np.diff(steps, axis=0)) <= 0.1 * ROBOT.acceleration * CYCLE**2).all()
    np.testing.assert_allclose(planned[-1], there, atol=1e-8)


def test_too_many_late_replies_in_a_row_end_rsi_and_the_robot_stands():
    loop = RsiLoop(late_limit=5, restart_after=-1.0)
    planned = loop.run(100, sway, lambda cycle: cycle >= 50)
    assert loop.controller.late == 5
    assert np.isnan(loop.controller.references[0]).all()
    assert np.ptp(planned[60:], axis=0).max() == 0.0


def test_a_correction_beyond_the_limit_ends_rsi():
    loop = RsiLoop(largest_correction_deg=3.0, restart_after=-1.0)
    planned = loop.run(400, sway)
    assert loop.controller.beyond == 1
    assert np.rad2deg(np.abs(planned - START)).max() <= 3.0


def test_a_late_reply_is_not_followed():
    controller = RsiLoop().controller
    controller.cycle(100.0, START)
    first = read_robot(controller.report(100.004, START, START, np.zeros(6)) or b"")
    controller.report(100.008, START, START, np.zeros(6))
    controller.report(100.012, START, START, np.zeros(6))
    controller.receive(write_sensor(SensorTelegram(first.ipoc, axes=np.full(6, 0.01))), 100.0, START)
    assert controller.counters()["ignored"] == 1


def test_a_cartesian_correction_moves_the_tool_by_itself_in_the_axes_of_the_base():
    controller = RsiLoop().controller
    controller.cycle(100.0, START)
    asked = read_robot(controller.report(100.004, START, START, np.zeros(6)) or b"")
    controller.report(100.008, START, START, np.zeros(6))
    shift = np.array([0.01, -0.02, 0.03, 0.0, 0.0, np.deg2rad(1.0)])
    controller.receive(write_sensor(SensorTelegram(asked.ipoc, pose=shift)), 100.0, START)
    X, X_start = (Kinematics(ROBOT).forward(q) for q in (controller.references[0], START))
    np.testing.assert_allclose(X[:3, 3] - X_start[:3, 3], shift[:3], atol=1e-9)
    turn = X[:3, :3] @ X_start[:3, :3].T
    assert np.rad2deg(np.arccos(0.5 * (np.trace(turn) - 1.0))) == pytest.approx(1.0, abs=1e-6)
