"""Instruments that see a robot whose joints yield and err: one adjustment finds all, gross errors or not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from experiments.calibration.instruments_report import sentence
from robots.calibration.error_model import ErrorModel
from robots.calibration.instruments.identify import (
    InstrumentCalibration,
    _start,
    identify_with_instruments,
)
from robots.calibration.instruments.observation_file import read_observations
from robots.calibration.instruments.observations import MeasuringCell, Observations
from robots.calibration.instruments.problem import InstrumentProblem
from robots.calibration.instruments.validation import validate_lines
from robots.description.model import RobotModel, load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.metrology.point_registration import register_points
from tests.robots.calibration.matrix_robot import MatrixRobot
from tests.robots.calibration.seen import LOAD, PLACES, observed

NOTHING = MeasuringCell({}, {}, {}, {})
ERRORS = {"scale_2": 4e-4, "coupling_56": -5e-4}
KINDS = ("scale", "coupling")
SOFTER = 1.3  # times the compliances of the robot file


def yielding(true: MatrixRobot) -> RobotModel:
    """The robot of matrices with springs, and with errors of its joints."""
    robot = load_robot("irb1200")
    true.apply_to(robot)
    found = replace(
        robot.calibration, compliance=(SOFTER / robot.joint_stiffness).tolist(), joint_errors=ERRORS
    )
    return replace(robot, calibration=found)


def loaded(true: MatrixRobot, theta: np.ndarray, mass: float) -> np.ndarray:
    return kinematics(true, mass).forward(theta)


@cache
def kinematics(true: MatrixRobot, mass: float) -> CompliantKinematics:
    return CompliantKinematics(yielding(true), mass)


@cache
def scene(noise: float) -> tuple[MatrixRobot, Observations]:
    return observed(count=90, noise=noise, seed=3, loaded=loaded)


def worst_error(found: InstrumentCalibration, true: MatrixRobot, mass: float) -> float:
    """Of all targets under a load at fresh configurations in m, wherever the world of the robot is."""
    q = true.configurations(60, np.random.default_rng(99))
    ours = CompliantKinematics(found.calibrated_robot("irb1200"), mass).forward(q)
    theirs = CompliantKinematics(yielding(true), mass).forward(q)
    p = [ours[:, :3, :3] @ place + ours[:, :3, 3] for place in found.setting.places]
    p_true = [theirs[:, :3, :3] @ place + theirs[:, :3, 3] for place in PLACES.values()]
    return float(np.abs(register_points(np.vstack(p), np.vstack(p_true)).residual).max())


@pytest.mark.slow
def test_derivatives_are_those_of_differences():
    seen = observed(count=15, loaded=loaded)[1]
    model = ErrorModel(load_robot("irb1200"), KINDS)
    problem = InstrumentProblem(model, seen, NOTHING, _start(model, seen, NOTHING), is_yielding=True)
    u = 0.1 * np.random.default_rng(3).normal(size=len(problem.columns))
    at = problem.linearise(u)
    assert {"c_2", "mass_payload", "centre_link_3_y", "scale_3", "anchor_bar_z"} <= set(problem.names)
    for k in range(len(u)):
        d = 1e-5 * np.eye(len(u))[k]
        slope = (problem.residuals(u - d) - problem.residuals(u + d)) / 2e-5
        # A joint that yields by a thousandth turns its own torque by as much: left out, and its square too.
        np.testing.assert_allclose(at.A[:, :, k], slope, atol=3e-6, err_msg=problem.names[problem.columns[k]])


@pytest.mark.slow
def test_without_noise_geometry_springs_and_joint_errors_are_found():
    """Three unknown targets, two loads, missing coordinates, two unknown frames and a ball bar in one go."""
    true, seen = scene(0.0)
    found = identify_with_instruments(load_robot("irb1200"), seen, None, KINDS, True)
    # What loads show is shared by compliances and masses, and a robot file has no errors of masses.
    assert worst_error(found, true, LOAD) < 1e-5  # m
    assert worst_error(found, true, 0.0) < 1e-5
    assert np.nanmax(np.abs(found.residuals)) < 1e-8
    stiff = identify_with_instruments(load_robot("irb1200"), seen, None, KINDS)
    assert worst_error(stiff, true, LOAD) > 5e-5


def rms(e: np.ndarray) -> float:
    """Of the lengths of lines (m, 3) with gaps."""
    return float(np.sqrt(np.nansum(e**2) / len(e)))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [3e-5, 3e-4])
def test_a_stiff_fit_says_how_far_its_lines_follow_the_weight(noise: float):
    """Only the other fit knows of springs; to this one they look like noise of the joints."""
    _, seen = scene(noise)
    stiff, soft = (
        identify_with_instruments(load_robot("irb1200"), seen, None, KINDS, is_yielding)
        for is_yielding in (False, True)
    )
    assert stiff.gravity is not None
    assert stiff.gravity.is_clear
    assert stiff.gravity.explained == pytest.approx(rms(stiff.residuals - soft.residuals), rel=0.02)
    assert soft.gravity is None
    assert f"{1e3 * stiff.gravity.explained:.2g} mm (rms) follow the weight" in sentence(stiff)
    assert "weight" not in sentence(soft)


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_a_stiff_robot_does_not_follow_the_weight(seed: int):
    _, seen = observed(noise=3e-5, joint=2e-5, seed=seed)
    found = identify_with_instruments(load_robot("irb1200"), seen)
    assert found.gravity is not None
    assert found.gravity.chance > 1e-3
    assert "weight" not in sentence(found)


@pytest.mark.slow
def test_gross_errors_of_a_loaded_robot_are_named_and_do_no_harm():
    true, seen = scene(3e-5)
    bad = np.flatnonzero(np.isfinite(seen.position).all(axis=1))[[5, 60, 61, 100, 130]]
    position = seen.position.copy()
    position[bad] += 0.02 * np.random.default_rng(0).choice([-1.0, 1.0], (5, 3))
    found = identify_with_instruments(
        load_robot("irb1200"), replace(seen, position=position), None, KINDS, True
    )
    assert found.outliers == tuple(seen.lines[bad])
    again = validate_lines(found, replace(seen, position=position))
    np.testing.assert_allclose(again.after, found.residuals, atol=1e-12)  # m, loads and joint errors included
    np.testing.assert_allclose(again.before, found.before, atol=1e-12)
    clean = identify_with_instruments(load_robot("irb1200"), seen, None, KINDS, True)
    assert worst_error(found, true, LOAD) < 1.5 * worst_error(clean, true, LOAD)
    np.testing.assert_allclose(
        found.compliance[1:3], SOFTER / load_robot("irb1200").joint_stiffness[1:3], rtol=0.1
    )


def test_a_load_is_read_for_every_configuration(tmp_path):
    head = ";".join([*(f"q{k}_deg" for k in range(1, 7)), "target", "x_mm", "y_mm", "z_mm", "payload_kg"])
    rows = [
        "1;2;3;4;5;6;a;1;2;3;0",
        "1;2;3;4;5;6;b;1;2;3;0",
        "1;2;3;4;5;6;a;1;2;4;7",
        "9;2;3;4;5;6;a;1;2;3;-1",
    ]
    (tmp_path / "m.csv").write_text("\n".join([head, *rows, ""]))
    seen, problems = read_observations(tmp_path / "m.csv")
    assert seen.loads.tolist() == [0.0, 7.0]
    assert seen.row.tolist() == [0, 0, 1]
    assert [(each.row, each.what) for each in problems] == [(5, "payload_kg must not be negative, got -1")]


@pytest.mark.slow
def test_a_load_that_the_robot_may_not_carry_is_refused():
    _, seen = observed(count=20, loaded=loaded)
    with pytest.raises(ValueError, match="must be between 0 and 7"):
        identify_with_instruments(
            load_robot("irb1200"), replace(seen, payload=np.full(20, 50.0)), compliance=True
        )
