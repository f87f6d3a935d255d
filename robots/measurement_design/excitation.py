"""Slow motions that show load, counterbalance and friction: Fourier series within limits.

Swevers, Ganseman, Tuekel, De Schutter and Van Brussel (1997): the motion of each joint is a finite Fourier
series, whose coefficients are chosen for a small condition number of the regression that will be made of it.
Each series is stretched until it meets the first of its limits, so that of all constraints only collisions
are left to the search.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution

from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.slow_motion import load_columns
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations

_LIMIT_SAMPLES = 400  # of a motion, at which its limits are looked at
_SAMPLES = 60  # at which the regression and collisions are
_COLLIDES = 1e6  # more than any condition number of a motion that is free
_OPEN_END = np.pi  # rad, of a joint that turns further


@dataclass(frozen=True)
class ExcitationLimits:
    """What a slow motion must keep."""

    speed: float = 0.4  # share of the largest speeds
    acceleration: float = 1.0  # rad/s^2, so that structure and gears do not ring
    margin: float = 0.1  # rad from the ends of the ranges
    clearance: float = 0.05  # m of the arm from the floor and from itself

    def __post_init__(self) -> None:
        if not (0.0 < self.speed <= 1.0 and self.acceleration > 0.0 and self.margin >= 0.0):
            raise ValueError(
                "excitation: speed must be a share up to 1, acceleration positive and margin not negative, "
                f"got {self.speed:g}, {self.acceleration:g} rad/s^2 and {self.margin:g} rad"
            )


@dataclass(frozen=True)
class FourierMotion:
    """All joints as series of k harmonics; it begins and ends at rest, without acceleration."""

    period: float  # s
    middle: np.ndarray  # (6,) rad
    sine: np.ndarray  # (6, k) rad
    cosine: np.ndarray  # (6, k) rad

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions in rad, velocities and accelerations at times in s (n,), (n, 6) each."""
        order = 2.0 * np.pi / self.period * np.arange(1, self.sine.shape[1] + 1)
        sine, cosine = np.sin(np.outer(times, order)), np.cos(np.outer(times, order))
        q = self.middle + sine @ self.sine.T + cosine @ self.cosine.T
        v = cosine @ (order * self.sine).T - sine @ (order * self.cosine).T
        a = -sine @ (order**2 * self.sine).T - cosine @ (order**2 * self.cosine).T
        return q, v, a


@dataclass(frozen=True)
class Excitation:
    """A motion that was designed."""

    motion: FourierMotion
    condition: float  # of the regression, columns scaled to one length
    drawn: float  # median of the condition numbers of the motions that were drawn first and are free
    evaluations: int


def design_excitation(
    robot: RobotModel,
    payload: float,
    period: float,
    harmonics: int = 5,
    limits: ExcitationLimits = ExcitationLimits(),
    generations: int = 15,
    seed: int = 0,
) -> Excitation:
    """Searches for a motion with a small condition number.

    Args:
        robot: as it is believed to be.
        payload: mass at the flange in kg.
        period: of the motion in s.
        harmonics: of each joint, two or more.
        limits: that it keeps.
        generations: of the search, differential evolution (Storn and Price, 1997).
        seed: of the search.

    Raises:
        ValueError: if a number is impossible or no motion that was found is free of collisions.
    """
    if not period > 0.0 or harmonics < 2:
        raise ValueError(
            f"excitation: needs a positive period and two harmonics, got {period:g} s and {harmonics}"
        )
    is_free = AdmissibleConfigurations(robot, AdmissibleConfig(clearance=limits.clearance))
    times = period * np.arange(_SAMPLES) / _SAMPLES
    first: list[float] = []
    size = NUM_JOINTS * (2 * harmonics + 1)

    def value(x: np.ndarray) -> float:
        motion = fitted_motion(robot, period, x.reshape(NUM_JOINTS, -1), limits)
        q, v, _ = motion.at(times)
        free = is_free(q)
        if not free.all():
            return _COLLIDES * (2.0 - float(free.mean()))
        found = condition_number(robot, payload, q, v)
        if len(first) < size:
            first.append(found)
        return found

    found = differential_evolution(
        value,
        [(-1.0, 1.0)] * size,
        popsize=1,  # times the number of coefficients
        maxiter=generations,
        rng=np.random.default_rng(seed),
        polish=False,
        tol=0.0,
    )
    if found.fun >= _COLLIDES:
        raise ValueError(
            f"excitation: no motion of {robot.name} that keeps {limits.clearance:g} m from the floor and "
            f"itself was found in {found.nfev} trials"
        )
    motion = fitted_motion(robot, period, found.x.reshape(NUM_JOINTS, -1), limits)
    return Excitation(motion, float(found.fun), float(np.median(first)), int(found.nfev))


def fitted_motion(
    robot: RobotModel, period: float, shape: np.ndarray, limits: ExcitationLimits
) -> FourierMotion:
    """The largest motion of given shapes that keeps ranges, speeds and accelerations.

    Args:
        robot: whose they are.
        period: in s.
        shape: of each joint where its motion lies within its range, -1 to 1, then the relations of sines and
            of cosines, (6, 1 + 2 k).
        limits: beside the ranges.
    """
    order = np.arange(1.0, shape.shape[1] // 2 + 1)
    sine, cosine = np.split(shape[:, 1:], 2, axis=1)
    # At rest in the beginning: no speed, no acceleration.
    sine = sine - np.outer(sine @ order, order) / (order @ order)
    cosine = cosine - np.outer(cosine @ order**2, order**2) / (order**2 @ order**2)
    one = FourierMotion(period, np.zeros(NUM_JOINTS), sine, cosine)
    q, v, a = one.at(period * np.arange(_LIMIT_SAMPLES) / _LIMIT_SAMPLES)
    lower = np.maximum(robot.lower, -_OPEN_END) + limits.margin
    upper = np.minimum(robot.upper, _OPEN_END) - limits.margin
    room = upper - lower
    factor = np.min(
        [
            room / np.maximum(np.ptp(q, axis=0), 1e-9),
            limits.speed * robot.speed / np.maximum(np.abs(v).max(0), 1e-9),
            limits.acceleration / np.maximum(np.abs(a).max(0), 1e-9),
        ],
        axis=0,
    )
    span = factor * np.ptp(q, axis=0)
    lowest = lower + 0.5 * (1.0 + shape[:, 0]) * (room - span)
    middle = lowest - factor * q.min(axis=0)
    return FourierMotion(period, middle, factor[:, None] * sine, factor[:, None] * cosine)


def condition_number(robot: RobotModel, payload: float, q: np.ndarray, v: np.ndarray) -> float:
    """Of the regression for load, counterbalance, Coulomb and viscous friction; columns of one length.

    Args:
        robot: as it is believed to be.
        payload: in kg.
        q, v: positions in rad and velocities in rad/s, (n, 6).
    """
    load = load_columns(robot, payload, q)
    friction = np.zeros((len(q), NUM_JOINTS, 2 * NUM_JOINTS))
    for joint in range(NUM_JOINTS):
        friction[:, joint, joint], friction[:, joint, NUM_JOINTS + joint] = np.sign(v[:, joint]), v[:, joint]
    Y = np.concatenate([load, friction], axis=2).reshape(len(q) * NUM_JOINTS, -1)
    length = np.linalg.norm(Y, axis=0)
    return float(np.linalg.cond(Y[:, length > 0.0] / length[length > 0.0]))
