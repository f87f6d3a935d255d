"""Springs from the torques of motors: the arm then rings as it truly does; what may be wrong is refused."""

from dataclasses import replace

import numpy as np
import pytest

from robots.description.model import RobotModel, load_robot
from robots.description.variation import Factors, varied
from robots.dynamics.modes import ModalAnalysis
from robots.identification.arm_response import ArmResponse
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace
from robots.identification.motor_torques import MotorTorqueArm, TorqueRecording, springs_from_torques

PAYLOAD, ANGLE, STEP, SAMPLES = 210.0, np.deg2rad(5.0), 1e-3, 601
START = np.deg2rad([0.0, -60.0, 60.0, 0.0, 0.0, 0.0])
NOMINAL = load_robot("kr210")


def recording(robot: RobotModel) -> TorqueRecording:
    """Of motors that turn by five degrees in a fifth of a second, computed in finer steps than the fit's."""
    time = STEP * np.arange(SAMPLES)
    s = np.clip((time - 0.02) / 0.2, 0.0, 1.0)
    theta, rate = np.tile(START, (SAMPLES, 1)), np.zeros((SAMPLES, 6))
    theta[:, :3] += ANGLE * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))[:, None]
    rate[:, :3] = (ANGLE / 0.2 * (1.0 - np.cos(2.0 * np.pi * s)))[:, None]
    arm = MotorTorqueArm(robot, PAYLOAD)
    case = MotionCase("true", STEP, theta, rate, np.zeros((SAMPLES, 0, 3)))
    channels = [SensorPlace(name, "", "", np.zeros(3), np.eye(3), 1e5, 0.0) for name in ("arm", "wrist")]
    parameters = ElasticParameters(arm, gear_parts=False)
    model = ArmResponse([arm.along(case)], [case], channels, parameters, robot.gear_ratio)
    shown = model(parameters.start, sensitivity=False).readings[:, 0]
    even = slice(0, None, 2)  # samples of the response
    friction = robot.joint_coulomb_friction * np.tanh(rate[even] / robot.coulomb_velocity)
    return TorqueRecording(time[even], theta[even], rate[even], shown + friction)


def hertz(robot: RobotModel) -> np.ndarray:
    """The two slowest modes where the motion ends: what the arm rings with."""
    end = START + ANGLE * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return ModalAnalysis(robot, payload=PAYLOAD).at(end).frequency_hz[:2]


def test_with_the_springs_it_learns_the_arm_rings_as_fast_as_it_truly_does():
    beams = np.tile([1.1, 0.85, 1.15], (6, 1))
    true = varied(NOMINAL, Factors(np.array([0.85, 0.82, 0.9, 1.1, 0.9, 1.0]), beams=beams))
    learnt = springs_from_torques(NOMINAL, PAYLOAD, recording(true), 0.2)
    assert np.abs(hertz(NOMINAL) / hertz(true) - 1.0).max() > 0.02
    assert np.abs(hertz(learnt) / hertz(true) - 1.0).max() < 0.002


def test_a_robot_that_is_as_believed_rings_on_as_believed():
    learnt = springs_from_torques(NOMINAL, PAYLOAD, recording(NOMINAL), 0.2)
    assert np.abs(hertz(learnt) / hertz(NOMINAL) - 1.0).max() < 0.002


def test_a_motor_feels_what_its_gear_carries_and_its_own_rotor():
    """Motor and gear turn about one axis, one behind the other: action and reaction."""
    arm, rng = MotorTorqueArm(NOMINAL, PAYLOAD), np.random.default_rng(3)
    q, v, vdot = rng.uniform(-0.5, 0.5, (3, arm.size))
    on_springs, torque = arm.evaluate(q, v, vdot)
    rotor = NOMINAL.reflected_inertia * vdot[arm.motors] + NOMINAL.joint_viscous_friction * v[arm.motors]
    np.testing.assert_allclose(torque - rotor, on_springs[:6], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"spread": 0.0}, "the spread must be between 0 and 1, got 0"),
        ({"robot": load_robot("kr16-realistic")}, "have parts beyond springs, dampers and friction"),
        ({"recording": "short"}, "needs at least 100 finite samples, got 50"),
        ({"recording": "nan"}, "with some that are not finite"),
    ],
)  # fmt: skip
def test_it_refuses_what_it_cannot_learn_from(change: dict, message: str):
    time, joints = STEP * np.arange(200), np.zeros((200, 6))
    still = TorqueRecording(time, joints, joints, joints)
    kinds = {
        "short": TorqueRecording(time[:50], joints[:50], joints[:50], joints[:50]),
        "nan": replace(still, torque=np.full_like(joints, np.nan)),
    }
    change = {"robot": NOMINAL, "spread": 0.2, **change}
    with pytest.raises(ValueError, match=message):
        springs_from_torques(
            change["robot"], 0.0, kinds.get(change.get("recording", ""), still), change["spread"]
        )
