"""A robot written and read again is the same robot, as YAML to the last digit and as URDF in its motions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from robots.calibration.identification import identify
from robots.calibration.measurements import Measurements
from robots.description.calibration import is_same_robot
from robots.description.error_parameters import NUM_PARAMETERS, error_parameters
from robots.description.model import RobotModel, load_robot
from robots.description.robot_file import robot_text
from robots.description.urdf import urdf_text
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics

COMPLIANCE = [0.0, 1.0 / 45000.0, 1.0 / 3.0e4, 0.0, 0.0, 0.0]
NOMINAL = load_robot("irb1200")


def calibrated() -> RobotModel:
    units = np.where([parameter.unit == "m" for parameter in error_parameters(NOMINAL)], 6e-3, 0.015)
    p = units * np.random.default_rng(0).normal(size=NUM_PARAMETERS)
    q = configurations(60)
    X_WE = ErrorKinematics(NOMINAL).forward(q, p)
    robot = identify(NOMINAL, Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3])).calibrated_robot("irb1200")
    return replace(robot, calibration=replace(robot.calibration, compliance=COMPLIANCE))


def configurations(count: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(NOMINAL.lower, NOMINAL.upper, (count, 6))


def test_a_calibrated_robot_file_gives_the_same_kinematics(tmp_path: Path):
    robot = calibrated()
    (tmp_path / "robot.yaml").write_text(robot_text(robot))
    read = load_robot(str(tmp_path / "robot.yaml"))
    q = configurations(100)
    np.testing.assert_array_equal(Kinematics(read).forward(q), Kinematics(robot).forward(q))
    assert read.calibration == robot.calibration
    assert len(read.calibration.names) == 54
    assert robot_text(read) == robot_text(robot)


@pytest.mark.parametrize("said", ["nominal.yaml", "arms/nominal.yaml"], ids=["beside", "of an older version"])
def test_the_robot_that_was_calibrated_is_found_from_anywhere_and_moves_with_its_file(
    said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A file of an older version names it from where its calibration ran."""
    monkeypatch.chdir(tmp_path)
    arms, written = tmp_path / "arms", Path("arms/robot.yaml")
    arms.mkdir()
    (arms / "nominal.yaml").write_text("extends: irb1200\n")
    written.write_text(f"extends: irb1200\ncalibration: {{of: {said}, source: a table}}\n")
    robot = load_robot(str(written))
    assert is_same_robot(robot.calibration.of, "arms/../arms/nominal.yaml")
    assert not is_same_robot(robot.calibration.of, "irb1200")
    written.write_text(robot_text(robot, beside=written))
    assert "  of: nominal.yaml\n" in written.read_text()
    arms.rename(tmp_path / "moved")
    monkeypatch.chdir(tmp_path / "moved")
    assert load_robot("robot.yaml").calibration.of == str(tmp_path / "moved/nominal.yaml")
    for away in (None, tmp_path / "away/robot.yaml"):
        text = robot_text(load_robot("robot.yaml"), beside=away)
        assert f"  of: {'../moved' if away else tmp_path / 'moved'}/nominal.yaml\n" in text


def test_drake_reads_the_urdf_and_agrees():
    """Rounding of the products of seven transforms, and of angles there and back."""
    robot = calibrated()
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(urdf_text(robot), "urdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    tool = plant.GetFrameByName("tool")
    for q in configurations(50):
        plant.SetPositions(context, q)
        X_WE = tool.CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(X_WE, Kinematics(robot).forward(q), atol=1e-12)
    np.testing.assert_allclose(plant.GetPositionUpperLimits(), robot.upper)
    masses = [link.mass for link in robot.links]
    bodies = [plant.GetBodyByName(f"link_{number}") for number in range(1, 7)]
    np.testing.assert_allclose([body.get_mass(context) for body in bodies], masses)
