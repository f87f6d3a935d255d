"""The chain of a calibration: design, measurement, identification, validation, path."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from diagrams.record.log import RunLog
from diagrams.runs.measurement import MeasurementRecord, MeasurementRun
from diagrams.scenario.scenario import Scenario
from experiments.cli.workers import Progress, SimulationError, in_processes
from experiments.comparison.compare import RunJob, run_job
from robots.calibration.identification import IdentificationConfig
from robots.calibration.identified import Identified
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.calibration.validation import (
    ErrorStatistics,
    plausible_rows,
    prediction_errors,
    statistics,
)
from robots.calibration.yielding_joints import COMPLIANCE_NAMES
from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics
from robots.measurement_design.candidate_grid import own_ranges
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.design import MeasurementDesign
from robots.measurement_design.visiting_order import visiting_order
from systems.cell.encoders import Encoders

# The source's validation set has 125 configurations, Probst (2024) section 4.3.
VALIDATION_COUNT = 125
_HARMFUL = 1.5  # times the error of the nominal robot; a perfect one gets worse by the noise
_STRETCHES = 8  # into which a set is divided to be measured side by side; part of the result


@dataclass(frozen=True)
class MeasuredSets:
    """Measurements for identification and validation; true poses only if they were simulated."""

    calibration: Measurements
    validation: Measurements | None
    validation_truth: Measurements | None


@dataclass(frozen=True)
class CalibrationStudy:
    """The results of a calibration."""

    nominal: RobotModel
    calibrated: RobotModel
    design: MeasurementDesign | None
    design_seconds: float
    sets: MeasuredSets
    identified: Identified
    truth: np.ndarray | None  # (m,) the named values, where they are known
    before: ErrorStatistics | None
    after: ErrorStatistics | None
    geometry_only: ErrorStatistics | None  # what is left without the compliances, where these were identified
    after_noise_free: ErrorStatistics | None
    validation_outliers: tuple[int, ...] = ()  # rows of the validation table with gross errors, left out


@dataclass(frozen=True)
class _Stretch:
    scenario: Scenario
    q: np.ndarray
    seed: int


def validation_configurations(robot: RobotModel, count: int, seed: int) -> np.ndarray:
    """Admissible configurations spread over the robot's ranges, in a short order, (count, 6) in rad.

    The first three joints stand on a grid, 5 by 5 by 5 for the source's 125 configurations, the wrist
    anywhere. What is not admissible is replaced by random configurations.
    """
    rng = np.random.default_rng([seed, 1])
    lower, upper = np.deg2rad([(axis.lower_deg, axis.upper_deg) for axis in own_ranges(robot)]).T
    cells = max(1, round(count ** (1.0 / 3.0)))
    centres = (np.arange(cells) + 0.5) / cells
    arm = np.stack(np.meshgrid(centres, centres, centres, indexing="ij"), -1).reshape(-1, 3)
    shares = np.hstack([rng.permutation(arm), rng.uniform(size=(len(arm), 3))])
    admissible, found = AdmissibleConfigurations(robot), np.empty((0, NUM_JOINTS))
    while True:
        q = lower + shares * (upper - lower)
        found = np.vstack([found, q[admissible(q)]])[:count]
        if len(found) == count:
            return found[visiting_order(found, np.zeros(NUM_JOINTS))]
        shares = rng.uniform(size=(count, NUM_JOINTS))


def measure_sets(
    scenario: Scenario,
    calibration: np.ndarray,
    validation: np.ndarray,
    payloads: list[float],
    noise: MeasurementNoise,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> MeasuredSets:
    """Measures both sets through the station of a scenario.

    Args:
        scenario: the station and its camera.
        calibration: configurations in rad, measured with every payload, (n, 6).
        validation: configurations in rad, measured with the first payload, (m, 6).
        payloads: masses at the flange in kg.
        noise: of every row, on top of what the camera does.
        processes: how many work at a time; None for one per core.
        progress: is called now and then with the share that is done.

    Raises:
        SimulationError: if a simulation broke off.
    """
    jobs, owners = [], []
    for number, (q, payload) in enumerate(
        [*((calibration, load) for load in payloads), (validation, payloads[0])]
    ):
        loaded = replace(scenario, station=replace(scenario.station, payload=payload))
        for stretch in np.array_split(q, min(_STRETCHES, len(q))):
            jobs.append(_Stretch(loaded, stretch, scenario.seed + len(jobs)))
            owners.append(number)
    records = in_processes(_measure, jobs, processes, progress)
    measured: list[list[Measurements]] = [[] for _ in range(len(payloads) + 1)]
    truth: list[Measurements] = []
    for owner, record in zip(owners, records, strict=True):
        measured[owner].append(record.measured)
        if owner == len(payloads):
            truth.append(record.truth)
    tables = [_joined(parts) for parts in measured]
    rng = np.random.default_rng([scenario.seed, 2])
    return MeasuredSets(_joined(tables[:-1]).noisy(noise, rng), tables[-1].noisy(noise, rng), _joined(truth))


def _measure(job: _Stretch, progress: Progress) -> MeasurementRecord:
    try:
        return MeasurementRun(job.scenario).measure(job.q, job.seed, progress)
    except RuntimeError as error:
        raise SimulationError(f"measurement run: {' '.join(str(error).split())}") from error


def _joined(tables: list[Measurements]) -> Measurements:
    table = tables[0]
    for other in tables[1:]:
        table = table.joined(other)
    return table


def validated(
    robot: RobotModel, measurements: Measurements | None, position_only: bool
) -> ErrorStatistics | None:
    """Statistics of a robot's prediction errors; None without measurements."""
    if measurements is None:
        return None
    return statistics(
        prediction_errors(robot, measurements.without_rotation() if position_only else measurements)
    )


@dataclass(frozen=True)
class Validation:
    """What fresh configurations say of a calibrated robot."""

    measurements: Measurements | None  # those without gross errors; None without a table
    left_out: tuple[int, ...]  # the numbers of the other rows
    before: ErrorStatistics | None  # of the nominal robot
    after: ErrorStatistics | None


def validate(identified: Identified, calibrated: RobotModel, fresh: Measurements | None) -> Validation:
    """Compares nominal and calibrated robot at configurations that were not used to identify it.

    Raises:
        ValueError: if the calibrated robot is worse there, or the table cannot be of this robot.
    """
    position_only = identified.measurements.rotation is None
    left_out: tuple[int, ...] = ()
    if fresh is not None:
        fresh = fresh.without_rotation() if position_only else fresh
        plausible = plausible_rows(identified, fresh)
        left_out = tuple(map(int, fresh.rows[~plausible]))
        fresh = fresh.select(plausible)
    before = validated(identified.robot, fresh, position_only)
    after = validated(calibrated, fresh, position_only)
    if before is not None and after is not None:
        refuse_the_harmful(before.mean_norm_mm, after.mean_norm_mm)
    return Validation(fresh, left_out, before, after)


@contextmanager
def validating(file: str | None) -> Iterator[None]:
    """Says which table it is that a calibrated robot is refused for; None where rows were simulated."""
    try:
        yield
    except ValueError as error:
        if file is None:
            raise
        raise ValueError(f"--validation {file}: {error}") from error


def refuse_the_harmful(before: float, after: float) -> None:
    """Raises ValueError if mean errors in mm show a calibrated robot to be worse than the nominal one."""
    if after <= _HARMFUL * before:
        return
    raise ValueError(
        f"calibration: on fresh configurations the mean error rises from {before:.3g} mm of the "
        f"nominal robot to {after:.3g} mm; the measurements do not show what is wrong with it "
        "(do both tables belong to this robot, and does it yield or carry a load that is not said?)"
    )


def true_values(scenario: Scenario, robot: RobotModel, identified: Identified) -> np.ndarray:
    """What a simulated station has in place of the values that were identified, (m,) in SI units.

    Geometry and errors of the joints are those of the true robot, described by the same independent
    parameters, exactly; but for the ripple of gears, which changes with their load.
    """
    errors = scenario.station.errors
    true = ErrorKinematics(robot).robot_with_errors(errors.vector(robot)) if errors else robot
    chosen = identified.reduction.independent
    is_elastic = scenario.station.elasticity != "rigid"
    encoders, kinematics = Encoders(robot, scenario.station.encoder), Kinematics(true)
    ripples = [joint.drive_train.ratio_error for joint in robot.joints] if is_elastic else []

    def forward(q: np.ndarray) -> np.ndarray:
        links = encoders.true_position(q)
        for i, ripple in enumerate(ripples):
            if ripple:
                links[:, i] += ripple.part(robot.gear_ratio[i]).position_error(links[:, i])[0]
        return kinematics.forward(links)

    geometry = identified.reducible.describe(forward, chosen, identified.x)
    compliance = dict(zip(COMPLIANCE_NAMES, is_elastic / robot.joint_stiffness, strict=True))
    return np.array([*geometry, *(compliance[name] for name in identified.names[len(chosen) :])])


def path_runs(
    scenario: Scenario,
    nominal: RobotModel,
    calibrated: RobotModel,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, RunLog]:
    """The path without a camera, planned with the nominal and with the calibrated robot.

    Raises:
        SimulationError: if a simulation broke off.
    """
    jobs = [RunJob(scenario, robot, "open_loop", scenario.seed) for robot in (nominal, calibrated)]
    logs = in_processes(run_job, jobs, processes, progress)
    return dict(zip(("before", "after"), logs, strict=True))


def identification_config(
    compliance: bool, fixed: list[str], noise: MeasurementNoise, joint_errors: tuple[str, ...] = ()
) -> IdentificationConfig:
    """What to identify; residuals are whitened where the noise is known."""
    return IdentificationConfig(
        compliance=compliance, fixed=tuple(fixed), noise=noise, joint_errors=joint_errors
    )
