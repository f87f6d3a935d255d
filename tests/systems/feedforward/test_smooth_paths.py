"""Smooth paths: torques do not depend on the tick, and what is too rough is refused."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig, JointReference
from systems.feedforward.prefilter import PrefilterConfig
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.timing import TIMINGS

POSE = np.deg2rad([0.0, -60.0, 90.0, 0.0, 0.0, 0.0])
DURATIONS = {"kr16": 0.24, "kr210": 0.3}  # s, of five degrees of axes 1 to 3
SMOOTH, ROUGH = (make_path(ReferenceConfig(timing=name)) for name in ("polynomial", "sine_squared"))


def torques(robot_name: str, kind: str, timing: str, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Times in s of the middles of the holds, and what the drives are told in N m, (n, 6)."""
    robot, profile = load_robot(robot_name), TIMINGS[timing].lasting(DURATIONS[robot_name], np.deg2rad(5.0))
    model = FEEDFORWARDS[kind](
        ControllerModel(robot, robot.payload.largest_mass, period), FeedforwardConfig(kind)
    )
    times = np.arange(0.0, profile.duration + 0.05, period)
    axes = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    memory, found = model.fresh_memory(), []
    for s, rate, acceleration in np.transpose(profile.at_times(times - 0.02)):
        answer = model.answer(JointReference(POSE + axes * s, axes * rate, axes * acceleration), memory)
        memory = answer.memory
        found.append(answer.torque)
    return times + 0.5 * period, np.array(found)


def change_with_the_tick(robot_name: str, kind: str, timing: str) -> float:
    """From 0.25 ms to 1 ms, as a share of a joint's range; the largest of all joints."""
    fine_times, fine = torques(robot_name, kind, timing, 0.25e-3)
    times, coarse = torques(robot_name, kind, timing, 1e-3)
    inside = times <= fine_times[-1]
    gap = np.abs(CubicSpline(fine_times, fine)(times[inside]) - coarse[inside])
    return float((gap.max(axis=0) / np.ptp(fine, axis=0)).max())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["flexible_joint", "elastic_structure"])
@pytest.mark.parametrize("robot_name", DURATIONS)
def test_on_a_smooth_path_torques_hardly_change_with_the_tick(robot_name: str, kind: str):
    assert change_with_the_tick(robot_name, kind, "polynomial") < 0.005


@pytest.mark.slow
def test_on_a_path_whose_fourth_derivative_jumps_they_do():
    """So that the law above could fail: the jumps are spread over a tick, the higher the shorter it is."""
    assert change_with_the_tick("kr16", "elastic_structure", "sine_squared") > 0.05


def test_each_model_refuses_a_path_with_fewer_continuous_derivatives_than_it_takes():
    for kind in FEEDFORWARDS:
        model = FEEDFORWARDS[kind](ControllerModel(load_robot("kr16")), FeedforwardConfig(kind))
        model.check_path(SMOOTH)
        if model.derivatives <= ROUGH.continuous_derivatives:
            model.check_path(ROUGH)
            continue
        message = rf"{kind} takes {model.derivatives} derivatives of its path, of which 3 are continuous"
        with pytest.raises(ValueError, match=message):
            model.check_path(ROUGH)


@pytest.mark.parametrize(
    "settings",
    [{"prefilter": PrefilterConfig("bessel")}, {"rough_path": "accept"}],
    ids=["prefilter", "accepted"],
)
def test_a_rough_path_is_prefiltered_or_accepted_where_the_scenario_says_so(settings: dict):
    config = FeedforwardConfig("elastic_structure", **settings)
    FEEDFORWARDS["elastic_structure"](ControllerModel(load_robot("kr16")), config).check_path(ROUGH)
