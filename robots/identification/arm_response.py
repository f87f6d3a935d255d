"""How an elastic arm answers to the measured motion of its motors, with the sensitivities of all unknowns.

Each case goes forward by the trapezoidal rule (Newmark with gamma = 1/2, beta = 1/4): Newmark (1959). Gears
with play and hysteresis are solved for by Newton's method in the accelerations of the six gears; derivatives
by the unknowns follow from the same equations: they are those of the steps. The loops are in
`response_kernels`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from robots.description.model import NUM_JOINTS
from robots.identification.arm_along_motion import ArmAlongMotion
from robots.identification.elastic_parameters import (
    PLAY,
    RIPPLE,
    RIPPLES_PER_TURN,
    ArmNumbers,
    ElasticParameters,
)
from robots.identification.motion import BETA, GAMMA, MotionCase, SensorPlace
from robots.threads import side_by_side

_G = slice(0, NUM_JOINTS)  # gears among the sprung joints
_CLOSE = 2  # samples
_UNLOADED = 1e-6  # rad, a gear that its load winds up by less may rest anywhere within its play


@dataclass(frozen=True)
class Response:
    """What sensors show of all cases."""

    readings: np.ndarray  # (m, cases, channels)
    sensitivity: np.ndarray | None  # (m, cases, channels, n), by the unknowns
    moved: list[np.ndarray]  # of each case (samples, 3, e): deflections, their rates and accelerations


@dataclass(frozen=True)
class Grid:
    """How finely a response is worked out: in samples of the cases."""

    steps: int = 1  # of the integration in a sample; the rule errs by (w h)^2 / 12 in a frequency w
    filtered: int = 1  # samples from one value of the sensors' low-pass to the next
    kept: int = 2  # samples from one reading that is compared to the next, a multiple of it


class ArmResponse:
    """A model of all cases; one that ends early shows what it showed last until the longest ends."""

    def __init__(
        self,
        motions: Sequence[ArmAlongMotion],
        cases: Sequence[MotionCase],
        sensors: Sequence[SensorPlace],
        parameters: ElasticParameters,
        gear_ratio: np.ndarray,
        grid: Grid = Grid(),
        rests: np.ndarray | None = None,
    ) -> None:
        """Takes linearised motions.

        Args:
            motions: of the cases, in their order.
            cases: with the same period.
            sensors: whose readings are wanted.
            parameters: the unknowns.
            gear_ratio: of the joints, shape (6,).
            grid: of the integration and of the readings.
            rests: where gears without load begin within their play, -1 to 1, shape (cases, 6); None for its
                middle.
        """
        self._parameters, self._grid = parameters, grid
        self.samples = max(len(case.theta) for case in cases)
        self.kept = np.arange(0, self.samples, grid.kept)  # samples of the readings
        self.step = grid.kept  # samples from one reading to the next
        period = cases[0].period
        self._h = period / grid.steps
        corner = np.pi * period * grid.filtered * np.repeat([sensor.bandwidth for sensor in sensors], 3)
        self._low_pass = np.stack([corner / (1.0 + corner), (1.0 - corner) / (1.0 + corner)])
        turns = RIPPLES_PER_TURN * gear_ratio
        shares = np.zeros((len(cases), NUM_JOINTS)) if rests is None else rests
        each = zip(motions, cases, shares, strict=True)
        self._cases = [CaseOnGrid(motion, case, turns, grid, share) for motion, case, share in each]
        self._base = [_filtered(m.readings, self._low_pass, grid) for m in motions]
        self._columns = _columns(parameters)

    def set_rests(self, rests: np.ndarray) -> None:
        """Where gears without load begin within their play from now on, (cases, 6)."""
        for case, rest in zip(self._cases, rests, strict=True):
            case.rest = rest.copy()

    def unloaded(self, p: np.ndarray) -> np.ndarray:
        """Which gears carry nothing before a case begins, (cases, 6) bool."""
        numbers = self._parameters.numbers(p)
        springs = np.stack([numbers.stiffness, numbers.stiffness * numbers.time])
        gears = gears_of(numbers)
        return np.array([case.at_rest(springs, gears, numbers.ripple)[1] == 0.0 for case in self._cases])

    def __call__(self, p: np.ndarray, sensitivity: bool = True) -> Response:
        """Goes through all cases with unknowns p, shape (n,)."""
        from robots.identification import response_kernels  # imports numba

        numbers = self._parameters.numbers(p)
        springs = np.stack([numbers.stiffness, numbers.stiffness * numbers.time])
        gears = gears_of(numbers)
        n = len(self._parameters) if sensitivity else 0
        size = len(self.kept), len(self._cases), self._low_pass.shape[1]
        readings, derived = np.empty(size), np.zeros((*size, n))
        grid, e = self._grid, springs.shape[1]
        steps = self._h, grid.filtered * grid.steps, grid.kept * grid.steps, grid.steps

        def go_through(i: int, case: "CaseOnGrid", base: np.ndarray) -> np.ndarray:
            start = case.start(springs, gears, numbers.ripple, self._columns, n)
            m = len(base)
            shown, by = np.empty((m, size[2])), np.empty((m, size[2], n))
            moved = np.empty((case.samples, 3 * e))
            response_kernels.go_through(
                steps,
                case.posture(springs),
                case.course(numbers.ripple),
                springs,
                gears,
                self._columns,
                start,
                self._low_pass,
                moved,
                shown,
                by,
            )
            readings[:m, i], derived[:m, i] = shown + base, by
            readings[m:, i] = readings[m - 1, i]
            return moved.reshape(case.samples, 3, e)

        moved = side_by_side(go_through, range(len(self._cases)), self._cases, self._base)
        return Response(readings, derived if sensitivity else None, moved)


class CaseOnGrid:
    """One case on the grid of the integration: what does not depend on the unknowns."""

    def __init__(
        self, motion: ArmAlongMotion, case: MotionCase, turns: np.ndarray, grid: Grid, rest: np.ndarray
    ) -> None:
        self.rest = rest
        self._motion, self.samples = motion, len(case.theta)
        self._load = _refined(motion.load, grid.steps)
        turned = turns * _refined(case.theta, grid.steps)
        speed = turns * _refined(case.rate, grid.steps)
        sine, cosine = np.sin(turned), np.cos(turned)
        # (steps, 2, 2, 6): turn and rate by a unit of sine and cosine
        self._waves = np.stack([sine, cosine, cosine * speed, -sine * speed], 1).reshape(-1, 2, 2, NUM_JOINTS)
        self._knots = motion.knots * grid.steps
        self._close = _close(motion.knots) * grid.steps
        h = case.period / grid.steps
        whole = motion.mass + GAMMA * h * motion.coriolis + BETA * h * h * motion.stiffness
        self._whole, self._h = _between(self._knots, whole, self._close), h
        self._held = np.concatenate([motion.stiffness, motion.coriolis], axis=2)
        self._levers = np.concatenate([motion.by_turn, motion.by_speed, motion.by_acceleration], axis=2)
        self._inverted: tuple[np.ndarray, np.ndarray] | None = None  # of which springs

    def posture(self, springs: np.ndarray) -> tuple[np.ndarray, ...]:
        """What changes with the posture, at knots; see `response_kernels.go_through`."""
        if self._inverted is None or not np.array_equal(self._inverted[0], springs):
            own = GAMMA * self._h * springs[1] + BETA * self._h**2 * springs[0]
            self._inverted = springs, np.linalg.inv(self._whole + np.diag(own))
        rest = self._motion.rest[:, None]
        return self._knots, self._held, rest, self._levers, self._close, self._inverted[1]

    def course(self, ripple: np.ndarray) -> tuple[np.ndarray, ...]:
        """What changes from step to step with ripples of the gears in rad, (2, 6)."""
        return self._load, (self._waves * ripple).sum(axis=2), self._waves

    def at_rest(
        self, springs: np.ndarray, gears: np.ndarray, ripple: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Deflections in rad under the first load, (e,), signs of the gears' loads, places in the play."""
        load, K, rest = self._load[0], self._motion.stiffness[0], self._motion.rest[0]
        offset = (self._waves[0, 0] * ripple).sum(axis=0)
        x, sign, side = np.zeros_like(load), np.zeros(NUM_JOINTS), self.rest
        for _ in range(6):
            carried = -load - K @ (x - rest)
            x = np.divide(carried, springs[0], out=np.zeros_like(x), where=springs[0] > 0.0)
            sign = np.where(np.abs(x[_G]) < _UNLOADED, 0.0, np.sign(x[_G]))
            side = np.where(sign == 0.0, self.rest, sign)
            x[_G] = carried[_G] / gears[:, 0] + side * gears[:, 2] + offset
        return x, sign, side

    def start(
        self,
        springs: np.ndarray,
        gears: np.ndarray,
        ripple: np.ndarray,
        columns: tuple[np.ndarray, np.ndarray, int, int],
        n: int,
    ) -> tuple[np.ndarray, np.ndarray]:
        """At rest under the first load: deflections (e,), their derivatives with those of gears' turns."""
        x, _, side = self.at_rest(springs, gears, ripple)
        if not n:
            return x, np.zeros((len(x) + NUM_JOINTS, 0))
        of_joint, of_gear, lubricant, _ = columns
        waves = self._waves[0, 0]
        turn = x[_G] - (waves * ripple).sum(axis=0)
        carried = springs[0] * x
        carried[_G] = gears[:, 0] * (turn - side * gears[:, 2])
        explicit, by_offset = np.zeros((len(x), n)), np.zeros((NUM_JOINTS, n))
        explicit[np.arange(len(x)), of_joint[0]] = carried
        rows = np.arange(NUM_JOINTS)
        if lubricant >= 0:
            explicit[rows, of_gear[0]] = -0.5 * PLAY * gears[:, 0] * side
        for wave, column in zip(waves, of_gear[2:], strict=True):
            turning = column >= 0
            by_offset[rows[turning], column[turning]] = RIPPLE * wave[turning]
        explicit[_G] -= gears[:, :1] * by_offset
        by_x = -np.linalg.solve(self._motion.stiffness[0] + np.diag(springs[0]), explicit)
        return x, np.concatenate([by_x, by_x[_G] - by_offset])


def _columns(parameters: ElasticParameters) -> tuple[np.ndarray, np.ndarray, int, int]:
    """Which unknown stands in which column; see `response_kernels.go_through`."""
    springs, times = parameters.of_kind("stiffness"), parameters.of_kind("time")
    of_joint = np.stack([springs[parameters.belongs.argmax(1)], times[parameters.grouped.argmax(1)]])
    of_gear, others = np.full((4, NUM_JOINTS), -1), (-1, -1)
    if parameters.of_kind("play").size:
        of_gear[0], of_gear[1] = parameters.of_kind("play"), parameters.of_kind("hysteresis")
        others = int(parameters.of_kind("lubricant")[0]), int(parameters.of_kind("width")[0])
    if parameters.turning:
        of_gear[2:, list(parameters.turning)] = parameters.of_kind("ripple").reshape(2, -1)
    return of_joint, of_gear, *others


def gears_of(numbers: ArmNumbers) -> np.ndarray:
    """Of six gears what `response_kernels.gear_step` takes, (6, 6)."""
    spring = numbers.stiffness[_G]
    damper = spring * numbers.time[_G]
    oil = np.where(numbers.play > 0.0, numbers.lubricant, 0.0) * damper
    width = np.full(NUM_JOINTS, numbers.width)
    return np.stack([spring, damper, 0.5 * numbers.play, oil, numbers.hysteresis * spring, width], axis=1)


def _close(knots: np.ndarray) -> np.ndarray:
    """Knots with some more between those of the motion: samples at which the inverse of the mass is known.

    The hand is light and turns beside a heavy arm: between knots that are far apart a straight line from
    inverse to inverse would make the arm lighter by some hundredths. From mass to mass it does not.
    """
    return np.union1d(knots, np.arange(knots[1], knots[-2], _CLOSE))


def _between(knots: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Linearly between matrices (k, ...) that are known at knots (k,)."""
    knot = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    share = ((at - knots[knot]) / np.diff(knots)[knot])[:, None, None]
    return (1.0 - share) * values[knot] + share * values[knot + 1]


def _refined(values: np.ndarray, steps: int) -> np.ndarray:
    """At the steps between samples, by a cubic spline, contiguous."""
    if steps == 1:
        return np.ascontiguousarray(values)
    samples = np.arange(len(values))
    return CubicSpline(samples, values)(np.arange((len(values) - 1) * steps + 1) / steps)


def _filtered(readings: np.ndarray, low_pass: np.ndarray, grid: Grid) -> np.ndarray:
    """Readings (samples, channels) through the low-pass of the sensors, those that are kept."""
    values = readings[:: grid.filtered]
    found = np.empty_like(values)
    for channel, (new, old) in enumerate(low_pass.T):
        rest = values[0, channel]
        passed, _ = lfilter([new, new], [1.0, -old], values[:, channel] - rest, zi=np.zeros(1))
        found[:, channel] = rest + passed
    return found[:: grid.kept // grid.filtered]
