"""Slow motions of a robot with another load, spring and friction: all are found, sticking is left out."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from robots.description.drive_parts import Sigmoid, Stribeck
from robots.description.model import RobotModel, load_robot
from robots.dynamics.plant import add_robot
from robots.identification.friction_fit import fit_frictions
from robots.identification.slow_motion import SlowMotion, identify_slow_motion, moving_samples

PERIOD = 0.02  # s
TRUE_LOAD, BELIEVED_LOAD = 150.0, 200.0  # kg
CENTRE = np.array([0.02, -0.01, 0.27])  # m
STIFFNESS, PRELOAD = 1.1e5, 1.1e4  # N/m, N, of the counterbalance
NOISE = 8.0  # N m, of the torques
FRICTIONS = [
    Stribeck(224.6, 374.4, 200.0, 86.4, 0.02),
    Stribeck(243.8, 390.0, 200.0, 90.0, 0.02),
    Stribeck(187.2, 312.0, 200.0, 72.0, 0.02),
    Sigmoid(78.0, 130.0, 200.0),
    Sigmoid(94.4, 143.0, 200.0),
    Sigmoid(38.2, 91.0, 200.0),
]


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot("kr210")


@pytest.fixture(scope="module")
def motion(robot: RobotModel) -> SlowMotion:
    return slow_motion(robot)


def slow_motion(robot: RobotModel, load: float = TRUE_LOAD) -> SlowMotion:
    """Sines of different periods, and a rest in which the motors hold any torque."""
    t = PERIOD * np.arange(1500)
    middle = np.deg2rad([0.0, -70.0, 30.0, 20.0, 40.0, 0.0])
    size = np.deg2rad([40.0, 40.0, 45.0, 60.0, 60.0, 60.0])
    speed = 2.0 * np.pi / np.array([11.0, 9.0, 7.0, 6.1, 5.3, 4.7])
    theta = middle + size * np.sin(speed * t[:, None])
    rate, acceleration = size * speed * np.cos(speed * t[:, None]), -(speed**2) * (theta - middle)
    spring = robot.counterbalance
    assert spring is not None
    true = replace(
        robot,
        payload=replace(robot.payload, center_of_mass=CENTRE),
        counterbalance=replace(spring, stiffness=STIFFNESS, preload=PRELOAD),
    )
    torque = needed(true, theta, rate, acceleration, load)
    torque += np.stack([f.part().torque(v) for f, v in zip(FRICTIONS, rate.T, strict=True)], axis=1)
    torque += NOISE * np.random.default_rng(4).normal(size=torque.shape)
    resting = slice(700, 760)
    theta[resting], rate[resting], acceleration[resting] = theta[700], 0.0, 0.0
    torque[resting] += 5000.0
    return SlowMotion(PERIOD, theta, rate, acceleration, torque)


def needed(
    robot: RobotModel, theta: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, load: float = TRUE_LOAD
) -> np.ndarray:
    """Torques of the rigid robot without friction, with its rotors."""
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "rigid", load)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    found = np.empty_like(theta)
    for row, (q, v, a) in enumerate(zip(theta, rate, acceleration, strict=True)):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        M = plant.CalcMassMatrix(context)
        found[row] = M @ a + plant.CalcBiasTerm(context) - parts.load(context)
    return found


@pytest.mark.slow
def test_payload_and_counterbalance_are_found_to_a_hundredth(robot: RobotModel, motion: SlowMotion):
    found = identify_slow_motion(robot, BELIEVED_LOAD, motion)
    assert found.payload == pytest.approx(TRUE_LOAD, rel=0.01)
    np.testing.assert_allclose(found.payload_centre, CENTRE, atol=0.004)
    assert found.spring_stiffness == pytest.approx(STIFFNESS, rel=0.01)
    assert found.spring_preload == pytest.approx(PRELOAD, rel=0.01)
    assert abs(found.payload - TRUE_LOAD) < 4.0 * found.sigma[0]
    assert not found.moving[700:760].any()


@pytest.mark.slow
def test_a_flange_without_load_is_one_though_noise_may_make_its_mass_negative(robot: RobotModel):
    found = identify_slow_motion(robot, BELIEVED_LOAD, slow_motion(robot, 0.0))
    assert found.payload == 0.0
    np.testing.assert_array_equal(found.payload_centre, robot.payload.center_of_mass)
    assert 0.0 < found.sigma[0] < 2.0


def test_a_load_that_the_robot_cannot_carry_is_refused(robot: RobotModel, motion: SlowMotion):
    weaker = replace(robot, payload=replace(robot.payload, largest_mass=100.0))
    with pytest.raises(
        ValueError, match=r"asks for a payload of 1[45]\d\.\d kg; KUKA .* carries up to 100 kg"
    ):
        identify_slow_motion(weaker, 90.0, motion)


@pytest.mark.slow
def test_friction_curves_are_found_to_three_hundredths_and_their_kinds_told_apart(
    robot: RobotModel, motion: SlowMotion
):
    found = identify_slow_motion(robot, BELIEVED_LOAD, motion)
    for joint, true in enumerate(FRICTIONS):
        best = found.frictions[joint][0]
        fastest = np.abs(motion.rate[:, joint]).max()
        speeds = np.linspace(0.1, 1.0, 40) * fastest
        np.testing.assert_allclose(best.torque(speeds), true.part().torque(speeds), rtol=0.03)
        if isinstance(true, Stribeck):
            assert best.kind == "Stribeck", joint


def test_a_hump_that_is_not_there_is_not_found():
    rate = np.concatenate([np.linspace(-1.0, -0.01, 200), np.linspace(0.01, 1.0, 200)])
    torque = Sigmoid(50.0, 100.0, 300.0).part().torque(rate) + np.random.default_rng(0).normal(size=400)
    assert fit_frictions(rate, torque)[0].kind == "Sigmoid"


def test_samples_after_a_reversal_and_of_sticking_joints_are_left_out():
    rate = np.full((100, 6), 0.1)
    rate[40:] = -0.1
    rate[70:80] = 1e-4
    used = moving_samples(rate, PERIOD, after_reversal=0.1)[:, 0]
    assert used[5:40].all()
    assert not used[40:45].any()
    assert used[45:70].all()
    assert not used[70:85].any()
    assert used[85:].all()


def test_a_robot_at_rest_shows_no_friction(robot: RobotModel, motion: SlowMotion):
    still = replace(motion, rate=0.0 * motion.rate)
    with pytest.raises(ValueError, match="friction cannot be seen"):
        identify_slow_motion(robot, BELIEVED_LOAD, still)
    with pytest.raises(ValueError, match="in both directions"):
        fit_frictions(np.linspace(0.1, 1.0, 50), np.ones(50))
