"""Gears that stiffen under load: springs side by side, in a robot file, at rest and in the modes."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.multibody.plant import MultibodyPlant

from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.drivetrain.stiffening import Stiffening
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, LimitedSpring, SpringRow
from robots.dynamics.modes import ModalAnalysis
from robots.dynamics.plant import add_robot

BENT = np.deg2rad([20.0, -40.0, 60.0, 40.0, 60.0, -25.0])
CUBIC, LIMITED = CubicSpring(2e4, 2e4), LimitedSpring(2e4, 2e4, 6e4, 1e-3)
SPRINGS = (CUBIC, LIMITED, CubicSpring(3e4, 0.0), ExponentialSpring(2e4, 6e4, 300.0), LIMITED, CUBIC)
ROW = SpringRow(SPRINGS)
deflections = arrays(float, (3, 6), elements=st.floats(-0.05, 0.05))


def stiffening_robot(stiffening: Stiffening) -> RobotModel:
    """An IRB 1200 whose gear 3 stiffens."""
    robot = load_robot("irb1200")
    robot.joints[2].drive_train.stiffening = stiffening
    return robot


@pytest.mark.slow
@given(deflections, st.floats(0.5, 2.0))
def test_a_row_is_its_springs_side_by_side(x: np.ndarray, factor: float):
    for i, spring in enumerate(SPRINGS):
        np.testing.assert_allclose(ROW.torque(x)[:, i], spring.torque(x[:, i]), rtol=1e-14)
        np.testing.assert_allclose(ROW.stiffness(x)[:, i], spring.stiffness(x[:, i]), rtol=1e-14)
        np.testing.assert_allclose(ROW.energy(x)[:, i], spring.energy(x[:, i]), rtol=1e-14)
    np.testing.assert_allclose(ROW.deflection(ROW.torque(x)), x, rtol=1e-12, atol=1e-16)
    scaled = ROW.scaled(factor)
    # The limit's arctan of some hundreds loses two digits.
    np.testing.assert_allclose(scaled.torque(x), factor * ROW.torque(x), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(scaled.stiffness(x), factor * ROW.stiffness(x), rtol=1e-12)


def test_without_stiffening_the_gears_are_linear_and_need_no_row():
    assert load_robot("irb1200").stiffening_gears is None
    row = stiffening_robot(Stiffening("cubic_spring", gamma=100.0)).stiffening_gears
    assert row is not None
    np.testing.assert_allclose(row.torque(np.full(6, 0.01)), np.array([250, 450, 454.5, 450, 450, 450]))


def test_a_robot_file_tells_how_its_gears_stiffen(tmp_path: Path):
    robot = stiffening_robot(Stiffening("limited_spring", gamma=2e5, c_max=9e4, sharpness=1e-3))
    (tmp_path / "robot.yaml").write_text(robot_text(robot))
    read = load_robot(str(tmp_path / "robot.yaml")).stiffening_gears
    assert read is not None
    assert read.springs[2] == LimitedSpring(45000.0, 2e5, 9e4, 1e-3)
    assert read.springs[1] == CubicSpring(45000.0, 0.0)


def test_at_rest_the_stiffened_gear_carries_its_load_and_swings_with_its_tangent():
    robot = stiffening_robot(Stiffening("cubic_spring", gamma=2e6))
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "joints", 7.0)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    parts.set_at_rest(context, BENT)
    rows = [joint.position_start() for joint in parts.deflections]
    deflection, load = plant.GetPositions(context)[rows], parts.load(context)[rows]
    spring = CubicSpring(45000.0, 2e6)
    assert spring.torque(deflection[2]) == pytest.approx(load[2], rel=1e-9)
    # A linear gear with the stiffness of the tangent, at the same deformed rest, has the same modes.
    linear = load_robot("irb1200")
    linear.joints[2].drive_train.stiffness = float(spring.stiffness(deflection[2]))
    found, expected, soft = (
        ModalAnalysis(each, "joints", 7.0).at(BENT) for each in (robot, linear, load_robot("irb1200"))
    )
    # The rest differs by a tenth of a millirad, and with it the inertia.
    np.testing.assert_allclose(found.frequency_hz, expected.frequency_hz, rtol=1e-3)
    assert (found.frequency_hz - soft.frequency_hz).max() > 0.01 * soft.frequency_hz.max()


@pytest.mark.parametrize(
    ("stiffening", "message"),
    [
        (Stiffening("rubber"), "stiffening: kind must be one of cubic_spring, .* got 'rubber'"),
        (Stiffening("cubic_spring", gamma=1.0, c_max=2.0), "cubic_spring has no parameter 'c_max'"),
        (Stiffening("limited_spring", gamma=1.0, sharpness=1.0), "limited_spring: .*missing .*'c_max'"),
        (Stiffening("limited_spring", gamma=1.0, c_max=1e4, sharpness=1.0), "c_max must be above c_0"),
        (Stiffening("exponential_spring", c_max=1e5), "exponential_spring: .*missing .*'gamma'"),
    ],
)
def test_an_impossible_gear_is_refused_in_one_line(tmp_path: Path, stiffening: Stiffening, message: str):
    path = tmp_path / "robot.yaml"
    path.write_text(robot_text(stiffening_robot(stiffening)))
    with pytest.raises(RobotFileError, match=rf"robot.yaml, line \d+: joint 3: .*{message}") as refused:
        load_robot(str(path))
    assert "\n" not in str(refused.value)
