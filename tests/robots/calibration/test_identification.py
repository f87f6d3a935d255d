"""Identification: any robot comes back to rounding, whatever its frames; what cannot be seen is named.

The true robots are products of matrices that share no code with the model.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.calibration.identification import IdentificationConfig, IdentificationError, identify
from robots.calibration.identified import Identified
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.calibration.reduction import ReducibleModel
from robots.description.model import RobotModel, load_robot
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.kinematics.forward import Kinematics
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous
from tests.robots.urdfs import published

ROBOTS = ("irb1200", "irb140", "kr16", "puma560", "ur5", "ur10")
TOOLS = {"none": (0.0, 0.0), "on the axis": (0.1, 0.0), "beside the axis": (0.1, 0.06)}  # m: along, across


def file_of(name: str) -> str:
    """Of a robot: UR5 and UR10 as others publish them, the rest from our files."""
    return str(published(f"{name}_robot.urdf")) if name in ("ur5", "ur10") else name


def measured(robot: MatrixRobot, q: np.ndarray, position_only: bool = False) -> Measurements:
    X_WE = robot.forward(q)
    return Measurements(q, X_WE[:, :3, 3], None if position_only else X_WE[:, :3, :3])


def distances(result: Identified, true: MatrixRobot, fresh: np.ndarray) -> np.ndarray:
    """Between true and predicted positions in mm."""
    X_WE = Kinematics(result.calibrated_robot()).forward(fresh)
    return 1e3 * np.linalg.norm((X_WE - true.forward(fresh))[:, :3, 3], axis=1)


def calibrated(
    nominal: RobotModel, robot: MatrixRobot, rng: np.random.Generator, position_only: bool, X: np.ndarray
) -> tuple[float, Identified]:
    """Errors of 6 mm and 0.9 degrees, seen without noise from X: largest error in mm at fresh poses."""
    true = robot.displaced(rng).seen_from(X)
    result = identify(nominal, measured(true, robot.configurations(75, rng), position_only))
    return distances(result, true, robot.configurations(200, rng)).max(), result


@pytest.mark.parametrize("name", ROBOTS)
def test_poses_without_noise_give_any_robot_to_rounding(name: str):
    poses_come_back(name, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_poses_of_twenty_robots_each(name: str):
    for seed in range(20):
        poses_come_back(name, seed)


def poses_come_back(name: str, seed: int) -> None:
    file, rng = file_of(name), np.random.default_rng(seed)
    largest, result = calibrated(load_robot(file), MatrixRobot(file), rng, False, np.eye(4))
    assert largest <= 1e-10
    assert result.rank == 30  # four for each axis, six for base and tool
    assert result.iterations <= 14
    assert result.outliers == ()


@pytest.mark.parametrize("seed", [pytest.param(s, marks=[pytest.mark.slow] * (s > 1)) for s in range(10)])
def test_the_result_does_not_depend_on_how_frames_were_chosen(seed: int):
    rng = np.random.default_rng(seed)
    drawn = MatrixRobot("irb1200")
    other = drawn.reframed(rng)
    q = drawn.configurations(75, rng)
    np.testing.assert_allclose(other.forward(q), drawn.forward(q), atol=1e-14)
    robot = load_robot("irb1200")
    other.apply_to(robot)
    largest, result = calibrated(robot, other, rng, False, np.eye(4))
    assert largest <= 1e-10
    assert result.rank == 30


FAST = [("irb1200", "none", True), ("ur10", "on the axis", True), ("puma560", "beside the axis", False)]


@pytest.mark.parametrize(("name", "tool", "is_own_frame"), FAST)
def test_positions_alone_give_the_robot_with_any_tool_in_any_frame(name: str, tool: str, is_own_frame: bool):
    positions_come_back(name, tool, is_own_frame, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("is_own_frame", [False, True], ids=["known frame", "own frame"])
@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("name", ROBOTS)
def test_positions_of_twenty_robots_each(name: str, tool: str, is_own_frame: bool):
    for seed in range(20):
        positions_come_back(name, tool, is_own_frame, seed)


def positions_come_back(name: str, tool: str, is_own_frame: bool, seed: int) -> None:
    rng, robot = np.random.default_rng(seed), load_robot(file_of(name))
    drawn = MatrixRobot(file_of(name))
    axis, (along, across) = drawn.axes[5], TOOLS[tool]
    drawn = drawn.with_tool(along * axis + across * np.roll(axis, 1))
    drawn.apply_to(robot)
    X = homogeneous(Rotation.random(rng=rng), rng.uniform(-4.0, 4.0, 3)) if is_own_frame else np.eye(4)
    largest, result = calibrated(robot, drawn, rng, True, X)
    assert largest <= 1e-9
    assert result.rank == 27  # a point does not show the three turns of the tool
    assert (result.frame is not None) == is_own_frame


def test_scales_of_encoders_are_found_where_they_are_asked_for():
    rng, drawn, nominal = np.random.default_rng(0), MatrixRobot("ur10"), load_robot("ur10")
    true = drawn.displaced(rng)
    true.scales = 1.0 + rng.uniform(-1e-3, 1e-3, 6)
    q = drawn.configurations(75, rng)
    result = identify(nominal, measured(true, q), IdentificationConfig(joint_errors=("scale",)))
    fresh = drawn.configurations(200, rng)
    X_WE = result.model.forward(fresh, result.x)
    assert np.abs(X_WE - true.forward(fresh)).max() <= 1e-12
    assert result.rank == 36
    calibrated = controller_kinematics(result.calibrated_robot())
    assert np.abs(calibrated.forward(fresh) - true.forward(fresh)).max() <= 1e-12


def test_the_named_values_are_the_true_robot_and_as_exact_as_it():
    """The truth in the same independent parameters, found from its poses alone; nothing is of first order."""
    rng, drawn, nominal = np.random.default_rng(3), MatrixRobot("irb1200"), load_robot("irb1200")
    true = drawn.displaced(rng)
    result = identify(nominal, measured(true, drawn.configurations(75, rng)))
    truth = result.reducible.describe(true.forward, result.reduction.independent, np.zeros(54))
    np.testing.assert_allclose(result.values, truth, atol=1e-11)
    assert result.names[-6:] == tuple(f"zero_{number}" for number in range(1, 7))
    assert result.shares.min() > 0.99


def test_a_fixed_parameter_stays_zero():
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    table = measured(drawn.displaced(rng), drawn.configurations(75, rng))
    result = identify(load_robot("irb1200"), table, IdentificationConfig(fixed=("zero_2",)))
    assert "zero_2" not in result.names
    assert result.rank == 29
    assert result.x[result.model.names.index("zero_2")] == 0.0
    with pytest.raises(ValueError, match="no parameter is called zero_9; there are base_x"):
        identify(load_robot("irb1200"), table, IdentificationConfig(fixed=("zero_9",)))


def test_poor_sets_are_refused_by_the_names_of_what_they_hide():
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    true, nominal = drawn.displaced(rng), load_robot("irb1200")
    with pytest.raises(IdentificationError, match=r"4 measurements do not determine .*zero_1"):
        identify(nominal, measured(true, drawn.configurations(4, rng)))
    still = drawn.configurations(60, rng)
    still[:, 3] = 0.3
    with pytest.raises(IdentificationError, match=r"60 measurements do not determine .*zero_4"):
        identify(nominal, measured(true, still))


def test_what_does_not_converge_or_fit_is_refused():
    """Joint 3 turns the other way round: there is no geometry near the drawing that explains it."""
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    q = drawn.configurations(75, rng)
    table = measured(drawn.displaced(rng), q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    wrong = Measurements(q, table.position, table.rotation)
    with pytest.raises(IdentificationError, match=r"explains the measurements|has not converged"):
        identify(load_robot("irb1200"), wrong)


def test_a_calibrated_robot_is_not_calibrated_again():
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    table = measured(drawn.displaced(rng), drawn.configurations(40, rng))
    robot = identify(load_robot("irb1200"), table).calibrated_robot("irb1200")
    with pytest.raises(ValueError, match="start from the nominal robot, irb1200"):
        identify(robot, table)


def test_a_geometry_that_no_robot_has_is_refused_however_well_it_fits():
    """Metres that claim to be millimetres put all positions in one place, as a robot of no size does."""
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    table = measured(drawn, drawn.configurations(40, rng), position_only=True)
    with pytest.raises(IdentificationError, match=r"explains the measurements: joint3_z would be 350 mm off"):
        identify(load_robot("irb1200"), Measurements(table.q, 1e-3 * table.position, None))


def test_rows_in_two_frames_are_refused_in_words():
    """Nothing fits, so that not one direction shows: there is nothing to search gross errors in."""
    drawn, rng = MatrixRobot("ur10"), np.random.default_rng(0)
    q = drawn.configurations(80, rng)
    position, frame = drawn.forward(q)[:, :3, 3], homogeneous(Rotation.random(rng=rng), np.full(3, 2.0))
    position[40:] = position[40:] @ frame[:3, :3].T + frame[:3, 3]
    with pytest.raises(IdentificationError, match=r"half of the positions stay .* more than one frame\?"):
        identify(load_robot("ur10"), Measurements(q, position, None))


@pytest.mark.parametrize("count", [12, 30])
def test_quaternions_in_another_order_are_refused_in_words(count: int):
    """Positions fit, so that the orientations would look like noise of 80 degrees."""
    drawn, rng = MatrixRobot("irb1200"), np.random.default_rng(0)
    table = measured(drawn.displaced(rng), drawn.configurations(count, rng)).noisy(SOURCE_NOISE, rng)
    assert table.rotation is not None
    other = np.roll(Rotation.from_matrix(table.rotation).as_quat(), 1, axis=1)
    wrong = Measurements(table.q, table.position, Rotation.from_quat(other).as_matrix())
    with pytest.raises(IdentificationError, match="half of the orientations stay more than"):
        identify(load_robot("irb1200"), wrong)


def test_the_calibrated_robot_knows_its_parameters_and_their_covariance():
    """With these as the beginning of another calibration, no direction is free and none is known too well."""
    drawn, rng, nominal = MatrixRobot("irb1200"), np.random.default_rng(0), load_robot("irb1200")
    table = measured(drawn.displaced(rng), drawn.configurations(60, rng)).noisy(SOURCE_NOISE, rng)
    result = identify(nominal, table, IdentificationConfig(noise=SOURCE_NOISE))
    found = result.calibrated_robot("irb1200").calibration
    assert tuple(found.names) == result.model.names
    np.testing.assert_array_equal(found.values, result.x)
    covariance = found.covariance_matrix
    np.testing.assert_allclose(covariance, result.free_covariance, atol=1e-18)
    assert np.linalg.eigvalsh(covariance / np.outer(result.prior_sizes, result.prior_sizes)).min() > 1e-8
    reducible = ReducibleModel(result.model)
    T = reducible.reduce(result.x).combination
    np.testing.assert_allclose(T @ covariance @ T.T, result.covariance, rtol=1e-6, atol=1e-16)
