"""Identification: the truth comes back, what cannot be seen is named, what is wrong is found."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import root

from robots.calibration.identifiability import identifiable_parameters
from robots.calibration.identification import IdentificationConfig, IdentificationError, Identified, identify
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.calibration.validation import prediction_errors, statistics
from robots.description.error_parameters import NUM_PARAMETERS, error_parameters
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics, controller_kinematics
from robots.dynamics.plant import add_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error

ROBOT = load_robot("irb1200")
MODEL = ErrorKinematics(ROBOT)
UNITS = np.where([parameter.unit == "m" for parameter in error_parameters(ROBOT)], 6e-3, np.deg2rad(0.9))

OFFSETS_DEG = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
TABLE_6_1 = GeometricErrors(OFFSETS_DEG, np.full(3, 10.0), np.array([0.0, 0.0, 0.1])).vector(ROBOT)


def errors(seed: int) -> np.ndarray:
    """All 48 parameters, normal with 6 mm and 0.9 degrees."""
    return UNITS * np.random.default_rng(seed).normal(size=NUM_PARAMETERS)


def configurations(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.9 * ROBOT.lower, 0.9 * ROBOT.upper, (count, 6))


def measured(q: np.ndarray, p: np.ndarray) -> Measurements:
    """A rigid robot with errors p, seen without noise."""
    X_WE = MODEL.forward(q, p)
    return Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3])


def sagging(q: np.ndarray, p: np.ndarray, payload: float) -> Measurements:
    """The elastic plant at rest with its motors at q: springs against gravity, solved by Drake and scipy."""
    plant = MultibodyPlant(0.0)
    robot = add_robot(plant, ROBOT, "joints", payload, GeometricErrors.from_vector(ROBOT, p))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    motors = [joint.position_start() for joint in robot.motors]
    springs = [joint.position_start() for joint in robot.deflections]
    X_WE = []
    for theta in q:
        positions = np.zeros(plant.num_positions())
        positions[motors] = theta

        def imbalance(deflection: np.ndarray, positions: np.ndarray = positions) -> np.ndarray:
            positions[springs] = deflection
            plant.SetPositions(context, positions)
            force = plant.CalcGravityGeneralizedForces(context)[springs]
            return force / ROBOT.joint_stiffness - deflection

        solution = root(imbalance, np.zeros(6), tol=1e-13)
        imbalance(solution.x)
        X_WE.append(robot.tool.CalcPoseInWorld(context).GetAsMatrix4())
    X_WE = np.array(X_WE)
    return Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3], np.full(len(q), payload))


def validated(result: Identified, fresh: Measurements) -> np.ndarray:
    """Distances in mm between measured and predicted positions."""
    return 1e3 * np.linalg.norm(prediction_errors(result.calibrated_robot(), fresh)[:, -3:], axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_without_noise_the_base_parameters_come_back_to_rounding(seed: int):
    found = identifiable_parameters(ROBOT)
    p = found.reduce(errors(seed))
    result = identify(ROBOT, measured(configurations(75, seed), p))
    assert result.iterations <= 10
    assert np.abs(result.p - p).max() <= 1e-12
    assert result.outliers == ()


def test_thirty_parameters_explain_all_48_errors():
    p = errors(5)
    result = identify(ROBOT, measured(configurations(75, 0), p))
    assert len(result.names) == 30
    assert validated(result, measured(configurations(125, 1), p)).max() <= 1e-9


def test_errors_of_table_6_1_need_the_exact_model_and_not_one_linear_step():
    result = identify(ROBOT, measured(configurations(75, 2), TABLE_6_1))
    assert validated(result, measured(configurations(125, 3), TABLE_6_1)).max() <= 1e-9


def test_positions_alone_determine_25_parameters_and_predict_positions():
    """A tool on axis 6 does not show how that axis turns; off it, it does, and then 27 are to be had."""
    p = errors(6)
    p[[MODEL.parameters.index(each) for each in MODEL.parameters if each.name in ("pl_6Ex", "pl_6Ey")]] = 0.0
    result = identify(ROBOT, measured(configurations(75, 0), p).without_rotation())
    assert len(result.names) == 25
    fresh = measured(configurations(125, 1), p).without_rotation()
    assert validated(result, fresh).max() <= 1e-9


def test_deviations_are_as_large_as_the_covariance_says():
    """20 data sets of 30 parameters: the mean square of the normalised errors is one, give or take 0.06."""
    p = identifiable_parameters(ROBOT).reduce(errors(1))
    table, rng = measured(configurations(75, 4), p), np.random.default_rng(0)
    indices = identifiable_parameters(ROBOT).independent
    config = IdentificationConfig(noise=SOURCE_NOISE)
    squares = []
    for _ in range(20):
        result = identify(ROBOT, table.noisy(SOURCE_NOISE, rng), config)
        squares.append(np.mean(((result.values - p[indices]) / result.sigmas) ** 2))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)


def test_whitening_makes_a_better_model():
    p, rng = errors(2), np.random.default_rng(1)
    fresh = measured(configurations(125, 5), p)
    gaps = {}
    for is_whitened in (False, True):
        config = IdentificationConfig(noise=SOURCE_NOISE) if is_whitened else IdentificationConfig()
        gaps[is_whitened] = np.mean(
            [
                validated(
                    identify(ROBOT, measured(configurations(75, k), p).noisy(SOURCE_NOISE, rng), config),
                    fresh,
                )
                for k in range(5)
            ]
        )
    assert gaps[True] < gaps[False]


def test_a_fixed_parameter_stays_zero():
    result = identify(
        ROBOT, measured(configurations(75, 0), errors(3)), IdentificationConfig(fixed=("p_q2",))
    )
    assert "p_q2" not in result.names
    assert result.p[1] == 0.0
    with pytest.raises(ValueError, match="no parameter is called p_q9"):
        identify(ROBOT, measured(configurations(75, 0), errors(3)), IdentificationConfig(fixed=("p_q9",)))


def test_poor_sets_are_refused_by_the_names_of_what_they_hide():
    with pytest.raises(IdentificationError, match=r"4 measurements do not determine .*p_q1"):
        identify(ROBOT, measured(configurations(4, 0), errors(0)))
    still = configurations(60, 0)
    still[:, 3] = 0.3
    with pytest.raises(IdentificationError, match=r"do not determine .*p_q5"):
        identify(ROBOT, measured(still, errors(0)))


def test_a_false_pose_is_named_and_does_not_spoil_the_rest():
    p, rng = identifiable_parameters(ROBOT).reduce(errors(4)), np.random.default_rng(3)
    table = measured(configurations(75, 6), p).noisy(SOURCE_NOISE, rng)
    position = table.position.copy()
    position[11] += [1.0, 0.0, 0.0]
    position[40] += [0.0, 0.012, 0.0]  # twelve millimetres where two are usual
    config = IdentificationConfig(noise=SOURCE_NOISE)
    result = identify(ROBOT, replace(table, position=position), config)
    assert {12, 41} <= set(result.outliers)
    assert len(result.outliers) <= 4
    assert np.abs((result.values - p[identifiable_parameters(ROBOT).independent]) / result.sigmas).max() < 5.0
    kept = identify(ROBOT, replace(table, position=position), replace(config, leave_out_outliers=False))
    assert 12 in kept.outliers  # named all the same


def test_the_compliant_kinematics_are_the_statics_of_the_elastic_plant():
    """Rounding of the solver of the statics, 1e-13 rad over a metre."""
    compliant = replace(
        ROBOT, calibration=replace(ROBOT.calibration, compliance=(1.0 / ROBOT.joint_stiffness).tolist())
    )
    assert isinstance(controller_kinematics(ROBOT), Kinematics)
    for payload in (0.0, 7.0):
        table = sagging(configurations(20, 7), np.zeros(NUM_PARAMETERS), payload)
        X_WE = CompliantKinematics(compliant, payload).forward(table.q)
        np.testing.assert_allclose(X_WE, table.X_WE, atol=1e-10)
        rigid = Kinematics(ROBOT).forward(table.q)
        assert np.abs(rigid - table.X_WE)[:, :3, 3].max() > 5e-4  # there is something to explain


def test_the_compliant_jacobian_is_the_derivative_by_the_motors():
    """Central differences of 1e-5 are right to 1e-10; the compliance's second order is some 1e-6."""
    compliant = CompliantKinematics(
        replace(
            ROBOT, calibration=replace(ROBOT.calibration, compliance=(1.0 / ROBOT.joint_stiffness).tolist())
        ),
        7.0,
    )
    q, h = configurations(10, 11), 1e-5
    J = compliant.jacobian(q)
    for k, step in enumerate(h * np.eye(6)):
        difference = pose_error(compliant.forward(q + step), compliant.forward(q - step)) / (2.0 * h)
        np.testing.assert_allclose(J[..., k], difference, atol=2e-5)
    assert np.abs(J - Kinematics(ROBOT).jacobian(compliant.link_positions(q))).max() > 2e-4


def test_sag_is_left_by_the_geometry_and_explained_by_compliances():
    p = TABLE_6_1
    table = sagging(configurations(75, 8), p, 7.0).joined(sagging(configurations(75, 9), p, 0.0))
    fresh = sagging(configurations(60, 10), p, 7.0)
    geometry = identify(ROBOT, table)
    both = identify(ROBOT, table, IdentificationConfig(compliance=True))
    assert validated(geometry, fresh).mean() > 0.1
    assert validated(both, fresh).mean() <= 0.01
    stiffness = 1.0 / both.compliance[1:3]
    np.testing.assert_allclose(stiffness, ROBOT.joint_stiffness[1:3], rtol=0.03)
    assert "c_1" not in both.names  # its axis stands upright: gravity does not turn it


def test_statistics_of_known_errors():
    e = np.zeros((10, 6))
    e[:, 3], e[:, 0] = 1e-3 * np.arange(-5, 5), np.deg2rad(2.0)
    found = statistics(e).as_dict()
    assert found["mean_mm"] == pytest.approx([2.5, 0.0, 0.0])
    assert found["max_mm"] == pytest.approx([5.0, 0.0, 0.0])
    assert found["max_deg"] == pytest.approx([2.0, 0.0, 0.0])
    assert set(statistics(e[:, 3:]).as_dict()) >= {"mean_mm", "max_mm", "p90_mm"}
