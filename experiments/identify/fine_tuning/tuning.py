"""The last stage of an identification, on the robot: numbers of the inverse model by how the tip moves.

Reiner (2010), section 4.4, step 5: within narrow bounds about what was identified. How the tip answers to
each number comes from the model, what is left of its deviation from the robot, so that the robot moves a few
times in place of once for each number and step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.cli.workers import Executor, in_order
from experiments.identify.fine_tuning.motions import TUNED, VALIDATED, Shape, TipMotion, TipRun, driven
from robots.description.model import RobotModel
from robots.identification.fine_tuning.bounded_tuning import Sensitivity, tune
from robots.identification.fine_tuning.tuned_inverse import believed_sigma, true_factor, tunable, tuned_robot
from robots.identification.identified_robot import FoundParameter

SHARE = 0.8  # k_2: numbers stay within this share of what is believed and its inverse
RUNS = 5  # of the robot while it is tuned
_DIFFERENCE = 0.05  # of a logarithm, for derivatives
_SHOWN, _MOST = 0.1, 12  # of what is unsure of a number, what has to be removed; numbers that are tuned
_OF_MODEL, _OF_TUNING = 0.6, 0.9  # of the progress, where the model and the tuning are done


@dataclass(frozen=True)
class TunedNumber:
    """A number of the inverse model."""

    name: str
    factor: float  # times what was believed, as tuned
    before: float  # relative standard deviation, as believed
    sigma: float  # the same after the tuning; as before where it was not tuned
    effect: float  # m, by which the tip moves with a change of one standard deviation, root mean square
    is_tuned: bool  # or stays since the motion hardly shows it
    true: float | None  # factor of the plant, where it has such a number


@dataclass(frozen=True)
class BeforeAfter:
    """One motion with what was identified, and with what was tuned."""

    before: TipMotion
    after: TipMotion


@dataclass(frozen=True)
class FineTuning:
    """What came out."""

    share: float  # k_2
    numbers: list[TunedNumber]
    tuned: BeforeAfter
    validated: BeforeAfter
    identified: RobotModel
    candidate: RobotModel  # with the numbers as tuned
    robot_runs: int
    robot_seconds: float  # of motion, without ways back

    @property
    def is_taken_over(self) -> bool:
        """Whether something was tuned, and neither motion deviates more than before, as measured."""
        return bool(self.changed) and all(
            each.after.deviation.measured <= each.before.deviation.measured
            for each in (self.tuned, self.validated)
        )

    @property
    def robot(self) -> RobotModel:
        """For the inverse model: tuned where it is taken over, else as it was."""
        return self.candidate if self.is_taken_over else self.identified

    @property
    def changed(self) -> list[TunedNumber]:
        """The numbers that were tuned."""
        return [each for each in self.numbers if each.is_tuned]


def fine_tune(
    robot: RobotModel,
    plant: RobotModel,
    payload: float,
    executor: Executor,
    found: Sequence[FoundParameter] = (),
    share: float = SHARE,
    runs: int = RUNS,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> FineTuning:
    """Drives a rectangle again and again, and another one to see whether that is better, too.

    Args:
        robot: as identified; its inverse model is tuned.
        plant: what is driven.
        payload: mass at the flange in kg.
        executor: where motions are simulated, each of them a job.
        found: what identification says of the numbers, from which their standard deviations are.
        share: k_2 in (0, 1), numbers stay between this share of what is believed and its inverse.
        runs: of the robot while it is tuned, at least 2.
        seed: of the camera's noise.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        ValueError: if the share or the runs make no sense, or the robot cannot follow a rectangle.
        SimulationError: if the robot did not get to the end of a motion.
    """
    if not 0.0 < share < 1.0:
        raise ValueError(f"fine tuning: numbers stay within a share between 0 and 1 (k_2), got {share:g}")
    if runs < 2:
        raise ValueError(f"fine tuning: the robot has to be driven at least 2 times, got {runs}")
    tell = progress or (lambda share: None)
    stage = _Stage(robot, plant, payload, executor, seed)
    names, limit = tunable(robot), -np.log(share)
    sigma = np.array([believed_sigma(name, found, limit) for name in names])
    before, model = stage.begun(names, lambda done: tell(_OF_MODEL * done))
    gap = before[TUNED.name].measured
    seen = before[TUNED.name].seen
    every = Sensitivity(model[seen], before[TUNED.name].parts[seen], sigma, limit)
    chosen = every.shown(gap[seen], _SHOWN, _MOST)
    sensitivity = every.of(chosen)
    spread, _ = sensitivity.weighed(gap[seen])

    def factors(x: np.ndarray) -> dict[str, float]:
        return {names[i]: float(np.exp(value)) for i, value in zip(chosen, x, strict=True)}

    def measured(motion: TipMotion, x: np.ndarray) -> np.ndarray:
        """Where the camera has lost a sample this time, what the model says: it pulls nowhere."""
        of_robot = motion.measured[seen]
        return np.where(np.isfinite(of_robot), of_robot, gap[seen] + sensitivity.slope @ x)

    def deviation(x: np.ndarray) -> np.ndarray:
        motion = stage.on_robot(TUNED, factors(x))
        tell(_OF_MODEL + (_OF_TUNING - _OF_MODEL) * min(1.0, stage.runs / (runs + 1)))
        return measured(motion, x)

    x = tune(deviation, sensitivity, spread, runs) if len(chosen) else np.zeros(0)
    tuned = BeforeAfter(before[TUNED.name], stage.on_robot(TUNED, factors(x)))
    validated = BeforeAfter(before[VALIDATED.name], stage.on_robot(VALIDATED, factors(x)))
    tell(1.0)
    _, covariance = sensitivity.weighed(measured(tuned.after, x))
    after = sigma.copy()
    after[chosen] = np.minimum(np.sqrt(np.diagonal(covariance)), sigma[chosen])
    numbers = [
        TunedNumber(
            name,
            factors(x).get(name, 1.0),
            float(sigma[i]),
            float(after[i]),
            float(every.effect[i]),
            i in chosen,
            true_factor(name, robot, plant),
        )
        for i, name in enumerate(names)
    ]
    candidate = replace(tuned_robot(robot, factors(x)), name=f"{robot.name}, fine tuned")
    return FineTuning(share, numbers, tuned, validated, robot, candidate, stage.runs, stage.seconds)


class _Stage:
    """Drives robot and model, and remembers what the robot has done."""

    def __init__(
        self, robot: RobotModel, plant: RobotModel, payload: float, executor: Executor, seed: int
    ) -> None:
        self._robot, self._plant, self._payload = robot, plant, payload
        self._executor, self._seed = executor, seed
        self._done: dict[tuple[str, frozenset], TipMotion] = {}
        self.runs, self.seconds = 0, 0.0

    def begun(
        self, names: Sequence[str], progress: Callable[[float], None]
    ) -> tuple[dict[str, TipMotion], np.ndarray]:
        """Both motions of the robot before anything is tuned, and how the tip of the model changes.

        Returns:
            The motions by the names of their shapes, and derivatives by logarithms of the numbers (n, 3, k).
        """
        jobs = [self._job(shape, {}) for shape in (TUNED, VALIDATED)]
        # Derivatives are those of linear gears: what teeth do when they meet is no matter of small changes.
        model = without_play(self._robot)
        jobs.append(TipRun(model, model, self._payload, TUNED, self._seed))
        for name in names:
            moved = tuned_robot(model, {name: float(np.exp(_DIFFERENCE))})
            jobs.append(replace(jobs[-1], belief=moved, plant=model))
        motions = in_order(self._executor, driven, jobs, progress)
        for shape, motion in zip((TUNED, VALIDATED), motions, strict=False):
            self._keep(shape, {}, motion)
        base, *others = (motion.true for motion in motions[2:])
        slope = np.stack([(other - base) / _DIFFERENCE for other in others], axis=-1)
        return {shape.name: self.on_robot(shape, {}) for shape in (TUNED, VALIDATED)}, slope

    def on_robot(self, shape: Shape, factors: dict[str, float]) -> TipMotion:
        """What the robot does with some numbers; what it has done with them it does not do again."""
        key = _key(shape, factors)
        if key not in self._done:
            motion = in_order(self._executor, driven, [self._job(shape, factors)])[0]
            self._keep(shape, factors, motion)
        return self._done[key]

    def _job(self, shape: Shape, factors: dict[str, float]) -> TipRun:
        seed = 1000 * self._seed + self.runs
        belief = tuned_robot(self._robot, factors)
        return TipRun(belief, self._plant, self._payload, shape, seed)

    def _keep(self, shape: Shape, factors: dict[str, float], motion: TipMotion) -> None:
        self._done[_key(shape, factors)] = motion
        self.runs += 1
        self.seconds += float(motion.time[-1] - motion.time[0])


def _key(shape: Shape, factors: dict[str, float]) -> tuple[str, frozenset]:
    """What a motion depends on: a number with a factor of one is as it was believed."""
    return shape.name, frozenset(each for each in factors.items() if each[1] != 1.0)


def without_play(robot: RobotModel) -> RobotModel:
    """The robot with linear gears that run evenly."""
    joints = [
        replace(
            joint, drive_train=replace(joint.drive_train, backlash=None, hysteresis=None, ratio_error=None)
        )
        for joint in robot.joints
    ]
    return replace(robot, joints=joints)
