"""Motions and sensors that a recording does not have and that the robot allows."""

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from scipy.stats import qmc

from experiments.feedforward.trial import Trial, references
from experiments.identify.cases import MotionCases, PlannedMotion, bodies_of, has_room
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.identification.arm_fit import ArmFit
from robots.identification.motion import KINDS, MotionCase, SensorPlace
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from systems.feedforward import FeedforwardConfig

_POSITIONS, _DRAWN = 16, 512  # that are looked at; of so many, the first that are free
_ANGLES_DEG = (5.0, 20.0)
_PAYLOADS = (0.0, 0.5, 1.0)  # of that of the recording
_WRIST = np.deg2rad(90.0)  # either way, within the ranges
_CLEARANCE = 0.05  # m of the arm from the floor and from itself
_ALONG = 5  # places of a motion that are checked for it
# rad/s and m/s^2, noise of a sample where the recording has no such sensor
_NOISE = {"gyro": 2e-3, "accelerometer": 5e-2}
_BANDWIDTH = 200.0  # Hz


def candidate_motions(robot: RobotModel, payload: float, seed: int = 0) -> list[PlannedMotion]:
    """Motions from positions all over the range of axes 2 and 3, with bent wrists and some payloads.

    Positions are Sobol's, which fill the range evenly; those are left out from which the arm would come near
    to the floor or itself, or leave its range.

    Args:
        robot: that moves.
        payload: of the recording in kg.
        seed: of the scrambling.
    """
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    lower[3:], upper[3:] = np.maximum(lower[3:], -_WRIST), np.minimum(upper[3:], _WRIST)
    drawn = qmc.Sobol(NUM_JOINTS - 1, rng=np.random.default_rng(seed)).random(_DRAWN)
    is_free = AdmissibleConfigurations(robot, AdmissibleConfig(clearance=_CLEARANCE))
    found, positions = [], 0
    for share in drawn:
        q = np.zeros(NUM_JOINTS)
        q[1:] = lower[1:] + share * (upper - lower)[1:]
        turned = [_turned(robot, is_free, q, angle) for angle in np.deg2rad(_ANGLES_DEG)]
        angles = [angle for angle in turned if angle is not None]
        if len(angles) < len(_ANGLES_DEG):
            continue
        loads = dict.fromkeys(round(part * payload, 1) for part in _PAYLOADS)
        found += [PlannedMotion(q, angle, load) for load in loads for angle in angles]
        positions += 1
        if positions == _POSITIONS:
            break
    return found


def _turned(
    robot: RobotModel, is_free: AdmissibleConfigurations, q: np.ndarray, angle: float
) -> float | None:
    """An angle with the sign that there is room for; None if there is none."""
    for turned in (angle, -angle):
        way = np.tile(q, (_ALONG, 1))
        way[:, :3] += np.linspace(0.0, turned, _ALONG)[:, None]
        if has_room(robot, q, turned) and is_free(way).all():
            return turned
    return None


def planned_case(
    robot: RobotModel, payload: float, motion: PlannedMotion, cases: MotionCases, period: float
) -> MotionCase:
    """A motion whose motors are where they are told to be, without readings.

    Args:
        robot: that moves.
        payload: in kg, where the motion says nothing else.
        motion: which.
        cases: how long it takes, rests and rings.
        period: between samples in s.
    """
    load = payload if motion.payload is None else motion.payload
    trial = Trial(
        robot,
        load,
        motion.start,
        motion.angle,
        FeedforwardConfig(kind="rigid"),
        settle=cases.settle,
        speeding_up=cases.speeding_up,
    )
    times = np.arange(0.0, cases.settle + trial.profile.duration + cases.ringing, period)
    wanted = references(trial, times)
    theta = np.array([each.position for each in wanted])
    rate = np.array([each.velocity for each in wanted])
    return MotionCase("planned", period, theta, rate, np.zeros((len(times), 0, 3)))


def candidate_sensors(robot: RobotModel, there: Sequence[SensorPlace]) -> list[SensorPlace]:
    """A gyro and an accelerometer for every body that has none, at its far end, with the noise of the others.

    There the next joint turns: a body moves most, and a casting gives hold.
    """
    taken = {(sensor.kind, sensor.body) for sensor in there}
    ends = far_ends(robot)
    *_, last = ends
    found = []
    for kind in KINDS:
        others = [sensor for sensor in there if sensor.kind == kind]
        noise = max((sensor.sigma for sensor in others), default=_NOISE[kind])
        bandwidth = min((sensor.bandwidth for sensor in others), default=_BANDWIDTH)
        for body, end in ends.items():
            # Where a beam begins, on the axis of its joint, an accelerometer shows hardly anything.
            begins = kind == "accelerometer" and not end.any() and body != last
            if (kind, body) not in taken and not begins:
                place = end if kind == "accelerometer" else np.zeros(3)
                name = f"{kind} on {body}"
                found.append(SensorPlace(name, kind, body, place, np.eye(3), bandwidth, noise))
    return found


def far_ends(robot: RobotModel) -> dict[str, np.ndarray]:
    """Where on each body the next one begins, in m in its frame, (3,); the tool on the last."""
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, "structure", 0.0)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    names = bodies_of(robot)
    frames = [plant.GetBodyByName(name).body_frame() for name in names]
    behind = [*frames[1:], parts.tool]
    return {
        name: after.CalcPose(context, frame).translation()
        for name, frame, after in zip(names, frames, behind, strict=True)
    }


def spread_of(fit: ArmFit, there: Sequence[SensorPlace], sensors: Sequence[SensorPlace]) -> np.ndarray:
    """What the model would leave of the readings of further sensors, (channels,) in rad/s or m/s^2.

    As many times their noise as it leaves of the sensors of that kind that are there, of the worst of these.
    """
    left = fit.spread.reshape(-1, 3).max(axis=1)
    times = {kind: 1.0 for kind in KINDS}
    for sensor, spread in zip(there, left.tolist(), strict=True):
        times[sensor.kind] = max(times[sensor.kind], spread / max(sensor.sigma, 1e-9))
    return np.repeat([times[sensor.kind] * sensor.sigma for sensor in sensors], 3)
