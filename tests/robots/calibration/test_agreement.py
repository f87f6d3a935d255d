"""Independent implementations identify the same robot from the same data.

One is MINPACK's Levenberg-Marquardt on a product of matrices, with derivatives by differences; the other is
figaroh on pinocchio, and where it is not installed (``pip install -e ".[agreement]"``) its test is skipped.
"""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.measurements import SOURCE_NOISE, MeasurementNoise, Measurements
from robots.description.error_parameters import NUM_PARAMETERS
from robots.description.model import Placement, load_robot
from robots.description.urdf import urdf_text
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous

# Noise so small that the prior weighs nothing, the same for all rows: then we make plain least squares too.
PLAIN = IdentificationConfig(noise=MeasurementNoise(0.0, 1e-9, 1e-9), leave_out_outliers=False)


@pytest.mark.slow
def test_an_unreduced_search_on_54_parameters_finds_the_same_robot():
    """Noisy positions have one minimum, however redundant the parameters; differences find it."""
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    drawn = drawn.with_tool(np.array([0.03, -0.05, 0.21]))
    robot = load_robot("irb1200")
    drawn.apply_to(robot)
    q = drawn.configurations(60, rng)
    X_WE = drawn.displaced(rng).forward(q)
    table = Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3]).noisy(SOURCE_NOISE, rng).without_rotation()
    ours = identify(robot, table, PLAIN)

    def moved(x: np.ndarray) -> MatrixRobot:
        other = drawn.seen_from(np.eye(4))
        moves = homogeneous(Rotation.from_rotvec(x[24:48].reshape(8, 3)), x[:24].reshape(8, 3))
        other.placements = other.placements @ moves
        zeros = homogeneous(Rotation.from_rotvec(x[48:, None] * other.axes), np.zeros((6, 3)))
        other.placements[1:7] = other.placements[1:7] @ zeros
        return other

    def residuals(x: np.ndarray) -> np.ndarray:
        return (moved(x).forward(table.q)[:, :3, 3] - table.position).ravel()

    theirs = least_squares(residuals, np.zeros(54), method="lm", jac="3-point", xtol=1e-15, ftol=1e-15)
    assert theirs.success
    fresh = drawn.configurations(100, rng)
    position = Kinematics(ours.calibrated_robot()).forward(fresh)[:, :3, 3]
    # m; derivatives by differences leave about a nanometre, give or take by the library that solves
    assert np.abs(moved(theirs.x).forward(fresh)[:, :3, 3] - position).max() < 1e-8
    assert np.abs(drawn.forward(fresh)[:, :3, 3] - position).max() > 1e-3  # there was an error to find


def test_predictions_of_both_agree_on_noisy_positions():
    """Least squares of positions have one minimum, however the parameters are chosen.

    figaroh moves the six placements and the marker, 39 numbers, by finite differences. Ours stops where
    a step would gain 1e-12 of the cost, a millionth of the residuals, which are 1.4 mm (rms).
    """
    tools = pytest.importorskip("figaroh.calibration.calibration_tools", reason="figaroh is not installed")
    pinocchio = pytest.importorskip("pinocchio", reason="pinocchio is not installed")
    robot = load_robot("irb1200")
    robot.tool = Placement(np.array([0.03, -0.05, 0.21]), np.array([-75.0, 40.0, 12.0]))
    rng = np.random.default_rng(0)
    q = rng.uniform(0.9 * robot.lower, 0.9 * robot.upper, (60, 6))
    X_WE = ErrorKinematics(robot).forward(q, 5e-3 * rng.normal(size=NUM_PARAMETERS))
    table = Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3]).noisy(SOURCE_NOISE, rng).without_rotation()
    ours = identify(robot, table, PLAIN)

    model = pinocchio.buildModelFromXML(urdf_text(robot))
    data = model.createData()
    joints = [f"joint_{number}" for number in range(1, 7)]
    names = [f"{axis}_{joint}" for joint in joints for axis in tools.FULL_PARAMTPL]
    names += [f"{axis}_1" for axis in tools.EE_TPL[:3]]
    config = {
        "calib_model": "full_params",
        "param_name": names,
        "start_frame": "universe",
        "end_frame": "tool",
        "non_geom": False,
        "actJoint_idx": [model.getJointId(joint) for joint in joints],
        "measurability": [True, True, True, False, False, False],
        "calibration_index": 3,
        "NbMarkers": 1,
    }

    def predicted(x: np.ndarray, q: np.ndarray) -> np.ndarray:
        flat = tools.calc_updated_fkm(model, data, x, q, {**config, "NbSample": len(q)})
        return flat.reshape(3, len(q)).T

    def residuals(x: np.ndarray) -> np.ndarray:
        return (predicted(x, table.q) - table.position).ravel()

    theirs = least_squares(
        residuals, np.zeros(len(names)), method="trf", jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14
    )
    fresh = rng.uniform(robot.lower, robot.upper, (100, 6))
    position = Kinematics(ours.calibrated_robot()).forward(fresh)[:, :3, 3]
    assert np.abs(predicted(theirs.x, fresh) - position).max() < 3e-9  # m
    assert np.sum(ours.residuals**2) == pytest.approx(2.0 * theirs.cost, rel=1e-12)
    assert (
        np.abs(predicted(np.zeros(len(names)), fresh) - position).max() > 1e-3
    )  # there was an error to find
