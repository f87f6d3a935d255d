"""Which few further motions or sensors would make known what a recording does not show well enough."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from experiments.cli.workers import Executor, Progress, in_order
from experiments.identify.advice.candidates import (
    candidate_motions,
    candidate_sensors,
    planned_case,
    spread_of,
)
from experiments.identify.cases import MotionCases, PlannedMotion
from robots.description.model import RobotModel
from robots.description.variation import varied
from robots.identification.advice.prediction import design_effects, with_further
from robots.identification.advice.sightings import Sighting, without_lag
from robots.identification.arm_identification import ArmIdentification
from robots.identification.identified_robot import DAMPING_KNOWN, STIFFNESS_KNOWN, found_parameters
from robots.identification.motion import SensorPlace

_STEPS = 6  # further motions and sensors at most, for all that is weak
_TOGETHER = 3  # at most, for one parameter alone
_FEW = 20  # options, the best ones for a parameter, of which these are
_NEARLY = 0.8  # of the best step: then one that is less work is taken
_MARGIN = 0.8  # of the standard deviation below which a parameter is known: to this it shall come
_LITTLE = 0.02  # of the logarithms of standard deviations that are too large: a step that gains less is none


@dataclass(frozen=True, eq=False)
class Option:
    """A further motion with all sensors, or a further sensor on all motions."""

    motion: PlannedMotion | None = None
    sensor: SensorPlace | None = None


@dataclass(frozen=True)
class Prospect:
    """What an option, or several, would make of one parameter."""

    options: tuple[Option, ...]
    sigma: float  # relative standard deviation


@dataclass(frozen=True)
class WeakParameter:
    """A spring or a damper that the recording does not show well enough, and what would help."""

    name: str
    sigma: float  # relative
    limit: float  # relative standard deviation below which it counts as known
    motion: Prospect | None  # the best single one; None where there is no candidate
    sensor: Prospect | None
    reach: Prospect  # with the few that are best for it alone
    proposed: float  # relative standard deviation with all that is proposed

    @property
    def verdict(self) -> str:
        """What makes it known, in some words."""
        if self.reach.sigma >= self.limit:
            return "nothing"
        for words, prospect in (("one motion", self.motion), ("one sensor", self.sensor)):
            if prospect is not None and prospect.sigma < self.limit:
                return words
        return f"{len(self.reach.options)} motions or sensors"


@dataclass(frozen=True)
class Advice:
    """What to record further."""

    payload: float  # kg, of the recording
    weak: list[WeakParameter] = field(default_factory=list)
    proposed: list[Option] = field(default_factory=list)  # in this order
    motions: int = 0  # candidates
    sensors: int = 0  # candidates


def advise(
    robot: RobotModel,
    payload: float,
    found: ArmIdentification,
    weak: Sequence[str],
    executor: Executor,
    progress: Progress | None = None,
) -> Advice:
    """Looks for further motions and sensors.

    Args:
        robot: which the identification began with.
        payload: of the recording in kg.
        found: by the identification.
        weak: springs and dampers that are not known well enough, by their names.
        executor: where motions are looked at, each of them a job.
        progress: is called now and then with the share that is done, 0 to 1.
    """
    if not weak:
        return Advice(payload)
    return advice_of(Prospects(robot, payload, found, executor, progress), payload, weak)


def advice_of(prospects: "Prospects", payload: float, weak: Sequence[str]) -> Advice:
    """The same, where the candidates have been looked at."""
    now, options = prospects.sigmas([]), prospects.options
    singles = [prospects.sigmas([option]) for option in options]
    rows = []
    for name in weak:
        order = sorted(range(len(options)), key=lambda i: singles[i][name])
        best: dict[str, Prospect | None] = {}
        for kind in ("motion", "sensor"):
            first = next((i for i in order if getattr(options[i], kind) is not None), None)
            best[kind] = None if first is None else Prospect((options[first],), singles[first][name])
        few = [options[i] for i in sorted(order[:_FEW])]
        reached = chosen_few(prospects.sigmas, few, {name: now[name]}, _TOGETHER, nearly=1.0)
        reach = Prospect(tuple(reached), prospects.sigmas(reached)[name])
        # Steps end where a parameter is known well enough, which one option may do better.
        reach = min((each for each in (reach, *best.values()) if each), key=lambda each: each.sigma)
        rows.append(
            WeakParameter(name, now[name], _limit(name), best["motion"], best["sensor"], reach, now[name])
        )
    reachable = {row.name: row.sigma for row in rows if row.reach.sigma < row.limit}
    chosen = chosen_few(prospects.sigmas, options, reachable, _STEPS)
    last = prospects.sigmas(chosen)
    motions = sum(option.motion is not None for option in options)
    rows = [replace(row, proposed=last[row.name]) for row in rows]
    return Advice(payload, rows, chosen, motions, len(options) - motions)


def _limit(name: str) -> float:
    return STIFFNESS_KNOWN if name.startswith("stiffness_") else DAMPING_KNOWN


def chosen_few(
    sigmas: Callable[[Sequence[Option]], dict[str, float]],
    options: Sequence[Option],
    now: dict[str, float],
    steps: int,
    nearly: float = _NEARLY,
) -> list[Option]:
    """Step by step the option that leaves least of what is too large, or one that is less work.

    Args:
        sigmas: relative standard deviations with some options.
        options: in the order of the work that they are.
        now: those without any; of these parameters alone.
        steps: at most.
        nearly: the share of the best gain with which less work is taken.
    """

    def too_large(with_option: dict[str, float]) -> float:
        return sum(max(0.0, float(np.log(with_option[name] / (_MARGIN * _limit(name))))) for name in now)

    chosen: list[Option] = []
    left = too_large(now)
    for _ in range(steps):
        others = [option for option in options if option not in chosen]
        gains = [left - too_large(sigmas([*chosen, option])) for option in others]
        if not gains or max(gains) < _LITTLE:
            break
        step = next(i for i, gain in enumerate(gains) if gain >= nearly * max(gains))
        chosen.append(others[step])
        left -= gains[step]
    return chosen


class Prospects:
    """Standard deviations with further motions and sensors.

    Attributes:
        options: all candidates, in the order of the work that they are.
    """

    def __init__(
        self,
        robot: RobotModel,
        payload: float,
        found: ArmIdentification,
        executor: Executor,
        progress: Progress | None = None,
    ) -> None:
        """Looks at all candidates; arguments as of `advise`."""
        fit = found.fit
        self._robot, self._fit, self._effects = robot, fit, design_effects(fit)
        motions = candidate_motions(robot, payload)
        # A payload has to be changed by hand.
        motions.sort(key=lambda motion: motion.payload != payload)
        sensors = candidate_sensors(robot, found.sensors)
        self._there, self._recorded = len(found.sensors), len(found.cases)
        self.options = [Option(motion=each) for each in motions] + [Option(sensor=each) for each in sensors]
        self._motions = {id(each): i for i, each in enumerate(motions)}
        self._sensors = {id(each): i for i, each in enumerate(sensors)}
        sagging = varied(robot, fit.parameters.factors(fit.values))
        further = spread_of(fit, found.sensors, sensors)
        plan, period = MotionCases(), found.cases[0].period
        jobs = []
        for motion in motions:
            load = payload if motion.payload is None else motion.payload
            case = planned_case(robot, payload, motion, plan, period)
            spread = np.append(fit.spread, further)
            all_sensors = [*found.sensors, *sensors]
            jobs.append(Sighting(sagging, load, case, all_sensors, spread, fit.parameters, fit.values))
        for case, load in zip(found.cases if sensors else [], found.payloads, strict=False):
            bare = replace(case, readings=case.readings[:, :0])
            jobs.append(Sighting(sagging, load, bare, sensors, further, fit.parameters, fit.values))
        seen = in_order(executor, _seen, jobs, progress)
        self._of_motions = seen[: len(motions)]
        # A further sensor has the clock of those that are there, or at least finds its own.
        self._of_sensors = [
            sum(without_lag(of_case[i]) for of_case in seen[len(motions) :]) for i in range(len(sensors))
        ]

    def sigmas(self, options: Sequence[Option]) -> dict[str, float]:
        """Relative standard deviations of all springs and dampers with some options."""
        sensors = [self._sensors[id(each.sensor)] for each in options if each.sensor is not None]
        motions = [self._motions[id(each.motion)] for each in options if each.motion is not None]
        watching = [*range(self._there), *(self._there + i for i in sensors)]
        n = len(self._fit.values)
        more = np.zeros((n, n))
        for i in sensors:
            more += self._of_sensors[i]
        for i in motions:
            more += without_lag(self._of_motions[i][watching].sum(axis=0))
        fit = with_further(self._fit, self._effects, more, self._recorded, len(motions))
        rows = found_parameters(self._robot, fit)
        return {row.name: row.sigma / row.value for row in rows if row.name.startswith(("stiff", "damp"))}


def _seen(job: Sighting, progress: Progress) -> np.ndarray:
    found = job.information()
    progress(1.0)
    return found
