"""Joints that yield: gravity by hand against Drake, sag explained, masses that nobody has weighed."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from robots.calibration.error_model import ErrorModel
from robots.calibration.identification import IdentificationConfig, IdentificationError, identify
from robots.calibration.identified import Identified
from robots.calibration.loads import NUM_MASSES, Loads
from robots.calibration.measurements import SOURCE_NOISE, Measurements
from robots.calibration.validation import prediction_errors, statistics
from robots.description.error_parameters import NUM_PARAMETERS
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotModel, load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics, controller_kinematics
from robots.dynamics.plant import add_robot
from robots.kinematics.forward import Kinematics
from robots.pose import pose_error

ROBOT = load_robot("irb1200")
OFFSETS_DEG = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
TABLE_6_1 = GeometricErrors(OFFSETS_DEG, np.full(3, 10.0), np.array([0.0, 0.0, 0.1])).vector(ROBOT)
BOTH = IdentificationConfig(compliance=True)


def configurations(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.9 * ROBOT.lower, 0.9 * ROBOT.upper, (count, 6))


def sagging(q: np.ndarray, p: np.ndarray, payload: float, true: RobotModel = ROBOT) -> Measurements:
    """The elastic plant at rest with its motors at q: springs against gravity, solved by Drake and scipy."""
    plant = MultibodyPlant(0.0)
    robot = add_robot(plant, true, "joints", payload, GeometricErrors.from_vector(true, p))
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
            return force / true.joint_stiffness - deflection

        solution = root(imbalance, np.zeros(6), tol=1e-13)
        imbalance(solution.x)
        X_WE.append(robot.tool.CalcPoseInWorld(context).GetAsMatrix4())
    X_WE = np.array(X_WE)
    return Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3], np.full(len(q), payload))


def validated(result: Identified, fresh: Measurements) -> np.ndarray:
    """Distances in mm between measured and predicted positions."""
    return 1e3 * np.linalg.norm(prediction_errors(result.calibrated_robot(), fresh)[:, -3:], axis=1)


@pytest.mark.parametrize("name", ["irb1200", "kr210", "ur10"])
def test_gravity_turns_the_joints_as_in_the_plant(name: str):
    """Sums of levers against Drake, with loads and with a counterbalance; rounding of kilonewton metres."""
    robot = load_robot(name)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (20, 6))
    model = ErrorModel(robot)
    for payload in (0.0, robot.payload.largest_mass):
        loads = Loads(robot, np.full(len(q), payload))
        torque, _ = loads.torque(q, model.chain(q, np.zeros(54)), np.zeros(NUM_MASSES))
        np.testing.assert_allclose(torque, CompliantKinematics(robot, payload).gravity_torque(q), atol=1e-8)


def test_the_derivative_by_the_masses_is_exact():
    """The torque is linear in the masses and, for given masses, in their centres."""
    q, rng = configurations(5, 0), np.random.default_rng(1)
    chain, loads = ErrorModel(ROBOT).chain(q, np.zeros(54)), Loads(ROBOT, np.full(5, 7.0))
    at = np.r_[0.1 * rng.normal(size=7), 0.02 * rng.normal(size=21)]
    torque, by_masses = loads.torque(q, chain, at)
    for column, step in enumerate(0.1 * np.eye(NUM_MASSES)):
        moved = loads.torque(q, chain, at + step)[0]
        np.testing.assert_allclose((moved - torque) / 0.1, by_masses[..., column], atol=1e-10)


def test_the_derivative_of_the_torque_by_the_geometry_is_exact():
    """Central differences of 1e-5 leave 1e-8 of a torque of a hundred newton metres."""
    model, q, rng = ErrorModel(ROBOT), configurations(5, 0), np.random.default_rng(1)
    loads, masses, h = Loads(ROBOT, np.full(5, 7.0)), np.zeros(NUM_MASSES), 1e-5
    x = 0.01 * rng.normal(size=54)
    chain, Theta = model.chain_and_regressor(q, x)
    found = loads.by_geometry(chain, Theta, masses)
    for column, step in enumerate(h * np.eye(54)):
        up, down = (loads.torque(q, model.chain(q, x + sign * step), masses)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(found[..., column], (up - down) / (2.0 * h), atol=2e-6)


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


@pytest.mark.slow
def test_sag_is_left_by_the_geometry_and_explained_by_compliances():
    p = TABLE_6_1
    table = sagging(configurations(75, 8), p, 7.0).joined(sagging(configurations(75, 9), p, 0.0))
    fresh = sagging(configurations(60, 10), p, 7.0)
    geometry = identify(ROBOT, table)
    both = identify(ROBOT, table, BOTH)
    assert validated(geometry, fresh).mean() > 0.1
    assert validated(both, fresh).mean() <= 0.01
    stiffness = 1.0 / both.compliance[1:3]
    np.testing.assert_allclose(stiffness, ROBOT.joint_stiffness[1:3], rtol=0.03)
    assert "c_1" not in both.names  # its axis stands upright: gravity does not turn it


def test_compliances_are_refused_in_the_frame_of_an_instrument_that_is_not_upright():
    """There gravity does not act along z; turned about the vertical and shifted it does."""
    table = Measurements(configurations(75, 8), *poses_seen(Rotation.from_euler("ZY", [1.0, 0.5])))
    with pytest.raises(IdentificationError, match="z axis of the instrument is 29 degrees off the vertical"):
        identify(ROBOT, table, BOTH)
    level = Measurements(configurations(75, 8), *poses_seen(Rotation.from_euler("Z", [1.0])))
    assert identify(ROBOT, level, BOTH).frame is not None


def poses_seen(turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Of the nominal robot, from a place 3 m away that is turned."""
    X = Kinematics(ROBOT).forward(configurations(75, 8))
    R = np.asarray(turn.as_matrix()).reshape(3, 3)
    return X[:, :3, 3] @ R.T + [3.0, 0.0, 0.5], R @ X[:, :3, :3]


def test_statistics_of_known_errors():
    e = np.zeros((10, 6))
    e[:, 3], e[:, 0] = 1e-3 * np.arange(-5, 5), np.deg2rad(2.0)
    found = statistics(e).as_dict()
    assert found["mean_mm"] == pytest.approx([2.5, 0.0, 0.0])
    assert found["max_mm"] == pytest.approx([5.0, 0.0, 0.0])
    assert found["max_deg"] == pytest.approx([2.0, 0.0, 0.0])
    assert set(statistics(e[:, 3:]).as_dict()) >= {"mean_mm", "max_mm", "p90_mm"}


def true_machine(rng: np.random.Generator) -> RobotModel:
    """Masses 5 % and centres 10 mm away from the drawing, all at once."""
    links = [
        replace(
            link,
            mass=link.mass * (1.0 + 0.05 * rng.normal()),
            center_of_mass=link.center_of_mass + 0.01 * rng.normal(size=3),
        )
        for link in ROBOT.links
    ]
    centre = ROBOT.payload.center_of_mass + 0.01 * rng.normal(size=3)
    return replace(ROBOT, links=links, payload=replace(ROBOT.payload, center_of_mass=centre))


@pytest.mark.slow
@pytest.mark.parametrize("machines", [2, 6])
def test_intervals_of_compliances_contain_the_masses_that_nobody_has_weighed(machines: int):
    """What is wrong is as large as stated, and would be many times that without the masses."""
    ratios, blind = [], []
    for seed in range(machines):
        rng = np.random.default_rng(seed)
        true = true_machine(rng)
        table = sagging(configurations(40, seed), TABLE_6_1, 7.0, true)
        table = table.joined(sagging(configurations(40, 50 + seed), TABLE_6_1, 0.0, true))
        table = table.noisy(
            replace(SOURCE_NOISE, joint_sigma=1e-5, position_sigma=2e-5, rotation_sigma=2e-5), rng
        )
        for found, config in (
            (ratios, BOTH),
            (blind, replace(BOTH, mass=1e-6, centre_of_mass=1e-7)),
        ):
            result = identify(ROBOT, table, config)
            truth = 1.0 / ROBOT.joint_stiffness
            error = result.compliance - truth
            names = [name for name in result.names if name.startswith("c_")]
            sigmas = dict(zip(result.names, result.sigmas, strict=True))
            found += [error[int(name[2]) - 1] / sigmas[name] for name in names]
    assert np.sqrt(np.mean(np.square(ratios))) < 1.5
    assert np.sqrt(np.mean(np.square(blind))) > 2.0
