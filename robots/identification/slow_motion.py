"""Friction, counterbalance and payload from slow motions, Reiner (2010), section 4.2.1.

Torques of slow motions are those of friction, gravity and the counterbalance, and a little inertia that a
rigid model knows. Friction changes its sign with the speed and gravity does not, so that both come out of one
regression that is linear: friction of each joint as straight lines between knots in its speed, and the first
moments of the load and the two numbers of the spring. What kind of curve friction is, is asked afterwards.
Samples in which a joint sticks or has just turned round are left out, as in (4.1) and (4.4).
"""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from robots.description.model import NUM_JOINTS, RobotModel
from robots.drivetrain.counterbalance import Counterbalance
from robots.dynamics.plant import add_robot
from robots.identification.friction_fit import FrictionFit, fit_frictions

LEAST_SPEED = 5e-3  # rad/s, below which a joint may stick
TURNED_ROUND = 0.05  # s after a reversal in which friction and gears are not settled
_KNOTS = 12  # of the curve of a joint's friction
_ROUNDS = 4  # the inertia of the load depends on what is found of it
_RANK = 1e-8  # of the largest singular value
_NO_LOAD = 3.0  # standard deviations of a mass that may be none


@dataclass(frozen=True)
class SlowMotion:
    """A motion of all joints, on the side of the links; n samples."""

    period: float  # s
    theta: np.ndarray  # (n, 6) rad
    rate: np.ndarray  # (n, 6) rad/s
    acceleration: np.ndarray  # (n, 6) rad/s^2
    torque: np.ndarray  # (n, 6) N m, of the motors, by their currents


@dataclass(frozen=True)
class SlowIdentification:
    """What slow motions say of a robot."""

    payload: float  # kg
    payload_centre: np.ndarray  # (3,) m in the frame of the flange
    spring_stiffness: float | None  # N / m, None without a counterbalance
    spring_preload: float | None  # N
    sigma: np.ndarray  # (4 or 6,) kg, kg m (three), N / m, N: standard deviations
    frictions: list[list[FrictionFit]]  # of each joint all kinds, the best first; empty for one that rests
    moving: np.ndarray  # (n, 6) bool, the samples that were used


def moving_samples(
    rate: np.ndarray, period: float, least_speed: float = LEAST_SPEED, after_reversal: float = TURNED_ROUND
) -> np.ndarray:
    """Where joints neither stick nor have just turned round, shape (n, 6) bool.

    Args:
        rate: in rad/s, shape (n, 6).
        period: between samples in s.
        least_speed: in rad/s.
        after_reversal: in s, for which samples are left out.
    """
    fast = np.abs(rate) > least_speed
    wait = max(1, round(after_reversal / period))
    settled = fast.copy()
    for joint in range(rate.shape[1]):
        begins = np.flatnonzero(fast[1:, joint] & ~fast[:-1, joint]) + 1
        signs = np.flatnonzero(np.diff(np.sign(rate[:, joint])) != 0) + 1
        for begin in (*begins, *signs):
            settled[begin : begin + wait, joint] = False
    return settled


def identify_slow_motion(robot: RobotModel, payload: float, motion: SlowMotion) -> SlowIdentification:
    """Finds payload, counterbalance and friction.

    Args:
        robot: whose geometry and link masses are right; counterbalance and centre of the load are the start.
        payload: mass at the flange in kg to begin with.
        motion: slow, of several joints in both directions.

    Raises:
        ValueError: if the motion does not show all of them, or names an impossible load.
    """
    moving = moving_samples(motion.rate, motion.period)
    if not moving.any():
        raise ValueError(
            f"slow motion: no joint is faster than {LEAST_SPEED:g} rad/s: friction cannot be seen"
        )
    knots = [_knots(np.abs(motion.rate[moving[:, joint], joint])) for joint in range(NUM_JOINTS)]
    friction = _friction_columns(motion.rate, knots)
    believed, mass, asked, sigma, of_load = robot, payload, payload, np.zeros(0), 0
    for _ in range(_ROUNDS):
        known, load = _torques(believed, mass, motion), load_columns(believed, mass, motion.theta)
        Y = np.concatenate([load, friction], axis=2)[moving]
        scale = np.linalg.norm(Y, axis=0)
        used = scale > 0.0
        singular = np.linalg.svd(Y[:, used] / scale[used], compute_uv=False)
        if singular[-1] < _RANK * singular[0]:
            raise ValueError("slow motion: it does not tell payload, counterbalance and friction apart")
        wanted = (motion.torque - known)[moving]
        found = np.zeros(Y.shape[1])
        found[used] = np.linalg.lstsq(Y[:, used], wanted, rcond=None)[0]
        left = wanted - Y @ found
        of_load = load.shape[2]
        variance = float(left @ left) / max(len(left) - int(used.sum()), 1)
        sigma = np.zeros(len(used))
        sigma[used] = np.sqrt(variance * np.diagonal(np.linalg.inv(Y[:, used].T @ Y[:, used])))
        asked = mass + float(found[0])
        mass, believed = _updated(believed, mass, found[:of_load])
    if abs(asked - mass) > _NO_LOAD * sigma[0]:
        raise ValueError(
            f"slow motion: it asks for a payload of {asked:.1f} kg; {robot.name} carries up to "
            f"{robot.payload.largest_mass:g} kg"
        )
    if mass <= _NO_LOAD * sigma[0]:
        mass, believed = 0.0, replace(believed, payload=robot.payload)
    lost = motion.torque - _torques(believed, mass, motion)
    frictions = [
        fit_frictions(motion.rate[rows, joint], lost[rows, joint]) if len(knots[joint]) else []
        for joint, rows in enumerate(moving.T)
    ]
    spring = believed.counterbalance
    return SlowIdentification(
        mass,
        believed.payload.center_of_mass,
        spring.stiffness if spring else None,
        spring.preload if spring else None,
        sigma[:of_load],
        frictions,
        moving,
    )


def _knots(speed: np.ndarray) -> np.ndarray:
    """Speeds between which friction is taken for a straight line; none for a joint that rests."""
    if len(speed) < 2 * _KNOTS:
        return np.zeros(0)
    return np.unique(np.quantile(speed, np.linspace(0.0, 1.0, _KNOTS)))


def _friction_columns(rate: np.ndarray, knots: list[np.ndarray]) -> np.ndarray:
    """Torques of all joints by the heights of their curves at the knots, (n, 6, sum of knots)."""
    columns = np.zeros((len(rate), NUM_JOINTS, sum(map(len, knots))))
    first = 0
    for joint, own in enumerate(knots):
        for k in range(len(own)):
            hat = np.interp(np.abs(rate[:, joint]), own, np.eye(len(own))[k])
            columns[:, joint, first + k] = np.sign(rate[:, joint]) * hat
        first += len(own)
    return columns


def load_columns(robot: RobotModel, payload: float, theta: np.ndarray) -> np.ndarray:
    """Derivatives of the torques at rest by the load.

    Args:
        robot: whose geometry is right.
        payload: mass at the flange in kg.
        theta: positions in rad, (n, 6).

    Returns:
        In N m by the mass at the flange in kg, its first moments in kg m, and stiffness (N/m) and preload (N)
        of a counterbalance, (n, 6, 4 or 6).
    """
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot, "rigid", payload)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    gravity, world = plant.gravity_field().gravity_vector(), plant.world_frame()
    flange = plant.GetBodyByName("link_6").body_frame()
    springs = _spring_columns(robot, theta[:, 1])
    points = np.vstack([np.zeros(3), np.eye(3)]).T
    load = np.zeros((len(theta), NUM_JOINTS, 4 + springs.shape[1]))
    for row, q in enumerate(theta):
        plant.SetPositions(context, q)
        J = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, flange, points, world, world
        ).reshape(4, 3, NUM_JOINTS)
        pulls = -np.einsum("pkj,k->pj", J, gravity)
        load[row, :, 0] = pulls[0]
        load[row, :, 1:4] = (pulls[1:] - pulls[0]).T
    load[:, 1, 4:] = springs
    return load


def _torques(robot: RobotModel, payload: float, motion: SlowMotion) -> np.ndarray:
    """What a rigid robot needs without friction, (n, 6) in N m."""
    frictionless = replace(
        robot,
        joints=[replace(j, drive_train=replace(j.drive_train, viscous_friction=0.0)) for j in robot.joints],
    )
    plant = MultibodyPlant(0.0)
    add_robot(plant, frictionless, "rigid", payload)
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    torques = np.empty_like(motion.torque)
    for row, q in enumerate(motion.theta):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, motion.rate[row]]))
        plant.CalcForceElementsContribution(context, forces)
        torques[row] = plant.CalcInverseDynamics(context, motion.acceleration[row], forces)
    return torques


def _spring_columns(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    """What motor 2 has to give by stiffness and preload of the counterbalance, (n, 2), or (n, 0)."""
    part = robot.counterbalance_at_axis_2
    if part is None:
        return np.zeros((len(q), 0))
    one, other = (
        Counterbalance(
            stiffness, preload, part.base_radius, part.arm_radius, part.dead_centre_deg, part.lateral
        ).torque(q)
        for stiffness, preload in ((1.0, 0.0), (1.0, 1.0))
    )
    return -np.stack([one, other - one], axis=1)


def _updated(robot: RobotModel, payload: float, change: np.ndarray) -> tuple[float, RobotModel]:
    """Mass and robot with what was found; a mass that no load has is none, or the largest, until the end."""
    mass = min(max(payload + float(change[0]), 0.0), robot.payload.largest_mass)
    centre = robot.payload.center_of_mass
    if mass > 0.0:
        centre = (payload * centre + change[1:4]) / mass
    spring = robot.counterbalance
    if spring is not None:
        spring = replace(
            spring,
            stiffness=spring.stiffness + float(change[4]),
            preload=spring.preload + float(change[5]),
        )
    return mass, replace(robot, payload=replace(robot.payload, center_of_mass=centre), counterbalance=spring)
