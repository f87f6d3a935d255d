"""Hours of work: random paths that the robot can follow, and a record that is emptied on the way."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from experiments.bench.learning.hours import LAW, hours_scenario, keep, resting, resumed
from robots.description.model import load_robot
from robots.dynamics.newton_inverse import inverse_kinematics
from systems.reference.paths import make_path

QUARTER = 0.005  # h, five lines


def test_random_poses_are_reached_within_the_speeds_of_the_joints_and_clear_of_the_wrist_s_singularity():
    hours = 6.0 * QUARTER
    scenario = hours_scenario(hours, seed=3)
    robot, path = load_robot(scenario.robot), make_path(scenario.reference)
    times = np.arange(path.path_start, path.dwell_start, 0.02)
    q = inverse_kinematics(robot).along(path.sample(times)[0], np.deg2rad(scenario.home_deg))
    assert (np.abs(np.diff(q, axis=0)) < 0.02 * robot.speed).all()
    assert np.abs(q[:, 4]).min() > 0.25
    assert path.duration - path.path_start >= 3600.0 * hours


def test_a_seed_gives_one_path_and_another_seed_another():
    once, again, other = (
        make_path(hours_scenario(QUARTER, seed).reference).sample(np.array([9.0]))[0] for seed in (1, 1, 2)
    )
    assert np.array_equal(once, again)
    assert np.linalg.norm((once - other)[0, :3, 3]) > 1e-3


def test_a_tool_rests_once_it_has_stood_for_a_while():
    times = np.arange(0.0, 2.0, 0.08)
    X = np.tile(np.eye(4), (len(times), 1, 1))
    X[:, 0, 3] = np.minimum(times, 1.0)  # it last moves between 0.96 and 1.04 s
    np.testing.assert_array_equal(times[resting(X, times)], times[times > 1.25])


def test_what_is_kept_after_the_record_was_emptied_is_the_rest_of_the_record():
    scenario = load_scenario("misaligned", ["reference.settle=0"])
    whole, parted = Experiment(scenario, "open_loop"), Experiment(scenario, "open_loop")
    whole.advance(0.4)
    parted.advance(0.2)
    parted.forget()
    parted.advance(0.4)
    rest, full = parted.log(), whole.log()
    assert 0.2 <= rest.time[0] < 0.21
    assert np.array_equal(rest.X_WE_true, full.X_WE_true[-len(rest.time) :])


@pytest.mark.slow
def test_a_run_that_was_ended_goes_on_as_if_it_had_not_been(tmp_path):
    scenario = load_scenario("misaligned", ["reference.settle=0"])
    camera = replace(scenario.station.camera, orientation_sigma_deg=0.0, position_sigma=0.0)
    scenario = replace(scenario, station=replace(scenario.station, camera=camera))
    whole = Experiment(scenario, LAW)
    whole.advance(0.6)
    keep(whole, tmp_path / "state.npz")
    ended = resumed(scenario, tmp_path / "state.npz")
    for experiment in (whole, ended):
        experiment.forget()
        experiment.advance(0.8)
    rest, full = ended.log(), whole.log()
    np.testing.assert_array_equal(rest.time, full.time)
    np.testing.assert_allclose(rest.X_WE_true, full.X_WE_true, atol=1e-8)
    assert np.ptp(full.X_WE_true[:, :3, 3], axis=0).max() > 1e-3  # it moves
    other = replace(scenario, seed=scenario.seed + 1)
    with pytest.raises(ValueError, match="was kept with other hours, another seed"):
        resumed(other, tmp_path / "state.npz")
