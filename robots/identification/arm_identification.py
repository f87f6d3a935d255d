"""From recorded motions to springs and dampers: times aligned, axes checked, unknowns found in stages."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.description.variation import varied
from robots.identification.arm_along_motion import ArmAlongMotion, ElasticArm
from robots.identification.arm_fit import ArmFit, ArmProblem
from robots.identification.arm_response import Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.first_stage import (
    COARSE,
    CONVERGED,
    NEAR,
    arm_problem,
    few,
    moving,
    sensor_floor,
    solve_from_afar,
)
from robots.identification.motion import MotionCase, SensorPlace
from robots.identification.recording import (
    RecordedCase,
    check_axes,
    check_excitation,
    check_gravity,
    check_range,
    check_sizes,
    check_speeds,
    lag_of,
)

# Whether few motions alone, and how many steps; between rounds times, rests and equations become better.
_ROUNDS = ((True, 8), (False, 5), (False, 5))
_LAST_STEPS = 30
_PHASES = 4  # of a motion
_PHASE = 0.1  # s, of the ringing
_PLACES = (-1.0, -0.5, 0.0, 0.5, 1.0)  # within the play of a gear, tried
# At the end the rule errs by a two-hundredth in a frequency of 80 Hz; the first stages need less.
_FINE = Grid(2, 1, 4)

Progress = Callable[[float], None]


@dataclass(frozen=True)
class ArmIdentification:
    """What was found, and what it was found from."""

    arm: ElasticArm
    cases: list[MotionCase]  # on the robot's time axis
    sensors: list[SensorPlace]
    lags: np.ndarray  # (cases,) s, by which the stamps of the sensors were ahead
    fit: ArmFit
    times: np.ndarray  # (m,) s, of the readings that were compared
    measured: np.ndarray  # (m, cases, channels), NaN where there is none
    before: np.ndarray  # the same as the first beliefs have it
    after: np.ndarray  # and as the unknowns that were found have it
    payloads: list[float]  # of the cases in kg


class _Arms:
    """One robot with the payloads of all motions."""

    def __init__(self, robot: RobotModel, payload: float, sensors: list[SensorPlace]) -> None:
        self._robot, self._payload, self._sensors = robot, payload, sensors
        self._known: dict[float, ElasticArm] = {}

    def carrying(self, payload: float | None = None) -> ElasticArm:
        """With a payload in kg; None for that of most motions."""
        mass = self._payload if payload is None else payload
        if mass not in self._known:
            self._known[mass] = ElasticArm(self._robot, mass, self._sensors)
        return self._known[mass]


class _Data:
    """Cases with their linearised motions; times and offsets of the sensors move as the model gets better."""

    def __init__(
        self,
        arms: "_Arms",
        recorded: Sequence[RecordedCase],
        sensors: list[SensorPlace],
        progress: Progress,
    ) -> None:
        self.recorded, self.sensors = recorded, sensors
        self._arms = [arms.carrying(case.payload) for case in recorded]
        self.motions: list[ArmAlongMotion] = []
        for case, arm in zip(recorded, self._arms, strict=True):
            self.motions.append(arm.along(case.at_lag(0.0)))
            progress(len(self.motions) / len(recorded))
        self.lags = np.zeros(len(recorded))
        self.rests = np.zeros((len(recorded), NUM_JOINTS))  # within the play, see `ArmResponse`
        self.cases: list[MotionCase] = []
        self._offsets: list[np.ndarray] = []  # of the sensors at rest, (sensors, 3)

    @property
    def rigid(self) -> list[np.ndarray]:
        """What sensors show on an arm that yields but does not vibrate, (n, sensors, 3) of each case."""
        return [motion.readings.reshape(len(motion.readings), -1, 3) for motion in self.motions]

    def align(self, modelled: Sequence[np.ndarray]) -> None:
        """Brings the sensors to the robot's time, and takes their bias from the rest before the motion.

        Args:
            modelled: what sensors should show at the samples of the cases, (n, sensors, 3) each.
        """
        self.cases, self._offsets = [], []
        for i, (case, shown) in enumerate(zip(self.recorded, modelled, strict=True)):
            self.lags[i] = lag_of(case, shown, self.sensors, float(self.lags[i]))
            aligned = case.at_lag(float(self.lags[i]))
            resting = _resting(aligned)
            bias = np.nanmean(aligned.readings[resting] - shown[resting], axis=0)
            self._offsets.append(bias)
            self.cases.append(replace(aligned, readings=aligned.readings - bias))

    def shift(self, chosen: Sequence[int], samples: np.ndarray) -> None:
        """Moves the sensors of some cases in time, by samples of the robot."""
        for i, by in zip(chosen, samples, strict=True):
            self.lags[i] += float(by) * self.recorded[i].period
            offset = self._offsets[i]
            aligned = self.recorded[i].at_lag(float(self.lags[i]))
            self.cases[i] = replace(aligned, readings=aligned.readings - offset)

    def problem(
        self,
        parameters: ElasticParameters,
        ratio: np.ndarray,
        chosen: Sequence[int],
        grid: Grid = COARSE,
        horizon: float = np.inf,
    ) -> ArmProblem:
        """Of some cases, up to a time in s after their motions."""
        return arm_problem(
            [self.motions[i] for i in chosen],
            [self.cases[i] for i in chosen],
            self.sensors,
            parameters,
            ratio,
            grid,
            self.rests[list(chosen)],
            horizon,
        )

    def bring_near(
        self, parameters: ElasticParameters, ratio: np.ndarray, p: np.ndarray, chosen: Sequence[int]
    ) -> None:
        """Makes equations of some cases those about the arm as it yields and rings with unknowns p."""
        moved = self.problem(parameters, ratio, chosen, Grid()).moved(p)
        for i, each in zip(chosen, moved, strict=True):
            self.motions[i] = self._arms[i].about(self.cases[i], self.motions[i], each)

    def find_rests(
        self, parameters: ElasticParameters, ratio: np.ndarray, p: np.ndarray, spread: np.ndarray
    ) -> int:
        """Finds where gears without load begin within their play: joint by joint what fits a case best.

        Returns:
            How many evaluations it took.
        """
        problem = self.problem(parameters, ratio, range(len(self.recorded)))
        free, best = problem.response.unloaded(p), problem.cost(p, spread)
        for joint in np.flatnonzero(free.any(axis=0)):
            kept = self.rests[:, joint].copy()
            for place in _PLACES:
                tried = np.where(free[:, joint], place, kept)
                if np.array_equal(tried, kept):
                    continue
                self.rests[:, joint] = tried
                problem.set_rests(self.rests)
                cost = problem.cost(p, spread)
                better = cost < best
                best = np.where(better, cost, best)
                kept = np.where(better & free[:, joint], place, kept)
            self.rests[:, joint] = kept
        return problem.evaluations

    def align_to(self, parameters: ElasticParameters, ratio: np.ndarray, p: np.ndarray) -> int:
        """Aligns all cases to what unknowns p make of them; returns how many evaluations that took."""
        problem = self.problem(parameters, ratio, range(len(self.recorded)), Grid())
        shown, kept = problem.readings(p), problem.response.kept
        found = []
        for column, case in enumerate(self.recorded):
            n = len(case.time)
            samples = np.arange(n)
            flat = np.stack([np.interp(samples, kept, each) for each in shown[:, column].T], axis=1)
            found.append(flat.reshape(n, -1, 3))
        self.align(found)
        return problem.evaluations


def _phases(cases: Sequence[MotionCase], kept: np.ndarray) -> np.ndarray:
    """To which part of a motion or of the ringing after it readings belong, (m, cases); -1 before it."""
    found = np.empty((len(kept), len(cases)), dtype=int)
    for column, case in enumerate(cases):
        begin, end = moving(case)
        within = np.floor(_PHASES * (kept - begin) / (end - begin))
        after = _PHASES + np.floor((kept - end) * case.period / _PHASE)
        found[:, column] = np.where(kept < end, np.maximum(within, -1), after)
    return found


def _resting(case: MotionCase) -> np.ndarray:
    """Samples before the motion at which the sensors were read, (n,) bool."""
    begins, _ = moving(case)
    resting = np.asarray(np.isfinite(case.readings).all((1, 2)))
    resting[max(begins, 1) :] = False
    if not resting.any():
        resting[:] = False
        resting[int(np.argmax(np.isfinite(case.readings).all((1, 2))))] = True
    return resting


def _turning(cases: Sequence[MotionCase], ratio: np.ndarray) -> list[int]:
    """Joints whose motors make a turn or more in one of the cases."""
    turns = np.max([np.ptp(case.theta, axis=0) for case in cases], axis=0) * np.abs(ratio) / (2.0 * np.pi)
    return np.flatnonzero(turns >= 1.0).tolist()


def identify_arm(
    robot: RobotModel,
    payload: float,
    recorded: Sequence[RecordedCase],
    sensors: list[SensorPlace],
    gear_parts: bool = True,
    progress: Progress | None = None,
) -> ArmIdentification:
    """Finds springs and dampers of gears, bearings and beams.

    Args:
        robot: as it is believed to be; its springs and dampers are the start.
        payload: mass at the flange in kg, where a motion says nothing else.
        recorded: the motions, each from rest, all with the same period.
        sensors: in the order of the readings.
        gear_parts: whether gears may have play, hysteresis and ripple.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        RecordingError: if the recording cannot be used; the message says why.
        ValueError: if a sensor sits on a body that the robot does not have.
    """
    tell = progress or (lambda share: None)
    check_range(recorded, robot.lower, robot.upper)
    check_speeds(recorded)
    arms = _Arms(robot, payload, sensors)
    arm = arms.carrying()
    floor, some = sensor_floor(sensors), few(len(recorded))
    everything = list(range(len(recorded)))
    first = _Data(arms, [recorded[i] for i in some], sensors, lambda share: tell(0.1 * share))
    as_stamped = [case.at_lag(0.0) for case in first.recorded]
    check_excitation(as_stamped, first.rigid, sensors)
    check_gravity(as_stamped, first.rigid, sensors)
    first.align(first.rigid)
    check_sizes(first.cases, first.rigid, sensors)
    check_axes(first.cases, first.rigid, sensors)

    # Linear gears first: where the springs are far off, play only makes valleys to be lost in.
    plain = ElasticParameters(arm, gear_parts=False)
    problems: list[ArmProblem] = []

    def until(horizon: float) -> ArmProblem:
        problems.append(first.problem(plain, robot.gear_ratio, every, horizon=horizon))
        return problems[-1]

    every = list(range(len(some)))
    p = solve_from_afar(until, plain.start.copy(), floor, lambda shift: first.shift(every, shift))
    evaluations = sum(problem.evaluations for problem in problems)
    # About where the arm sags with these springs, and all of the motions.
    sagging = _Arms(varied(robot, plain.factors(p)), payload, sensors)
    data = _Data(sagging, recorded, sensors, lambda share: tell(0.2 + 0.2 * share))
    data.align(data.rigid)
    evaluations += data.align_to(plain, robot.gear_ratio, p)
    data.bring_near(plain, robot.gear_ratio, p, some)

    parameters = ElasticParameters(arm, gear_parts, _turning(data.cases, robot.gear_ratio))
    found = parameters.start.copy()
    found[: len(p)] = p
    for is_few, steps in _ROUNDS:
        chosen = some if is_few else everything
        problem = data.problem(parameters, robot.gear_ratio, chosen)
        found, _ = problem.solve(found, problem.spread(found, floor), steps, NEAR)
        spread = problem.spread(found, floor)
        evaluations += problem.evaluations + data.align_to(parameters, robot.gear_ratio, found)
        if gear_parts:
            evaluations += data.find_rests(parameters, robot.gear_ratio, found, spread)
        data.bring_near(parameters, robot.gear_ratio, found, everything)
        tell(0.7 if is_few else 0.85)
    problem = data.problem(parameters, robot.gear_ratio, everything, _FINE)
    found, shift = problem.solve(found, problem.spread(found, floor), _LAST_STEPS, CONVERGED)
    tell(0.95)
    before = problem.readings(parameters.start)
    phases = _phases(data.cases, problem.response.kept)
    fit = problem.fit(found, shift, problem.spread(found, floor), phases, evaluations)
    after = problem.readings(found)
    times = problem.response.kept * recorded[0].period
    lags = data.lags + shift * recorded[0].period
    payloads = [payload if case.payload is None else case.payload for case in recorded]
    return ArmIdentification(
        arm, data.cases, sensors, lags, fit, times, problem.measured, before, after, payloads
    )
