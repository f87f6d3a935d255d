"""The drive trains of a robot's joints: from the motions of motors and links to the torques on both.

All quantities are on the side of the link. theta is the position of a motor there, q that of a link.
"""

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, get_args

import numpy as np

from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.efficiency import DirectionalEfficiency
from robots.drivetrain.friction import (
    Friction,
    PolynomialFriction,
    StickSlipFriction,
)
from robots.drivetrain.ratio import FourierRatio
from robots.drivetrain.stiffness import GearSpring, SpringRow
from robots.drivetrain.train_table import (
    TrainTable,
    efficiency_rows,
    element_table,
    friction_rows,
    spring_rows,
    stacked,
)

_ACCELERATION_UNIT = 100.0  # rad/s^2


@dataclass(frozen=True)
class SoftBranch:
    """What stands beside the spring of a visco-elastic gear, see `robots.drivetrain.backlash`."""

    soft: float = 0.0  # c_2, N m / rad
    damped: float = 0.0  # c_3, N m / rad
    damping: float = 1.0  # N m s / rad, parallel to c_3


@dataclass(frozen=True)
class JointTrain:
    """What stands between the motor and the link of one joint; what is None or zero is not there."""

    spring: GearSpring
    damping: float  # N m s / rad, parallel to the spring
    inertia: float  # kg m^2, of the rotor
    motor_lag: float = 0.0  # s
    frictions: tuple[Friction, ...] = ()  # of the motor, added up
    ratio: FourierRatio | None = None
    efficiency: DirectionalEfficiency | None = None
    gap: float = 0.0  # rad, the whole play
    lubricant: float = 0.0  # N m s / rad, beside spring and damper, in the gap too
    soft: SoftBranch | None = None
    hysteresis: DahlHysteresis | None = None


@dataclass(frozen=True)
class TrainTorques:
    """What drive trains do to motors and links, and how their states change."""

    motor: np.ndarray  # N m, (n,), all but the inertia of the rotor
    link: np.ndarray  # N m, (n,)
    state_rate: np.ndarray  # (num_states,)


class DriveTrains:
    """The trains of n joints, evaluated at once.

    The link of a joint turns by q - theta - e against its gear, e being the error of the ratio. This
    deflection bends the spring once the gap is closed, the damper with it, the elements of the hysteresis
    and the soft branch. What they carry acts on the link, and on the motor times 1 + de/dtheta, so that an
    uneven ratio neither takes nor gives energy; efficiency and friction take it from the motor.

    States, n each: torques of the motors (in `torque_unit`) if one of them lags, deflections of the damped
    springs (rad) if there is a soft branch, those of the elements of the hysteresis (rad) if there is one.
    """

    def __init__(self, trains: Sequence[JointTrain]) -> None:
        """Takes the trains in the order of the joints."""
        self.trains, n = tuple(trains), len(trains)
        self.size = n
        self._spring = SpringRow([train.spring for train in trains])
        self._damping = np.array([train.damping for train in trains])
        self.inertia = np.array([train.inertia for train in trains])  # kg m^2, of the rotors
        lag = np.array([train.motor_lag for train in trains])
        self._has_lag = bool(lag.any())
        # An integrator takes the errors of all states for equally important.
        self.torque_unit = _ACCELERATION_UNIT * self.inertia  # N m
        self._half_gap = 0.5 * np.array([train.gap for train in trains])
        self._lubricant = np.array([train.lubricant for train in trains])
        self._has_gap = bool(self._half_gap.any())
        self._frictions = _friction_groups([train.frictions for train in trains])
        self._ratio = _ratio_row([train.ratio for train in trains])
        self._efficiency = None
        if any(train.efficiency for train in trains):
            ideal = DirectionalEfficiency(1.0, 1.0)
            self._efficiency = stacked([train.efficiency or ideal for train in trains])
        self._soft = None
        if any(train.soft for train in trains):
            self._soft = stacked([train.soft or SoftBranch() for train in trains])
        self._hysteresis = _hysteresis_row([train.hysteresis for train in trains])
        elements = 0 if self._hysteresis is None else np.shape(self._hysteresis.width)[-1]
        ends = np.cumsum([n if self._has_lag else 0, n if self._soft else 0, elements * n]).tolist()
        self._places = [slice(a, b) for a, b in zip([0, *ends], ends, strict=False)]
        self._elements, self.num_elements = (n, elements), elements * n
        self.motor_lag = lag  # s, (n,)
        self.num_states = ends[-1]

    def torques(
        self,
        state: np.ndarray,
        motor: tuple[np.ndarray, np.ndarray],
        deflection: tuple[np.ndarray, np.ndarray],
        command: np.ndarray,
    ) -> TrainTorques:
        """The torques at an instant.

        Args:
            state: shape (num_states,).
            motor: positions in rad and velocities in rad/s, shape (n,) each.
            deflection: q - theta in rad and its rate in rad/s, shape (n,) each.
            command: what the motors are told to give in N m, shape (n,).
        """
        n, out = self.size, np.empty(2 * self.size + self.num_states)
        motion = np.concatenate(motor), np.concatenate(deflection)
        self.evaluate(state, *motion, command, np.zeros(n), out)
        return TrainTorques(command - out[:n], out[n : 2 * n], out[2 * n :])

    @cached_property
    def evaluate(self) -> Callable[..., None]:
        """What `torques` is made of, for who asks at every stage of every step: writes in place.

        It takes ``state, motor, deflection, command, viscous, out``, see `robots.drivetrain.train_kernels`.
        Compiled, or read from where it was kept, when it is asked for first.
        """
        kernels = importlib.import_module("robots.drivetrain.train_kernels")
        return partial(kernels.torques, self._table())

    def _table(self) -> TrainTable:
        n, ratio, soft = self.size, self._ratio, self._soft
        waves = np.empty((n, 0, 3))
        if ratio is not None:
            weights = np.asarray(ratio.amplitudes) / np.asarray(ratio.base)[:, None]
            waves = np.stack([weights, ratio.frequencies, ratio.phases], axis=-1)
        branch = SoftBranch() if soft is None else soft
        lubricant = self._lubricant if self._has_gap else np.zeros(n)
        columns = self._damping, self._half_gap, lubricant, branch.soft, branch.damped, branch.damping
        return TrainTable(
            springs=spring_rows([train.spring for train in self.trains]),
            gears=np.stack(np.broadcast_arrays(*columns), axis=1),
            motors=np.stack([self.motor_lag, self.torque_unit, self.inertia], axis=1),
            waves=waves,
            newton_steps=0 if ratio is None else ratio.newton_steps,
            elements=element_table(self._hysteresis, n),
            efficiencies=efficiency_rows(self._efficiency, n),
            frictions=friction_rows([train.frictions for train in self.trains]),
            soft_at=-1 if soft is None else self._places[1].start,
            elements_at=self._places[2].start,
            has_lag=self._has_lag,
            has_efficiency=self._efficiency is not None,
        )

    def at_rest(self, load: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Deflections q - theta in rad, (n,), under loads of the links in N m, (n,), and the states then.

        Elements of the hysteresis are relaxed: where the load came from is not known.
        """
        error, change = np.zeros(self.size), np.zeros(self.size)
        if self._ratio is not None:
            error, change = self._ratio.position_error(theta)
        x = self._static(load)
        state = np.zeros(self.num_states)
        of_motor, of_soft, _ = self._places
        if self._has_lag:
            state[of_motor] = -(1.0 + change) * load / self.torque_unit
        if self._soft is not None:
            state[of_soft] = self._soft.soft / np.maximum(self._soft.soft + self._soft.damped, 1e-300) * x
        return x + error, state

    @property
    def half_gap(self) -> np.ndarray:
        """Half of the play in rad, shape (n,)."""
        return self._half_gap

    def losses(self, load: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """What a motor gives in N m beyond a load in N m and its inertia, at a speed in rad/s; (n,) each.

        Friction that holds is taken for one that changes smoothly with the speed, since at rest it says
        nothing of the torque.
        """
        found = np.zeros(self.size)
        for where, part in self._frictions:
            if isinstance(part, StickSlipFriction):
                v = speed[where]
                found[where] += part.viscous * v + part.coulomb * np.tanh(v / part.stribeck_velocity)
            else:
                found[where] += part.torque(speed[where])
        return found if self._efficiency is None else found + self._efficiency.loss(load, speed)

    def ratio_error(self, theta: np.ndarray) -> np.ndarray:
        """By how much the outputs of the gears are ahead in rad, motors at theta in rad, shape (n,) each."""
        return np.zeros(self.size) if self._ratio is None else self._ratio.position_error(theta)[0]

    def hysteresis(self, states: np.ndarray) -> np.ndarray:
        """What the elements of the hysteresis carry in N m, (n,), at their states in rad, (num_elements,)."""
        if self._hysteresis is None:
            return np.zeros(self.size)
        return self._hysteresis.torque(states.reshape(self._elements))

    def hysteresis_moved(self, states: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The states of these elements after deflections have turned by some rad in one direction, (n,)."""
        if self._hysteresis is None:
            return states
        return self._hysteresis.moved(states.reshape(self._elements), turn).ravel()

    def _static(self, load: np.ndarray) -> np.ndarray:
        springs: GearSpring = self._spring
        if self._soft is not None:
            both = self._soft.soft + self._soft.damped
            series = self._soft.soft * self._soft.damped / np.where(both > 0.0, both, 1.0)
            springs = _Beside(self._spring, series)
        return springs.deflection(load) + np.sign(load) * self._half_gap

    def energy(self, state: np.ndarray, theta: np.ndarray, deflection: np.ndarray) -> float:
        """What springs, soft branches and hysteresis store in J; arguments as of `torques`."""
        x = deflection if self._ratio is None else deflection - self._ratio.position_error(theta)[0]
        beyond = x - np.clip(x, -self._half_gap, self._half_gap)
        total = float(sum(t.spring.energy(y) for t, y in zip(self.trains, beyond, strict=True)))
        _, of_soft, of_elements = self._places
        if self._soft is not None:
            total += float(np.sum(self._soft.soft * np.square(x - state[of_soft]))) / 2.0
            total += float(np.sum(self._soft.damped * np.square(state[of_soft]))) / 2.0
        if self._hysteresis is not None:
            total += float(self._hysteresis.energy(state[of_elements].reshape(self._elements)).sum())
        return total

    def tangents(self, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The steepest that trains are at deflections q - theta: gears in N m / rad, friction in N m s / rad.

        Of what the slopes depend on besides, motion and history, the steepest case is taken.
        """
        beyond = deflection - np.clip(deflection, -self._half_gap, self._half_gap)
        stiffness, friction = self._spring.stiffness(beyond), np.zeros(self.size)
        if self._soft is not None:
            stiffness = stiffness + self._soft.soft
        if self._hysteresis is not None:
            stiffness = stiffness + np.sum(self._hysteresis.stiffness, axis=-1)
        for where, part in self._frictions:
            if isinstance(part, StickSlipFriction):
                friction[where] = self.inertia[where] / part.stopping_time + part.viscous
            else:
                friction[where] = np.abs(part.slope(np.zeros_like(friction[where])))
        return stiffness, friction


@dataclass(frozen=True)
class _Beside(GearSpring):
    """Springs beside linear ones."""

    springs: GearSpring
    linear: np.ndarray  # N m / rad

    @property
    def c_0(self) -> np.ndarray:  # type: ignore[override]
        """Stiffness at rest in N m / rad, that of both."""
        return self.springs.c_0 + self.linear

    def torque(self, deflection: np.ndarray) -> np.ndarray:
        return self.springs.torque(deflection) + self.linear * deflection

    def stiffness(self, deflection: np.ndarray) -> np.ndarray:
        return self.springs.stiffness(deflection) + self.linear

    def scaled(self, factor: float) -> "_Beside":
        """Both, ``factor`` times as stiff."""
        return _Beside(self.springs.scaled(factor), factor * self.linear)


def _friction_groups(parts: Sequence[tuple[Friction, ...]]) -> list[tuple[Any, Friction]]:
    """Joints with frictions of one kind, and these as one; what holds a joint against the rest is last."""
    groups = []
    for kind in get_args(Friction):
        where = [(i, part) for i, of_joint in enumerate(parts) for part in of_joint if type(part) is kind]
        joints = [i for i, _ in where]
        if len(where) == len(parts) and joints == list(range(len(parts))) and kind is not PolynomialFriction:
            groups.append((slice(None), stacked([part for _, part in where])))
        else:
            groups += [(slice(i, i + 1), part) for i, part in where]
    return groups


def _ratio_row(parts: Sequence[FourierRatio | None]) -> FourierRatio | None:
    """All gears as one, series filled up to the same length with terms that do nothing."""
    if not any(parts):
        return None
    even = FourierRatio(1.0)
    rows = [part or even for part in parts]
    longest = max(len(row.amplitudes) for row in rows)

    def filled(name: str, value: float) -> tuple:
        return tuple((*getattr(row, name), *[value] * (longest - len(row.amplitudes))) for row in rows)

    return FourierRatio(
        np.array([row.base for row in rows]),
        np.array(filled("amplitudes", 0.0)),
        np.array(filled("frequencies", 1.0)),
        np.array(filled("phases", 0.0)),
    )


def _hysteresis_row(parts: Sequence[DahlHysteresis | None]) -> DahlHysteresis | None:
    """All hystereses as one, filled up to the same number of elements with some that carry nothing."""
    if not any(parts):
        return None
    most = max(len(part.stiffness) for part in parts if part is not None)
    stiffness, width = np.zeros((len(parts), most)), np.ones((len(parts), most))
    for i, part in enumerate(parts):
        if part is not None:
            stiffness[i, : len(part.stiffness)] = part.stiffness
            width[i, : len(part.width)] = part.width
    return DahlHysteresis(stiffness, width)
