"""How an elastic arm answers to the measured motion of its motors, with the sensitivities of all unknowns.

All cases go forward together, one step of the trapezoidal rule (Newmark with gamma = 1/2, beta = 1/4) at a
time: Newmark (1959). Gears with play and hysteresis are solved for by Newton's method in the accelerations
of the six gears; derivatives by the unknowns follow from the same equations: they are those of the steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS
from robots.identification.arm_along_motion import ArmAlongMotion
from robots.identification.elastic_parameters import PLAY, RIPPLE, RIPPLES_PER_TURN, ElasticParameters
from robots.identification.gear_step import Gears, GearStep
from robots.identification.motion import MotionCase, SensorPlace

_GAMMA, _BETA = 0.5, 0.25
_NEWTON_STEPS = 6
_SOLVED = 1e-9  # of the largest acceleration of a gear
_EVERY = 2  # steps between samples of the readings
_G = slice(0, NUM_JOINTS)  # gears among the sprung joints


@dataclass(frozen=True)
class Response:
    """What sensors show of all cases."""

    readings: np.ndarray  # (m, cases, channels)
    sensitivity: np.ndarray | None  # (m, cases, channels, n), by the unknowns


class ArmResponse:
    """A model of all cases at once; cases that end early stand still until the longest ends."""

    def __init__(
        self,
        motions: Sequence[ArmAlongMotion],
        cases: Sequence[MotionCase],
        sensors: Sequence[SensorPlace],
        parameters: ElasticParameters,
        gear_ratio: np.ndarray,
    ) -> None:
        """Takes linearised motions.

        Args:
            motions: of the cases, in their order.
            cases: with the same period.
            sensors: whose readings are wanted.
            parameters: the unknowns.
            gear_ratio: of the joints, shape (6,).
        """
        self._motions, self._parameters = motions, parameters
        self._h = cases[0].period
        self.samples = max(len(case.theta) for case in cases)
        self.load = _padded([motion.load for motion in motions], self.samples)
        self.base = _padded([motion.readings for motion in motions], self.samples)
        theta = _padded([case.theta for case in cases], self.samples)
        rate = _padded([case.rate for case in cases], self.samples, at_rest=True)
        turns = RIPPLES_PER_TURN * gear_ratio
        wave = np.stack([np.sin(turns * theta), np.cos(turns * theta)])
        # (2, samples, cases, 6): what a unit of ripple adds to the turn of a gear, and to its rate
        self._ripple = wave
        self._ripple_rate = np.stack([wave[1], -wave[0]]) * turns * rate
        corner = np.pi * self._h * _EVERY * np.repeat([sensor.bandwidth for sensor in sensors], 3)
        self._new, self._old = corner / (1.0 + corner), (1.0 - corner) / (1.0 + corner)
        self.kept = np.arange(0, self.samples, _EVERY)  # samples of the readings
        self._columns = _Columns(parameters)

    def __call__(self, p: np.ndarray, sensitivity: bool = True) -> Response:
        """Goes through all cases with unknowns p, shape (n,)."""
        run = _Run(self._parameters, p, self._motions, self._h, self._columns if sensitivity else None)
        shown, derived = [], []
        ripple = self._parameters.numbers(p).ripple[:, None]
        last = run.start(self.load[0], self._offset(ripple, 0)[0], self._waves(0)[0])
        for sample in range(self.samples):
            if sample:
                offset, offset_rate = self._offset(ripple, sample)
                last = run.step(sample, self.load[sample], offset, offset_rate, self._waves(sample))
            if sample % _EVERY == 0:
                reading, by = run.readings(last)
                shown.append(reading + self.base[sample])
                derived.append(by)
        readings = self._filtered(np.array(shown), self._new, self._old)
        if not sensitivity:
            return Response(readings, None)
        return Response(readings, self._filtered(np.array(derived), self._new[:, None], self._old[:, None]))

    def _offset(self, size: np.ndarray, sample: int) -> tuple[np.ndarray, np.ndarray]:
        """What the ripple turns the gears by and how fast, (cases, 6) each."""
        return (size * self._ripple[:, sample]).sum(0), (size * self._ripple_rate[:, sample]).sum(0)

    def _waves(self, sample: int) -> tuple[np.ndarray, np.ndarray]:
        return self._ripple[:, sample], self._ripple_rate[:, sample]

    @staticmethod
    def _filtered(values: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
        """Through the low-pass of the sensors, in place; they have been at rest for long."""
        before = values[0].copy()
        for k in range(1, len(values)):
            now = values[k].copy()
            values[k] = old * values[k - 1] + new * (now + before)
            before = now
        return values


@dataclass(frozen=True)
class _State:
    """Of all cases at a sample; sensitivities have the unknowns last."""

    x: np.ndarray  # (cases, e) rad
    v: np.ndarray
    a: np.ndarray
    turn: np.ndarray  # (cases, 6) rad, of the gears, less their ripple
    z: np.ndarray  # (cases, 6) rad, hysteresis
    place: tuple[np.ndarray, np.ndarray]  # knot and share of the way to the next one, of each case
    by: tuple[np.ndarray, ...] | None  # of x, v, a, turn, z


class _Columns:
    """Which unknown stands in which column, by kind."""

    def __init__(self, parameters: ElasticParameters) -> None:
        self.size = len(parameters)
        self.of = {kind: parameters.of_kind(kind) for kind in dict.fromkeys(parameters.kinds)}
        self.belongs, self.grouped = parameters.belongs, parameters.grouped
        self.turning = list(parameters.turning)

    def ripple(self, waves: np.ndarray) -> np.ndarray:
        """d(ripple of the gears) / d(unknowns), (cases, 6, n); waves (2, cases, 6)."""
        found = np.zeros((*waves.shape[1:], self.size))
        if self.turning:
            for wave, places in zip(waves, self.of["ripple"].reshape(2, -1), strict=True):
                found[:, self.turning, places] = RIPPLE * wave[:, self.turning]
        return found

    def torque(self, gears: Gears, step: GearStep, state: _State, new: tuple[np.ndarray, ...]) -> np.ndarray:
        """d(springs and dampers) / d(unknowns) with the motion as it is, (cases, e, n).

        Args:
            gears, step: of the six gears.
            state: at the beginning of the step.
            new: springs and dampers of all sprung joints in N m, positive against them, (cases, e) each.
        """
        spring, damper = (each.copy() for each in new)
        spring[:, _G] = step.torque
        damper[:, _G] = step.damped + step.oiled
        found = np.zeros((*spring.shape, self.size))
        found[..., self.of["stiffness"]] = spring[..., None] * self.belongs
        found[..., self.of["time"]] = damper[..., None] * self.grouped
        if "play" in self.of:
            self._add_gear_parts(found, gears, step, state)
        return found

    def _add_gear_parts(self, found: np.ndarray, gears: Gears, step: GearStep, state: _State) -> None:
        assert state.by is not None
        rows = range(NUM_JOINTS)
        side = np.sign(step.elastic)
        found[:, rows, self.of["play"]] += -0.5 * PLAY * gears.c * step.is_out * side
        found[:, _G, self.of["lubricant"][0]] += step.oiled
        found[:, rows, self.of["hysteresis"]] += gears.c * step.hysteresis
        found[:, _G] += gears.held[:, None] * self.state(gears, step, state)

    def state(self, gears: Gears, step: GearStep, state: _State) -> np.ndarray:
        """d(hysteresis) / d(unknowns) but for what the deflection at the end does, (cases, 6, n)."""
        assert state.by is not None
        by_turn, by_z = state.by[3], state.by[4]
        found = step.kept[..., None] * by_z - step.state_by_turn[..., None] * by_turn
        if "width" in self.of:
            fall = step.kept
            moved = -gears.width * np.log(np.maximum(fall, 1e-300))
            direction = np.sign(step.hysteresis - state.z)
            end = direction * gears.width
            slope = direction * (1.0 - fall) + (state.z - end) * fall * moved / gears.width**2
            found[..., self.of["width"][0]] += gears.width * slope
        return found


class _Run:
    """One pass through all cases."""

    def __init__(
        self,
        parameters: ElasticParameters,
        p: np.ndarray,
        motions: Sequence[ArmAlongMotion],
        h: float,
        columns: _Columns | None,
    ) -> None:
        numbers = parameters.numbers(p)
        self._h, self._columns = h, columns
        self._k, self._d = numbers.stiffness, numbers.stiffness * numbers.time
        self._gears = Gears(numbers)
        self._knots = [motion.knots for motion in motions]
        most = max(len(motion.knots) for motion in motions)
        names = ("coriolis", "stiffness", "by_turn", "by_speed", "by_acceleration", "rest")
        self._of = {name: _stacked([getattr(m, name) for m in motions], most) for name in names}
        mass = _stacked([motion.mass for motion in motions], most)
        whole = (
            mass
            + _GAMMA * h * (self._of["coriolis"] + np.diag(self._d))
            + _BETA * h * h * (self._of["stiffness"] + np.diag(self._k))
        )
        self._of["inverse"] = np.linalg.inv(whole)
        self._all = np.arange(len(motions))
        self._state: _State

    def _place(self, sample: int) -> tuple[np.ndarray, np.ndarray]:
        knot, share = np.empty(len(self._knots), dtype=int), np.empty(len(self._knots))
        for i, knots in enumerate(self._knots):
            k = min(int(np.searchsorted(knots, sample, side="right")) - 1, len(knots) - 2)
            knot[i] = k
            share[i] = min((sample - knots[k]) / (knots[k + 1] - knots[k]), 1.0)
        return knot, share

    def _at(self, name: str, place: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        values, (knot, share) = self._of[name], place
        weight = share.reshape(-1, *[1] * (values.ndim - 2))
        return (1.0 - weight) * values[self._all, knot] + weight * values[self._all, knot + 1]

    def start(self, load: np.ndarray, offset: np.ndarray, waves: np.ndarray) -> _State:
        """Everything at rest under the first load, (cases, e), with the ripple that gears have there."""
        place = self._place(0)
        K, rest = self._at("stiffness", place), self._at("rest", place)
        x = np.zeros_like(load)
        for _ in range(6):
            carried = -load - np.einsum("cij,cj->ci", K, x - rest)
            x = carried / self._k
            x[:, _G] = self._gears.at_rest(carried[:, _G]) + offset
        turn = x[:, _G] - offset
        none = np.zeros_like(x)
        by = None
        if self._columns is not None:
            by = self._start_sensitivity(x, turn, K, waves)
        self._state = _State(x, none, none, turn, np.zeros_like(turn), place, by)
        return self._state

    def _start_sensitivity(
        self, x: np.ndarray, turn: np.ndarray, K: np.ndarray, waves: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        columns = self._columns
        assert columns is not None
        cases, e = x.shape
        explicit = np.zeros((cases, e, columns.size))
        carried = self._k * x
        beyond = turn - np.clip(turn, -self._gears.half_gap, self._gears.half_gap)
        carried[:, _G] = self._gears.c * beyond
        explicit[..., columns.of["stiffness"]] = carried[..., None] * columns.belongs
        if "play" in columns.of:
            rows = range(NUM_JOINTS)
            explicit[:, rows, columns.of["play"]] = -0.5 * PLAY * self._gears.c * np.sign(beyond)
        by_offset = columns.ripple(waves)
        explicit[:, _G] -= self._gears.c[:, None] * by_offset
        by_x = -np.linalg.solve(K + np.diag(self._k), explicit)
        none = np.zeros_like(by_x)
        return by_x, none, none, by_x[:, _G] - by_offset, np.zeros_like(by_offset)

    def step(
        self,
        sample: int,
        load: np.ndarray,
        offset: np.ndarray,
        offset_rate: np.ndarray,
        waves: tuple[np.ndarray, np.ndarray],
    ) -> _State:
        """From the last sample to this one."""
        s, h, place = self._state, self._h, self._place(sample)
        S, G, K = (self._at(name, place) for name in ("inverse", "coriolis", "stiffness"))
        x = s.x + h * s.v + (0.5 - _BETA) * h * h * s.a
        v = s.v + (1.0 - _GAMMA) * h * s.a
        shifted = (x - self._at("rest", place))[..., None]
        rhs = -load - v * self._d - x * self._k - (G @ v[..., None] + K @ shifted)[..., 0]
        free = (S @ rhs[..., None])[..., 0]
        S_g = S[:, :, _G]
        a_g, step = self._gear_accelerations(
            s, (x[:, _G], v[:, _G]), free[:, _G], S_g[:, _G], (offset, offset_rate)
        )
        c, d = self._k[_G], self._d[_G]
        extra = step.torque - c * (x[:, _G] + _BETA * h * h * a_g) - d * (v[:, _G] + _GAMMA * h * a_g)
        a = free - (S_g @ extra[..., None])[..., 0]
        new_x, new_v = x + _BETA * h * h * a, v + _GAMMA * h * a
        by = None
        if self._columns is not None:
            by = self._sensitivity(s, step, (S, G, K), (new_x, new_v), waves)
        turn = new_x[:, _G] - offset
        self._state = _State(new_x, new_v, a, turn, step.hysteresis, place, by)
        return self._state

    def _gear_accelerations(
        self,
        s: _State,
        predicted: tuple[np.ndarray, np.ndarray],
        free: np.ndarray,
        S: np.ndarray,
        ripple: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, GearStep]:
        """Solves for the accelerations of the gears, (cases, 6), and what these then carry."""
        h, gears = self._h, self._gears
        (x, v), (offset, offset_rate) = predicted, ripple
        c, d = self._k[_G], self._d[_G]
        a = s.a[:, _G]
        for _ in range(_NEWTON_STEPS):
            turn, rate = x + _BETA * h * h * a, v + _GAMMA * h * a
            step = gears.step(s.turn, s.z, turn - offset, rate - offset_rate)
            lacking = a - free + (S @ (step.torque - c * turn - d * rate)[..., None])[..., 0]
            if np.abs(lacking).max() < _SOLVED * max(np.abs(a).max(), 1.0):
                break
            slope = (step.by_turn - c) * (_BETA * h * h) + (step.by_rate - d) * (_GAMMA * h)
            J = np.eye(NUM_JOINTS) + S * slope[:, None, :]
            a = a - np.linalg.solve(J, lacking[..., None])[..., 0]
        return a, step

    def _sensitivity(
        self,
        s: _State,
        step: GearStep,
        matrices: tuple[np.ndarray, np.ndarray, np.ndarray],
        new: tuple[np.ndarray, np.ndarray],
        waves: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, ...]:
        columns, h, gears = self._columns, self._h, self._gears
        assert columns is not None
        assert s.by is not None
        S, G, K = matrices
        by_x, by_v, by_a, _, _ = s.by
        x = by_x + h * by_v + (0.5 - _BETA) * h * h * by_a
        v = by_v + (1.0 - _GAMMA) * h * by_a
        springs = new[0] * self._k, new[1] * self._d
        rhs = -(G @ v) - K @ x - self._k[:, None] * x - self._d[:, None] * v
        rhs -= columns.torque(gears, step, s, springs)
        by_offset, by_offset_rate = (columns.ripple(wave) for wave in waves)
        by_turn, by_rate = step.by_turn[..., None], step.by_rate[..., None]
        beyond_turn, beyond_rate = by_turn - self._k[_G, None], by_rate - self._d[_G, None]
        rhs[:, _G] -= beyond_turn * x[:, _G] + beyond_rate * v[:, _G]
        rhs[:, _G] += by_turn * by_offset + by_rate * by_offset_rate
        free = S @ rhs
        slope = (beyond_turn * (_BETA * h * h) + beyond_rate * (_GAMMA * h))[..., 0]
        S_g = S[:, :, _G]
        of_gears = np.linalg.solve(np.eye(NUM_JOINTS) + S_g[:, _G] * slope[:, None, :], free[:, _G])
        a = free - S_g @ (slope[..., None] * of_gears)
        x, v = x + _BETA * h * h * a, v + _GAMMA * h * a
        turn = x[:, _G] - by_offset
        state = step.state_by_turn[..., None] * turn + columns.state(gears, step, s)
        return x, v, a, turn, state

    def readings(self, state: _State) -> tuple[np.ndarray, np.ndarray | None]:
        """What yielding adds to the readings, (cases, channels), and its derivatives, (..., n)."""
        names = ("by_turn", "by_speed", "by_acceleration")
        matrices = [self._at(name, state.place) for name in names]
        moved = (state.x - self._at("rest", state.place), state.v, state.a)
        by_turn, by_speed, by_acceleration = matrices
        x, v, a = (each[..., None] for each in moved)
        shown = (by_turn @ x + by_speed @ v + by_acceleration @ a)[..., 0]
        if state.by is None:
            return shown, None
        x, v, a = state.by[:3]
        return shown, by_turn @ x + by_speed @ v + by_acceleration @ a


def _padded(parts: Sequence[np.ndarray], samples: int, at_rest: bool = False) -> np.ndarray:
    """Cases side by side, (samples, cases, ...); what ends early keeps its last value or rests."""
    found = np.empty((samples, len(parts), *parts[0].shape[1:]))
    for i, part in enumerate(parts):
        found[: len(part), i] = part
        found[len(part) :, i] = 0.0 if at_rest else part[-1]
    return found


def _stacked(parts: Sequence[np.ndarray], most: int) -> np.ndarray:
    """Knots of cases side by side, (cases, most, ...), the last one repeated."""
    return np.array(
        [np.concatenate([part, np.repeat(part[-1:], most - len(part), axis=0)]) for part in parts]
    )
