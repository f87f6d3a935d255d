"""Drive trains as tables of numbers, which compiled functions take."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.efficiency import DirectionalEfficiency
from robots.drivetrain.friction import (
    Friction,
    PolynomialFriction,
    SigmoidFriction,
    StickSlipFriction,
    StribeckFriction,
    TanhFriction,
)
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, GearSpring, LimitedSpring

CUBIC, EXPONENTIAL, LIMITED = range(3)
# Others come before what holds a joint against the rest.
SIGMOID, TANH, STRIBECK, POLYNOMIAL, STICK_SLIP = range(5)
_MOST_NUMBERS = 9  # of a friction


class TrainTable(NamedTuple):
    """The parts of n joints; what a joint does not have has numbers that do nothing."""

    springs: np.ndarray  # (n, 5), kind, c_0, gamma, c_max, sharpness
    gears: np.ndarray  # (n, 6), damping, half of the gap, lubricant, soft, damped, damping of the soft branch
    motors: np.ndarray  # (n, 3), lag in s, unit of the torque as a state in N m, inertia of the rotor
    waves: np.ndarray  # (n, k, 3), of the ratio: amplitude over the mean, frequency, phase
    newton_steps: int  # to the angle of a gear's output
    elements: np.ndarray  # (2, n, k), stiffness and width of the elements of the hysteresis
    efficiencies: np.ndarray  # (n, 6), of `DirectionalEfficiency`, the least that is possible last
    frictions: np.ndarray  # (m, 11), joint, kind and numbers, in the order in which they are to be taken
    soft_at: int  # where the states of the soft branches begin, -1 if there are none
    elements_at: int  # where those of the hysteresis begin
    has_lag: bool
    has_efficiency: bool


def spring_rows(springs: Sequence[GearSpring]) -> np.ndarray:
    """Springs as rows of a `TrainTable`.

    Raises:
        TypeError: if one is of no kind that robot files have.
    """
    return np.array([_spring_row(spring) for spring in springs], dtype=float)


def _spring_row(spring: GearSpring) -> tuple[float, ...]:
    match spring:
        case CubicSpring():
            return CUBIC, spring.c_0, spring.gamma, 0.0, 0.0
        case ExponentialSpring():
            return EXPONENTIAL, spring.c_0, spring.gamma, spring.c_max, 0.0
        case LimitedSpring():
            return LIMITED, spring.c_0, spring.gamma, spring.c_max, spring.sharpness
    raise TypeError(f"a drive train has no {type(spring).__name__}")


def friction_rows(parts: Sequence[tuple[Friction, ...]]) -> np.ndarray:
    """The frictions of all joints as rows of a `TrainTable`, those that hold a joint last."""
    rows = [(j, *_numbers(part)) for j, of_joint in enumerate(parts) for part in of_joint]
    rows.sort(key=lambda row: row[1])
    table = np.zeros((len(rows), 2 + _MOST_NUMBERS))
    for filled, row in zip(table, rows, strict=True):
        filled[: len(row)] = row
    return table


def _numbers(part: Friction) -> tuple[float, ...]:
    match part:
        case SigmoidFriction():
            return SIGMOID, part.viscous, part.coulomb, part.steepness
        case TanhFriction():
            return TANH, part.viscous, part.coulomb, part.width
        case StribeckFriction():
            base = part.base
            return STRIBECK, base.viscous, base.coulomb, base.steepness, part.a, part.c
        case PolynomialFriction():
            line = part.torque_at_one, part.slope_at_one
            return POLYNOMIAL, part.coulomb, part.steepness, part.step, *line, *part.coefficients.tolist()
        case StickSlipFriction():
            holding = part.breakaway, part.stribeck_velocity, part.stopping_time
            return STICK_SLIP, part.viscous, part.coulomb, *holding


def efficiency_rows(row: DirectionalEfficiency | None, size: int) -> np.ndarray:
    """Efficiencies as rows of a `TrainTable`."""
    if row is None:
        return np.ones((size, 6))
    numbers = row.forward, row.backward, row.forward_per_speed, row.backward_per_speed, row.rest_width
    return np.stack([*np.broadcast_arrays(*numbers), np.full(size, row.LEAST)], axis=1).astype(float)


def element_table(row: DahlHysteresis | None, size: int) -> np.ndarray:
    """The elements of hystereses as a `TrainTable` has them."""
    return np.empty((2, size, 0)) if row is None else np.array([row.stiffness, row.width], dtype=float)


def stacked(parts: Sequence[Any]) -> Any:
    """One part with arrays of the parameters of all, along the first axis; parts within parts likewise."""
    values = {}
    for entry in fields(parts[0]):
        if entry.init:
            each = [getattr(part, entry.name) for part in parts]
            values[entry.name] = stacked(each) if is_dataclass(each[0]) else np.array(each, dtype=float)
    return type(parts[0])(**values)
