"""What the commands do, for Python: arrays and tables in place of files, and nothing on the console."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from diagrams.record.log import RunLog
from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.calibration.calibrate import validate
from experiments.cli.workers import Executor, LocalProcesses
from experiments.comparison.compare import compare as run_laws
from experiments.comparison.compare import compared_laws
from experiments.identify.cases import MotionCases, default_cases
from experiments.identify.fine_tuning.tuning import SHARE
from experiments.identify.recording_map import Recording
from experiments.identify.simulated import simulated_recording
from experiments.identify.slow import identify_slow_motions
from experiments.identify.study import IdentifyStudy, study_recording, with_fine_tuning
from experiments.metrics.run_metrics import best_law, judged_by, summary
from experiments.report.report import verdict
from robots.calibration.identification import IdentificationConfig
from robots.calibration.identification import identify as identify_geometry
from robots.calibration.identified import Identified
from robots.calibration.measurements import Measurements
from robots.calibration.validation import ErrorStatistics
from robots.description.model import RobotModel, load_robot, shipped_robots
from robots.description.robot_file import robot_text
from robots.measurement_design.design import MeasurementDesign, design_measurements
from systems.named_classes import read_changed_files_again
from systems.servo import LAWS

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Comparison:
    """Laws on one scenario.

    Attributes:
        scenario: what was done.
        logs: law -> one log per cycle; errors are those of the first cycle.
    """

    scenario: Scenario
    logs: Mapping[str, Sequence[RunLog]]

    @cached_property
    def summary(self) -> dict[str, Any]:
        """All numbers, as in ``summary.json``: lengths in mm, angles in degrees."""
        return summary(self.scenario.description, self.logs)

    @property
    def judged_by(self) -> str:
        """``"true"``, or ``"measured"`` where nobody knows the truth."""
        return judged_by(self.summary)

    @property
    def best(self) -> str:
        """The law whose largest distance is smallest; the open loop only if it is alone."""
        return best_law(self.summary)

    @property
    def verdict(self) -> str:
        """The result in one or two sentences."""
        return verdict(self.summary)

    def figure(self, name: str) -> dict[str, float]:
        """One number of each law.

        Args:
            name: ``"max_norm_mm"``, ``"rms_norm_mm"`` or ``"max_angle_deg"``.

        Raises:
            KeyError: if there is no such number.
        """
        return {law: each[self.judged_by][name] for law, each in self.summary["runs"].items()}


@dataclass(frozen=True)
class Calibration:
    """A robot as it was found, and what fresh measurements say of it.

    Attributes:
        robot: the calibrated robot, for the controller and for `robots.description.robot_file.robot_text`.
        identified: parameters, covariance, residuals, rows left out.
        before: errors of the nominal robot at the fresh configurations; None without any.
        after: those of the calibrated one.
    """

    robot: RobotModel
    identified: Identified
    before: ErrorStatistics | None
    after: ErrorStatistics | None


def simulate(
    scenario: Scenario | str | Path,
    law: str | None = None,
    robot: RobotModel | str | Path | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> RunLog:
    """Runs one law once.

    Args:
        scenario: a scenario, a shipped one's name, or the path of a file.
        law: a shipped law's name or ``FILE.py:CLASS``; None for the scenario's.
        robot: as the controller knows it; a robot, a shipped one's name or the path of a file. None for the
            scenario's.
        seed: of the camera's noise; None for the scenario's.
        progress: is called now and then with the share that is done, 0 to 1.

    Returns:
        Times, poses (desired, true, measured), joints and commands, n samples each.

    Raises:
        ValueError: if something is missing, unknown, out of range or out of reach; one line.
        RuntimeError: if the integration fails.
    """
    read_changed_files_again()
    scenario = _scenario(scenario)
    known = None if robot is None else _robot(robot)
    return run(scenario, law or scenario.law, known, seed, progress)


def compare(
    scenario: Scenario | str | Path,
    laws: Sequence[str] | None = None,
    robot: RobotModel | str | Path | None = None,
    cycles: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Runs laws side by side, one process per core unless an executor is given.

    In a script it belongs below ``if __name__ == "__main__":``, because the processes import it.

    Args:
        scenario: as of `simulate`.
        laws: shipped laws' names or ``FILE.py:CLASS``, for processes import them; None for the open loop and
            the three that Probst (2024) compares.
        robot: as of `simulate`.
        cycles: runs of each law, with the scenario's seed and the ones after it.
        executor: where they run, such as ``LocalProcesses(1)`` of `experiments.cli.workers`.
        progress: as of `simulate`.

    Raises:
        ValueError: as of `simulate`, and if there are no cycles, or a law is given otherwise or named twice.
        experiments.cli.workers.SimulationError: if a run broke off.
    """
    if laws is not None and (isinstance(laws, str) or not all(isinstance(law, str) for law in laws)):
        raise ValueError(f"compare: takes laws by name, ['pbvs'] or ['my_law.py:MyLaw'], got {laws!r}")
    read_changed_files_again()
    scenario = _scenario(scenario)
    chosen = list(laws) if laws is not None else compared_laws()
    if cycles < 1 or not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(f"compare: needs laws that differ and at least one cycle, got {chosen} and {cycles}")
    for law in chosen:
        LAWS.find(law)
    known = _robot(scenario.robot if robot is None else robot)
    return Comparison(scenario, run_laws(scenario, known, chosen, cycles, executor, progress))


def design(robot: RobotModel | str | Path, count: int = 75, **options: Any) -> MeasurementDesign:
    """Chooses the configurations at which measurements determine a robot's errors best.

    Args:
        robot: the nominal robot, a shipped one's name or the path of a file.
        count: how many configurations.
        options: as of `robots.measurement_design.design.design_measurements`.

    Raises:
        ValueError: if the count is too small to see all parameters, or too few candidates are admissible.
    """
    return design_measurements(_robot(robot), count, **options)


def calibrate(
    robot: RobotModel | str | Path,
    measurements: Measurements,
    fresh: Measurements | None = None,
    config: IdentificationConfig | None = None,
) -> Calibration:
    """Finds the errors of a robot, and tries the calibrated one at configurations that it has not seen.

    Args:
        robot: the nominal robot, a shipped one's name or the path of a file. A scenario takes the calibrated
            one where it names the same robot: one from a file of one's own is given by its path.
        measurements: such as `robots.calibration.measurement_file.read_measurements` reads.
        fresh: further ones for validation.
        config: what to identify; geometry alone unless it says more.

    Raises:
        ValueError: if the measurements are none, too few or too alike, nothing explains them, or the
            calibrated robot is worse at the fresh configurations; one line.
    """
    for each in (measurements, fresh):
        if each is not None and not isinstance(each, Measurements):
            raise ValueError(
                "measurements must be as robots.calibration.measurement_file.read_measurements reads them, "
                f"got {type(each).__name__}"
            )
    model = _robot(robot)
    identified = identify_geometry(model, measurements, config)
    calibrated = identified.calibrated_robot(_name_of(robot))
    checked = validate(identified, calibrated, fresh)
    return Calibration(calibrated, identified, checked.before, checked.after)


def record_motions(
    robot: RobotModel | str | Path,
    plant: RobotModel | str | Path,
    motions: MotionCases | None = None,
    seed: int = 0,
    processes: int | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Simulates short motions of an elastic robot with gyros and accelerometers on it, for `identify`.

    In a script it belongs below ``if __name__ == "__main__":``, because the processes import it.

    Args:
        robot: as the controller knows it; a robot, a shipped one's name or the path of a file.
        plant: what moves, likewise.
        motions: where they begin, how far they go, and the sensors; None for 18 motions, with gyros on all
            links and accelerometers on hand and flange.
        seed: of the noise of the sensors.
        processes: how many work at a time; None for one per core.
        progress: as of `simulate`.

    Raises:
        ValueError: if a motion or a sensor is impossible; one line.
        experiments.cli.workers.SimulationError: if a run broke off.
    """
    model = _robot(robot)
    chosen = default_cases(model) if motions is None else motions
    return simulated_recording(model, _robot(plant), chosen, seed, LocalProcesses(processes), progress)


def identify(
    robot: RobotModel | str | Path,
    recording: Recording,
    plant: RobotModel | str | Path | None = None,
    slow: Recording | None = None,
    gear_parts: bool = True,
    progress: Progress | None = None,
) -> IdentifyStudy:
    """Finds springs, damping and play of a robot from its own motion.

    Args:
        robot: as it is believed to be; a robot, a shipped one's name or the path of a file.
        recording: of `record_motions`, or as `experiments.identify.recording_file.read_recording` reads one.
        plant: what moved, if that is known, to compare with.
        slow: slow motions with torques, which tell load, counterbalance and friction beforehand.
        gear_parts: whether gears may have play, hysteresis and ripple.
        progress: as of `simulate`.

    Returns:
        The identified robot (``identified``) and its ``parameters`` with standard deviations, in SI units;
        ``weak`` names springs and dampers that the motions do not show.

    Raises:
        ValueError: if the recording cannot be used or shows no motion, or a sensor sits where the robot has
            no body; one line.
    """
    model, truth = _robot(robot), None if plant is None else _robot(plant)
    of_slow = None if slow is None else identify_slow_motions(slow, model, recording.payload)
    return study_recording(model, truth, recording, gear_parts, of_slow, progress)


def fine_tune(
    study: IdentifyStudy,
    share: float = SHARE,
    seed: int = 0,
    processes: int | None = None,
    progress: Progress | None = None,
) -> IdentifyStudy:
    """Tunes what the inverse model believes on the robot of a study, by how its tip follows a rectangle.

    In a script it belongs below ``if __name__ == "__main__":``, because the processes import it.

    Args:
        study: of `identify`, with the plant that is driven.
        share: numbers stay between this share of what was identified and its inverse, in (0, 1).
        seed: of the camera's noise.
        processes: how many simulate motions at a time; None for one per core.
        progress: as of `simulate`.

    Returns:
        The study with ``fine_tuning``; ``final`` is the robot for the inverse model, tuned where another
        rectangle is not driven worse with it.

    Raises:
        ValueError: if the share makes no sense, the study has no plant, or it cannot follow a rectangle.
        experiments.cli.workers.SimulationError: if the robot did not get to the end of a motion.
    """
    return with_fine_tuning(study, LocalProcesses(processes), share, seed, progress)


def _scenario(scenario: Scenario | str | Path) -> Scenario:
    return load_scenario(str(scenario)) if isinstance(scenario, str | Path) else scenario


def _robot(robot: RobotModel | str | Path) -> RobotModel:
    return load_robot(str(robot)) if isinstance(robot, str | Path) else robot


def _name_of(robot: RobotModel | str | Path) -> str:
    """What a scenario calls a robot: a shipped one that was read already by its name again."""
    if isinstance(robot, str | Path):
        return str(robot)
    text = robot_text(robot)
    same = (name for name in shipped_robots() if robot_text(load_robot(name)) == text)
    return next(same, robot.name)
