"""What data sheets say of the shipped robots, and what everything else needs of them."""

from pathlib import Path

import numpy as np
import pytest

from robots.description.error_parameters import NUM_PARAMETERS, error_parameters
from robots.description.model import load_robot, shipped_robots
from robots.description.robot_file import robot_text
from robots.dynamics.modes import ModalAnalysis, stretched
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.pose import wrap_angle

# Reach of the centre of the wrist from axis 1, distance from there to the flange, mass.
DATA_SHEETS = {
    "irb1200": (0.703, 0.082, 52.0),
    "irb140": (0.810, 0.065, 98.0),
    "kr16": (1.611, 0.158, 235.0),
    "kr210": (2.696, 0.215, 1068.0),
    "tx2_90": (float(np.hypot(0.900, 0.050)), 0.100, 114.0),  # the forearm is 50 mm beside the upper arm
}

NO_SPHERICAL_WRIST = ("ur10", "crx10ial", "crb15000")  # the analytic inverse does not know it


@pytest.mark.parametrize(("name", "numbers"), DATA_SHEETS.items(), ids=DATA_SHEETS)
def test_reach_and_mass_are_those_of_the_data_sheet(name: str, numbers: tuple[float, float, float]):
    reach, wrist_to_flange, mass = numbers
    robot = load_robot(name)
    robot.tool.translation = np.array([0.0, 0.0, -wrist_to_flange])
    center = Kinematics(robot).forward(stretched(robot))[:3, 3]
    assert np.hypot(*center[:2]) == pytest.approx(reach, abs=1e-3)  # m, digits of the data sheet
    assert robot.base_link.mass + sum(link.mass for link in robot.links) == pytest.approx(mass, rel=1e-3)


@pytest.mark.parametrize("name", [name for name in shipped_robots() if name not in NO_SPHERICAL_WRIST])
def test_inverse_kinematics_finds_the_way_back(name: str):
    robot = load_robot(name)
    kinematics, inverse = Kinematics(robot), InverseKinematics(robot)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (400, 6))
    s = np.linalg.svd(kinematics.jacobian(q))[1]
    q = q[(s[:, -1] > 0.02) & (np.abs(np.sin(q[:, 4])) > 0.05)]
    assert len(q) > 200
    X_WE = kinematics.forward(q)
    for one, X in zip(q, X_WE, strict=True):
        assert inverse.nearest(X, one) == pytest.approx(one, abs=1e-9)
    branches = inverse.all_branches(X_WE)
    nearest = np.nanmin(np.abs(wrap_angle(branches - q[:, None])).max(-1), axis=1)
    assert nearest.max() < 1e-9


@pytest.mark.parametrize(("name", "low", "high"), [("kr16", 10.0, 15.0), ("kr210", 5.0, 8.0)])
def test_the_lowest_modes_lie_where_such_robots_have_them(name: str, low: float, high: float):
    """Stretched, with the largest payload: one mode sideways, one up and down; the next are far off."""
    robot = load_robot(name)
    frequency = (
        ModalAnalysis(robot, "structure", robot.payload.largest_mass).at(stretched(robot)).frequency_hz
    )
    assert low < frequency[0] < frequency[1] < high
    assert frequency[2] > 2.0 * high


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_robots())
def test_a_robot_with_errors_is_a_robot_file_too(name: str, tmp_path: Path):
    """Elastic structure and counterbalance come along, although axis 2 leans out of its plane."""
    robot = load_robot(name)
    units = np.where([parameter.unit == "m" for parameter in error_parameters(robot)], 1e-3, 3e-3)
    p = units * np.random.default_rng(1).normal(size=NUM_PARAMETERS)
    true_robot = ErrorKinematics(robot).robot_with_errors(p)
    path = tmp_path / "robot.yaml"
    path.write_text(robot_text(true_robot))
    read = load_robot(str(path))
    assert robot_text(read) == robot_text(true_robot)
    payload, theta = robot.payload.largest_mass, stretched(robot)
    frequencies = [
        ModalAnalysis(one, "structure", payload).at(theta).frequency_hz[0] for one in (robot, read)
    ]
    assert frequencies[1] == pytest.approx(frequencies[0], rel=0.02)  # levers within a percent
