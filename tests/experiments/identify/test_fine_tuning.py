"""The feedforward is tuned on the robot: what differs is found, what makes it worse is not taken over."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.cli.workers import SimulationError
from experiments.identify.fine_tuning import motions
from experiments.identify.fine_tuning import tuning as tuning_of_robot
from experiments.identify.fine_tuning.motions import TUNED, VALIDATED, TipMotion, TipRun
from experiments.identify.fine_tuning.report import fine_tuning_json, number_rows, outcome
from experiments.identify.fine_tuning.tuning import fine_tune
from robots.description.model import RobotModel, load_robot
from robots.description.variation import Factors, varied

ROBOT = load_robot("kr210")
NOISE = 5e-5  # m
TIME = np.arange(-0.4, 3.4, 4e-3)
SAG = 2e-3  # m, as far as a gear bends


@dataclass(frozen=True)
class Bending:
    """In place of simulations: an `Executor` whose robot yields in the gears of axes 2 and 3 alone."""

    contradicts: bool = False  # whether gears look as much stiffer on the other motion as they are softer
    fails: str = ""  # which motion breaks off

    def place(self, jobs: int) -> str:
        return "here"

    def completed(
        self, work: Callable, jobs: Sequence[Any], progress: Callable[[float], None] | None = None
    ) -> Generator[tuple[int, Any], None, None]:
        for number, job in enumerate(jobs):
            yield number, self.motion(job)

    def motion(self, job: TipRun) -> TipMotion:
        if job.shape.name == self.fails:
            raise SimulationError(f"fine tuning, {job.shape.name} motion: stopped")
        load = np.where(TIME > 0.0, 1.0, 0.0) * np.stack([np.sin(3.0 * TIME), np.cos(5.0 * TIME)])
        of_belief, of_plant = (robot.joint_stiffness[1:3] for robot in (job.belief, job.plant))
        nominal = ROBOT.joint_stiffness[1:3]
        if job.shape is VALIDATED and self.contradicts:
            of_plant = nominal**2 / of_plant
        missing = SAG * (nominal / of_plant - nominal / of_belief)
        bent = np.zeros((len(TIME), 3))
        bent[:, :2] = (load * missing[:, None]).T
        noise = NOISE * np.random.default_rng(job.seed).normal(size=bent.shape)
        return TipMotion(TIME, bent + noise, bent, 2.8)


def softer(robot: RobotModel, factor: float) -> RobotModel:
    """With another gear of axis 2."""
    gears = np.ones(6)
    gears[1] = factor
    return varied(robot, Factors(gears=gears))


def test_the_spring_of_a_robot_that_differs_in_nothing_else_is_found():
    tuning = fine_tune(ROBOT, softer(ROBOT, 0.93), 210.0, Bending())
    factors = {each.name: each.factor for each in tuning.numbers}
    assert factors["stiffness_gear_2"] == pytest.approx(0.93, abs=5e-3)
    assert {each.name for each in tuning.changed} == {"stiffness_gear_2", "stiffness_gear_3"}
    assert tuning.is_taken_over
    assert tuning.robot.joint_stiffness[1] == pytest.approx(0.93 * ROBOT.joint_stiffness[1], rel=5e-3)
    assert tuning.tuned.after.deviation.true < 0.1 * tuning.tuned.before.deviation.true
    assert "It is taken over." in outcome(tuning)


def test_two_numbers_with_the_same_factor_are_two_motions():
    """What the robot has done it does not do again, with the same number in the same place alone."""
    stage = tuning_of_robot._Stage(ROBOT, ROBOT, 210.0, Bending(), 0)
    second, third = (
        stage.on_robot(TUNED, {"stiffness_gear_2": a, "stiffness_gear_3": b})
        for a, b in ((0.9, 1.0), (1.0, 0.9))
    )
    assert np.abs(second.true[:, 0]).max() > 1e-4 > np.abs(second.true[:, 1]).max()
    assert np.abs(third.true[:, 1]).max() > 1e-4 > np.abs(third.true[:, 0]).max()
    assert stage.on_robot(TUNED, {"stiffness_gear_3": 0.9}) is third
    assert stage.runs == 2


def test_what_the_motion_does_not_show_stays_as_it_was():
    tuning = fine_tune(ROBOT, softer(ROBOT, 0.93), 210.0, Bending())
    for each in tuning.numbers:
        if not each.is_tuned:
            assert (each.factor, each.sigma) == (1.0, each.before)
    np.testing.assert_array_equal(tuning.robot.joint_stiffness[3:], ROBOT.joint_stiffness[3:])
    assert ["friction_1", "stays"] in [row[:2] for row in number_rows(tuning)]


def test_bounds_are_kept():
    tuning = fine_tune(ROBOT, softer(ROBOT, 0.6), 210.0, Bending(), share=0.9)
    assert all(0.9 <= each.factor <= 1.0 / 0.9 for each in tuning.numbers)
    assert {each.name: each.factor for each in tuning.numbers}["stiffness_gear_2"] < 0.91


def test_what_makes_another_motion_worse_is_not_taken_over():
    """Where gears look softer on one motion and stiffer on the other, the one gains what the other loses."""
    plant = softer(ROBOT, 0.93)
    tuning = fine_tune(ROBOT, plant, 210.0, Bending(contradicts=True))
    assert tuning.tuned.after.deviation.measured < tuning.tuned.before.deviation.measured
    assert tuning.validated.after.deviation.measured > tuning.validated.before.deviation.measured
    assert not tuning.is_taken_over
    assert tuning.robot is ROBOT
    assert "It is not taken over" in outcome(tuning)


def test_a_robot_that_moves_as_believed_stays_as_it_is():
    """Camera noise alone is no reason to change a spring by more than what it is unsure by."""
    tuning = fine_tune(ROBOT, ROBOT, 210.0, Bending())
    assert all(each.factor == pytest.approx(1.0, abs=0.02) for each in tuning.numbers)


def test_the_robot_is_driven_a_few_times_and_the_seed_repeats_it():
    once, again = (fine_tune(ROBOT, softer(ROBOT, 0.9), 210.0, Bending(), runs=4, seed=3) for _ in range(2))
    assert fine_tuning_json(once) == fine_tuning_json(again)
    # Two motions before, four at most while it is tuned, of which the first is there, and two to compare.
    assert once.robot_runs <= 2 + 3 + 2


def test_a_motion_that_shows_nothing_changes_nothing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tuning_of_robot, "_SHOWN", 1.0)
    tuning = fine_tune(ROBOT, softer(ROBOT, 0.93), 210.0, Bending())
    assert (tuning.changed, tuning.is_taken_over, tuning.robot_runs) == ([], False, 2)
    assert "shows none" in outcome(tuning)


@pytest.mark.parametrize("share", [0.0, 1.0, 1.2, -0.5, np.nan])
def test_bounds_that_make_no_sense_are_refused(share: float):
    with pytest.raises(ValueError, match="within a share between 0 and 1"):
        fine_tune(ROBOT, ROBOT, 210.0, Bending(), share=share)


def test_noise_of_the_camera_is_not_in_a_measured_deviation():
    """Noise of 0.05 mm in each axis would double a deviation of 0.05 mm in all."""
    wave = 5e-5 * np.stack([np.sin(4.0 * TIME), np.cos(4.0 * TIME), 0.0 * TIME], axis=1)
    seen = wave + NOISE * np.random.default_rng(5).normal(size=wave.shape)
    seen[100:120] = np.nan
    size = TipMotion(TIME, seen, wave, 2.8).deviation
    assert size.true == pytest.approx(5e-5)
    # Of 800 products with a standard deviation of sqrt(3) times the square of the noise.
    assert size.measured == pytest.approx(size.true, rel=0.2)


def logged(seen: float, until: float = 3.4) -> SimpleNamespace:
    """What a run leaves whose camera sees a share of it."""
    poses = np.tile(np.eye(4), (len(TIME), 1, 1))
    measured = poses.copy()
    measured[int(seen * len(TIME)) :] = np.nan
    times = {"time": TIME + 0.4, "path_start": 0.4, "dwell_start": until}
    return SimpleNamespace(X_WE_desired=poses, X_WE_true=poses, X_WE_measured=measured, **times)


@pytest.mark.parametrize(
    ("log", "why"),
    [
        (RuntimeError("the integrator\n failed"), "the integrator failed"),
        (logged(1.0, until=9.0), "the robot did not get to its end"),
        (logged(0.3), "the camera saw the tool in 22% of it alone"),
    ],
)
def test_a_motion_that_fails_is_one_line(monkeypatch: pytest.MonkeyPatch, log: Any, why: str):
    def run(*_arguments: Any) -> Any:
        if isinstance(log, Exception):
            raise log
        return log

    monkeypatch.setattr(motions, "run", run)
    with pytest.raises(SimulationError, match=f"^fine tuning, tuned motion: {why}$"):
        TipRun(ROBOT, ROBOT, 210.0, TUNED, 0).run()


def test_a_failing_robot_ends_the_tuning():
    with pytest.raises(SimulationError, match="validated motion: stopped"):
        fine_tune(ROBOT, ROBOT, 210.0, Bending(fails=VALIDATED.name))


@pytest.mark.slow
def test_a_simulated_robot_follows_where_it_is_as_believed_and_not_where_a_gear_is_softer():
    """Axis 2 carries 210 kg: a tenth of its spring is tenths of a millimetre, as the camera sees."""
    as_believed = TipRun(ROBOT, ROBOT, 210.0, TUNED, 1).run().deviation
    yielding = TipRun(ROBOT, softer(ROBOT, 0.9), 210.0, TUNED, 1).run().deviation
    assert as_believed.true < 2e-5
    assert yielding.true > 1e-4
    assert yielding.measured == pytest.approx(yielding.true, rel=0.05)
