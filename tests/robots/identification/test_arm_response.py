"""The linear model along a motion: at rest it sags, its sensitivities are those of its own differences."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.dynamics.modes import ModalAnalysis
from robots.identification.arm_along_motion import ArmAlongMotion, ElasticArm
from robots.identification.arm_response import ArmResponse, Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

PAYLOAD = 210.0  # kg
POSITION = np.deg2rad([0.0, -60.0, 40.0, 30.0, 50.0, 0.0])
PERIOD = 1e-3  # s
SENSORS = [
    SensorPlace("gyro", "gyro", "link_3", np.zeros(3), np.eye(3), 200.0, 2e-3),
    SensorPlace("acc", "accelerometer", "link_6", np.array([0.0, 0.0, 0.05]), np.eye(3), 200.0, 0.05),
]


def case(angle: float, samples: int, duration: float = 0.08) -> MotionCase:
    """Axes 1 to 3 turn by an angle in rad with a sine of one period as acceleration, then rest."""
    t = np.arange(samples) * PERIOD
    s = np.clip((t - 0.01) / duration, 0.0, 1.0)
    turned = angle * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
    speed = angle / duration * (1.0 - np.cos(2.0 * np.pi * s)) * ((s > 0.0) & (s < 1.0))
    theta, rate = np.tile(POSITION, (samples, 1)), np.zeros((samples, 6))
    theta[:, :3] += turned[:, None]
    rate[:, :3] = speed[:, None]
    return MotionCase("one", PERIOD, theta, rate, np.zeros((samples, len(SENSORS), 3)))


@pytest.fixture(scope="module")
def arm() -> ElasticArm:
    return ElasticArm(load_robot("kr210"), PAYLOAD, SENSORS)


def response(arm: ElasticArm, motion: MotionCase, gear_parts: bool) -> tuple[ArmResponse, ElasticParameters]:
    parameters = ElasticParameters(arm, gear_parts, turning=[0, 1, 2])
    along = arm.along(motion, knot_time=0.03)
    return ArmResponse([along], [motion], SENSORS, parameters, load_robot("kr210").gear_ratio), parameters


def test_at_rest_an_accelerometer_shows_gravity_and_a_gyro_nothing(arm: ElasticArm):
    """Whatever play and hysteresis the gears have: they begin in equilibrium and stay there."""
    model, parameters = response(arm, case(0.0, 40), gear_parts=True)
    shown = model(parameters.start, sensitivity=False).readings[:, 0]
    np.testing.assert_allclose(shown[:, :3], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(shown[:, 3:], axis=1), 9.81, rtol=1e-3)


def test_motors_that_speed_up_from_one_sample_to_the_next_load_the_springs_as_much(arm: ElasticArm):
    """Those of a light robot do, at the ticks of its drives; between two samples nothing is made up."""
    jerky = case(0.02, 40)
    jerky = replace(jerky, rate=jerky.rate + 1e-3 * np.random.default_rng(0).normal(size=jerky.rate.shape))
    along = arm.along(jerky, knot_time=1e-3)
    q, v, vdot = np.zeros((3, len(jerky.theta), arm.size))
    q[:, arm.motors], v[:, arm.motors], vdot[:, arm.motors] = jerky.theta, jerky.rate, jerky.acceleration
    at_knots = [int(np.searchsorted(along.knots, k)) for k in range(12, 30)]
    q[12:30, arm.sprung] = along.rest[at_knots]
    for k in range(12, 30):
        load, _ = arm.evaluate(q[k], v[k], vdot[k])
        np.testing.assert_allclose(along.load[k], load, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("gear_parts", [False, True], ids=["linear gears", "play and hysteresis"])
def test_sensitivities_are_differences_of_the_model(arm: ElasticArm, gear_parts: bool):
    model, parameters = response(arm, case(0.01, 120), gear_parts)
    p = parameters.start + 0.05
    derived = model(p).sensitivity
    assert derived is not None
    for kind in dict.fromkeys(parameters.kinds):
        column = int(parameters.of_kind(kind)[1 if kind != "lubricant" and kind != "width" else 0])
        step = 1e-5 * np.eye(len(parameters))[column]
        ahead, behind = (model(p + sign * step, sensitivity=False).readings for sign in (1.0, -1.0))
        difference = (ahead - behind) / 2e-5
        # Teeth that meet within the step of the difference are no derivative; they are few.
        error = np.abs(difference - derived[..., column]).mean()
        assert error < 0.02 * np.abs(difference).mean(), parameters.names[column]


def test_a_stiffer_start_with_the_right_unknowns_is_the_same_model(arm: ElasticArm):
    """What the start was is not in the answer: half the spring and its unknown at log 2 are one whole."""
    robot = load_robot("kr210")
    train = replace(robot.joints[1].drive_train, stiffness=0.5 * robot.joints[1].drive_train.stiffness)
    joints = [replace(joint, drive_train=train) if i == 1 else joint for i, joint in enumerate(robot.joints)]
    softer = ElasticArm(replace(robot, joints=joints), PAYLOAD, SENSORS)
    motion = case(0.01, 100)
    model, parameters = response(arm, motion, gear_parts=False)
    other, others = response(softer, motion, gear_parts=False)
    p = parameters.start.copy()
    q = p.copy()
    q[others.names.index("stiffness_gear_2")] = np.log(2.0)
    np.testing.assert_allclose(
        other(q, sensitivity=False).readings, model(p, sensitivity=False).readings, atol=0.02
    )


def test_it_rings_with_the_natural_frequency_of_the_robot(arm: ElasticArm):
    """An independent linearisation, that of `truetip modes`, with the motors held."""
    motion = case(0.002, 900, duration=0.06)
    model, parameters = response(arm, motion, gear_parts=False)
    shown = model(parameters.start, sensitivity=False).readings[100:, 0, :3]
    spectrum = np.abs(np.fft.rfft(shown * np.hanning(len(shown))[:, None], n=2**15, axis=0)).sum(1)
    found = np.fft.rfftfreq(2**15, 2.0 * PERIOD)[int(np.argmax(spectrum))]
    modes = ModalAnalysis(load_robot("kr210"), payload=PAYLOAD).at(POSITION)
    assert np.abs(modes.frequency_hz[:3] / found - 1.0).min() < 0.05


def test_about_a_motion_that_rings_the_equations_are_those_of_the_arm(arm: ElasticArm):
    """Load and readings are then right to the second degree: those of the inverse dynamics."""
    motion, rng = case(0.01, 60), np.random.default_rng(1)
    along = arm.along(motion, knot_time=0.03)
    t, e = motion.times[:, None], len(arm.sprung)
    wave, w = 2e-3 * rng.normal(size=e), 2.0 * np.pi * 15.0
    moved = np.stack([wave * np.sin(w * t), w * wave * np.cos(w * t), -w * w * wave * np.sin(w * t)], 1)
    near = arm.about(motion, along, moved)
    k = int(along.knots[1])  # where nothing is interpolated
    x, v, a = moved[k]
    q, qd, qdd = np.zeros((3, arm.size))
    q[arm.motors], qd[arm.motors], qdd[arm.motors] = motion.theta[k], motion.rate[k], motion.acceleration[k]
    q[arm.sprung], qd[arm.sprung], qdd[arm.sprung] = x, v, a
    torques, shown = arm.evaluate(q, qd, qdd)

    def errors(motion: ArmAlongMotion) -> tuple[float, float]:
        x_0 = motion.rest[1]
        of_torque = motion.mass[1] @ a + motion.coriolis[1] @ v + motion.stiffness[1] @ (x - x_0)
        of_shown = motion.by_acceleration[1] @ a + motion.by_speed[1] @ v + motion.by_turn[1] @ (x - x_0)
        return (
            float(np.abs(of_torque + motion.load[k] - torques).max()),
            float(np.abs(of_shown + motion.readings[k] - shown).max()),
        )

    before, after = errors(along), errors(near)
    assert after[0] < 1e-3 * before[0]
    assert after[1] < 1e-3 * before[1]


def test_a_gear_without_load_begins_where_it_is_said_to_rest(arm: ElasticArm):
    """Axis 1 carries nothing before a motion: each half of its play turns the base by as much."""
    motion = case(0.0, 20)
    parameters = ElasticParameters(arm, gear_parts=True)
    along, ratio = arm.along(motion), load_robot("kr210").gear_ratio
    turned = []
    for share in (-1.0, 0.0, 1.0):
        rests = np.zeros((1, 6))
        rests[0, 0] = share
        model = ArmResponse([along], [motion], SENSORS, parameters, ratio, rests=rests)
        assert model.unloaded(parameters.start)[0, 0]
        assert not model.unloaded(parameters.start)[0, 1]
        turned.append(model(parameters.start, sensitivity=False).moved[0][0, 0, 0])
    half = 0.5 * parameters.numbers(parameters.start).play[0]
    np.testing.assert_allclose(turned, [-half, 0.0, half], atol=1e-6)


def test_half_the_step_leaves_a_quarter_of_the_error(arm: ElasticArm):
    """Linear gears, a fast motion, knots of 20 ms: the rule is of second order, and nothing else errs."""
    motion = case(0.2, 240, duration=0.15)
    parameters = ElasticParameters(arm, gear_parts=False)
    along, ratio = arm.along(motion), load_robot("kr210").gear_ratio
    once, twice, four = (
        ArmResponse([along], [motion], SENSORS, parameters, ratio, Grid(steps))(
            parameters.start, sensitivity=False
        ).readings[..., :3]
        for steps in (1, 2, 4)
    )
    assert np.linalg.norm(twice - four) < 0.4 * np.linalg.norm(once - twice)
