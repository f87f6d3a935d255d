"""Every delay of a scenario, measured in the finished diagram."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from systems.samples import PoseSample
from tests.diagrams.rigs import QUIET, scenario
from tests.systems.rigs import PERIOD

COMMAND_DELAYS = [0.004, 0.008, 0.010, 0.012, 0.140]  # s
START = ["reference.settle=0", "station.elasticity=rigid"]


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.010, 0.040])
def test_a_pose_arrives_a_camera_delay_after_its_exposure(delay: float):
    """The stamp says when the tip was there, and the sample is out at stamp + delay, not sooner or later."""
    experiment = Experiment(scenario("nominal", *QUIET, *START, f"station.camera.delay={delay}"), "open_loop")
    truth, seen, times = {}, [], np.arange(1, 101) * 1e-3
    for time in times:
        experiment.advance(time)
        tick = round(time / PERIOD)
        if abs(time - tick * PERIOD) < 1e-9:
            truth[tick] = experiment.station.read(experiment.context, "truth.X_WE").translation().copy()
        # What a reader just after this instant would find.
        experiment.simulator.AdvanceTo(time + 1e-5)
        seen.append(experiment.station.read(experiment.context, "pose_sample"))
    for time, sample in zip(times, seen, strict=True):
        assert isinstance(sample, PoseSample)
        expected = np.floor((time + 1e-5 - delay) / PERIOD) * PERIOD
        if sample.valid:
            assert sample.time == pytest.approx(expected, abs=1e-9)
            if sample.time > 0.0:
                exposed = truth[round(sample.time / PERIOD)]
                np.testing.assert_allclose(sample.X_WE.translation(), exposed, atol=1e-12)
    assert sum(sample.valid for sample in seen) == np.sum(times + 1e-5 >= delay)


def setpoints_and_commands(law: str, delay: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the axis that moves most, at ticks: the set-point a delay later, position and velocity command."""
    dead_time = max(0.0, delay - 0.004)
    config = scenario(
        "misaligned",
        *QUIET,
        "reference.settle=0",
        "station.elasticity=rigid",
        "reference.acceleration=3.0",
        f"station.drive.command_delay={delay - dead_time}",
        f"station.drive.dead_time={dead_time}",
    )
    experiment = Experiment(config, law)
    setpoint = experiment.station.setpoint
    context = setpoint.get_system().GetMyContextFromRoot(experiment.context)
    commands = ("position_command", "velocity_command")
    positions, issued = {}, {}
    for step in range(1, round((0.75 + delay) / 2e-3)):
        experiment.advance(step * 2e-3)
        positions[step] = setpoint.Eval(context)[:6]
        if step % 2 == 0:
            # Issued at the tick before: this tick's update is still to come.
            issued[step - 2] = [experiment.servo.read(experiment.context, name) for name in commands]
    steps = np.array(sorted(step for step in issued if 200 <= step <= 350))
    found = np.array([positions[step + round(delay / 2e-3)] for step in steps])
    p, v = np.array([issued[step] for step in steps]).swapaxes(0, 1)
    axis = np.argmax(np.ptp(p, axis=0))
    return found[:, axis], p[:, axis], v[:, axis]


@pytest.mark.parametrize("delay", COMMAND_DELAYS)
def test_a_position_command_is_reached_its_delay_and_dead_time_after_its_issue(delay: float):
    """As time: the error of the set-point over the speed of the command, while the path speeds up.

    The interpolation may be wrong by some jerk times period cubed, 1e-6 rad here, at 0.5 rad/s and more.
    """
    found, p, v = setpoints_and_commands("open_loop", delay)
    assert np.abs(v).min() > 0.5
    late = (p - found) / v
    assert np.abs(late).max() < 2e-6  # s


@pytest.mark.slow
@pytest.mark.parametrize("delay", COMMAND_DELAYS)
def test_a_velocity_command_acts_its_delay_and_dead_time_after_its_issue(delay: float):
    """The set-point moves by the integral of the velocity commands, shifted by the delay."""
    found, _, v = setpoints_and_commands("pbvs", delay)
    moved = np.concatenate([[0.0], np.cumsum(0.5 * PERIOD * (v[1:] + v[:-1]))])
    late = (moved[-1] - (found[-1] - found[0])) / (v[-1] - v[0])
    assert abs(late) < 50e-6  # s
