"""Designed slow motions keep their limits and show load and friction better than drawn ones."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import RobotModel, load_robot
from robots.identification.slow_motion import SlowMotion, identify_slow_motion
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from robots.measurement_design.excitation import (
    ExcitationLimits,
    condition_number,
    design_excitation,
    fitted_motion,
)
from tests.robots.identification.test_slow_motion import (
    BELIEVED_LOAD,
    CENTRE,
    FRICTIONS,
    NOISE,
    PRELOAD,
    STIFFNESS,
    TRUE_LOAD,
    needed,
)

PERIOD, PAYLOAD = 20.0, 200.0  # s, kg
TIMES = np.linspace(0.0, PERIOD, 1001)
LIMITS = ExcitationLimits()


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot("kr210")


@pytest.mark.parametrize("seed", range(5))
def test_a_motion_of_any_shape_fills_its_limits_and_begins_at_rest(robot: RobotModel, seed: int):
    shape = np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 11))
    q, v, a = fitted_motion(robot, PERIOD, shape, LIMITS).at(TIMES)
    np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-9)
    np.testing.assert_allclose(a[[0, -1]], 0.0, atol=1e-9)
    # Limits are looked at 400 times a motion, so that a peak between is missed by less than a hundredth.
    room = np.minimum(robot.upper, np.pi) - np.maximum(robot.lower, -np.pi) - 2.0 * LIMITS.margin
    used = np.stack(
        [
            np.ptp(q, axis=0) / room,
            np.abs(v).max(0) / (LIMITS.speed * robot.speed),
            np.abs(a).max(0) / LIMITS.acceleration,
        ]
    )
    np.testing.assert_allclose(used.max(axis=0), 1.0, atol=0.01)
    assert (q > robot.lower).all()
    assert (q < robot.upper).all()


def test_velocities_and_accelerations_are_derivatives(robot: RobotModel):
    motion = fitted_motion(robot, PERIOD, np.random.default_rng(7).uniform(-1.0, 1.0, (6, 9)), LIMITS)
    h = 1e-4
    ahead, behind = motion.at(TIMES + h), motion.at(TIMES - h)
    _, v, a = motion.at(TIMES)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2.0 * h), v, atol=1e-6)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2.0 * h), a, atol=1e-6)


@pytest.mark.slow
def test_the_design_is_free_of_collisions_and_better_than_what_was_drawn(robot: RobotModel):
    found = design_excitation(robot, PAYLOAD, PERIOD, harmonics=3, generations=4)
    q, v, _ = found.motion.at(TIMES)
    # A little closer between the samples of the design than at them.
    is_free = AdmissibleConfigurations(robot, AdmissibleConfig(clearance=0.5 * LIMITS.clearance))
    assert is_free(q).all()
    assert found.condition < found.drawn
    assert condition_number(robot, PAYLOAD, q, v) == pytest.approx(found.condition, rel=0.2)


@pytest.mark.slow
def test_a_designed_motion_shows_load_counterbalance_and_friction(robot: RobotModel):
    """Of a rigid robot with noise on its torques: the first two to 1 %, curves to 3 %."""
    period, step = 30.0, 0.02
    motion = design_excitation(robot, BELIEVED_LOAD, period, generations=4).motion
    theta, rate, acceleration = motion.at(step * np.arange(round(period / step)))
    spring = robot.counterbalance
    assert spring is not None
    true = replace(
        robot,
        payload=replace(robot.payload, center_of_mass=CENTRE),
        counterbalance=replace(spring, stiffness=STIFFNESS, preload=PRELOAD),
    )
    torque = needed(true, theta, rate, acceleration)
    torque += np.stack([f.part().torque(v) for f, v in zip(FRICTIONS, rate.T, strict=True)], axis=1)
    torque += NOISE * np.random.default_rng(1).normal(size=torque.shape)
    recorded = SlowMotion(step, theta, rate, acceleration, torque)
    found = identify_slow_motion(robot, BELIEVED_LOAD, recorded)
    assert found.payload == pytest.approx(TRUE_LOAD, rel=0.01)
    assert found.spring_stiffness == pytest.approx(STIFFNESS, rel=0.01)
    assert found.spring_preload == pytest.approx(PRELOAD, rel=0.01)
    for joint, friction in enumerate(FRICTIONS):
        speeds = np.linspace(0.1, 1.0, 40) * np.abs(rate[:, joint]).max()
        found_torque = found.frictions[joint][0].torque(speeds)
        np.testing.assert_allclose(found_torque, friction.part().torque(speeds), rtol=0.03)


def test_impossible_numbers_are_refused(robot: RobotModel):
    with pytest.raises(ValueError, match="a positive period and two harmonics, got 0 s and 5"):
        design_excitation(robot, PAYLOAD, 0.0)
    with pytest.raises(ValueError, match="speed must be a share up to 1"):
        ExcitationLimits(speed=1.5)
