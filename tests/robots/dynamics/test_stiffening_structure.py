"""Bearings and beams that stiffen: statics, modes, other factors, and what a robot file may say."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from robots.description.drive_parts import Cubic, Exponential
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.description.variation import Factors, varied
from robots.dynamics.modes import ModalAnalysis
from robots.dynamics.plant import PlantRobot, add_robot

BENT = np.deg2rad([20.0, -40.0, 60.0, 40.0, 60.0, -25.0])  # away from every symmetry


def build(robot: RobotModel) -> tuple[PlantRobot, Context]:
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "structure", 210.0)
    plant.Finalize()
    return parts, plant.CreateDefaultContext()


def stiffening(name: str = "kr210", gamma: float = 1e6) -> RobotModel:
    """Bearings and beams that stiffen by a tenth and more under the weight of the arm."""
    robot = load_robot(name)
    for joint in robot.joints:
        assert joint.tilting is not None
        joint.tilting.stiffening_a = Cubic(gamma)
        joint.tilting.stiffening_b = Exponential(4.0 * joint.tilting.stiffness[1], 200.0)
    beam = robot.links[1].beam
    assert beam is not None
    beam.stiffening_x = beam.stiffening_y = beam.stiffening_z = Cubic(gamma)
    return robot


def test_a_structure_that_stiffens_carries_its_load_and_swings_with_its_tangents():
    robot = stiffening()
    parts, context = build(robot)
    parts.set_at_rest(context, BENT)
    sprung = [joint.position_start() for joint in parts.sprung]
    deflection, load = parts.plant.GetPositions(context)[sprung], parts.load(context)[sprung]
    linear = parts.sprung_stiffness * deflection
    np.testing.assert_allclose(linear + parts.stiffening_torque(deflection), load, rtol=1e-6, atol=1e-3)
    assert np.abs(linear - load)[6:].max() > 0.1 * np.abs(load)[6:].max()
    # With linear springs of the tangents' stiffness it swings alike; the rest differs by some 0.1 mrad.
    # A beam has no stiffness of its own for each hinge, so that here it stays linear.
    beam = robot.links[1].beam
    assert beam is not None
    beam.stiffening_x = beam.stiffening_y = beam.stiffening_z = None
    parts, context = build(robot)
    parts.set_at_rest(context, BENT)
    deflection = parts.plant.GetPositions(context)[sprung]
    names = [joint.name() for joint in parts.sprung]
    springs = dict(zip(names, parts.tangent_stiffness(deflection), strict=True))
    tangent, soft = load_robot("kr210"), load_robot("kr210")
    for i, joint in enumerate(tangent.joints, 1):
        assert joint.tilting is not None
        joint.tilting.stiffness = [float(springs[f"tilt_{side}_{i}"]) for side in "ab"]
    found, expected, before = (
        ModalAnalysis(each, "structure", 210.0).at(BENT).frequency_hz[:3] for each in (robot, tangent, soft)
    )
    assert np.abs(found / before - 1.0).max() > 0.02
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_varied_structure_takes_as_much_more_torque_at_every_deflection():
    factors = Factors(bearings=np.full((6, 2), 1.7), beams=np.full((6, 3), 0.6))
    before, after = (
        build(robot)[0].stiffening_structure for robot in (stiffening(), varied(stiffening(), factors))
    )
    assert before is not None
    assert after is not None
    x = np.full(17, 2e-3)
    names = [joint.name() for joint in build(stiffening())[0].structure]
    share = [1.7 if name.startswith("tilt") else 0.6 for name in names]
    np.testing.assert_allclose(after.torque(x), share * before.torque(x), rtol=1e-12)


def kr210_with(tmp_path: Path, bearing: str = "{}", beam: str = "{}") -> str:
    """A KR 210 whose first bearing and whose arm stiffen as said."""
    unchanged = "\n- {}"
    (tmp_path / "robot.yaml").write_text(
        f"extends: kr210\njoints:\n- tilting: {bearing}{5 * unchanged}\n"
        f"links:\n- {{}}\n- beam: {beam}{4 * unchanged}\n"
    )
    return str(tmp_path / "robot.yaml")


def test_a_robot_file_names_how_bearings_and_beams_stiffen(tmp_path: Path):
    beam = "{stiffening_y: !Cubic {gamma: 2.0e5}}"
    robot = load_robot(kr210_with(tmp_path, "{stiffening_a: !Cubic {gamma: 5.0e5}}", beam))
    (tmp_path / "again.yaml").write_text(robot_text(robot))
    parts, _ = build(load_robot(str(tmp_path / "again.yaml")))
    springs = parts.stiffening_structure
    assert springs is not None
    share = springs.torque(np.full(len(parts.structure), 1e-3)) / (springs.c_0 * 1e-3)
    names = [joint.name() for joint in parts.structure]
    found = {name: float(value) for name, value in zip(names, share, strict=True) if value > 1.001}
    assert found == pytest.approx({"tilt_a_1": 1.5, "beam_2_y1": 1.2, "beam_2_y2": 1.2})


@pytest.mark.parametrize(
    ("bearing", "beam", "message"),
    [
        ("{stiffening_b: !Cubic {gamma: -1.0}}", "{}", "tilting: CubicSpring: gamma must not be negative"),
        (
            "{stiffening_a: !Rubber {}}",
            "{}",
            "joints[0].tilting.stiffening_a must be one of cubic, exponential",
        ),
        (
            "{stiffening_a: !Limited {c_max: 1.0, gamma: 1.0, sharpness: 1.0}}",
            "{}",
            "c_max must be above c_0",
        ),
        (
            "{}",
            "{stiffening_y: !Exponential {gamma: 1.0}}",
            "link 2: ExponentialSpring: c_max must be at least",
        ),
    ],
)
def test_an_impossible_stiffening_is_refused_in_one_line(
    tmp_path: Path, bearing: str, beam: str, message: str
):
    with pytest.raises(RobotFileError, match=r"robot.yaml, line \d+: ") as refused:
        load_robot(kr210_with(tmp_path, bearing, beam))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
