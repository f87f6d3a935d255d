"""The calibrated robot of each seed: measured as `truetip calibrate` does, before the laws run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagrams.runs.measurement import MeasurementRun
from diagrams.scenario.scenario import Scenario
from experiments.cli.workers import Executor, Progress, SimulationError, in_order
from robots.calibration.identification import IdentificationConfig, identify
from robots.description.model import RobotModel, load_robot
from robots.measurement_design.constraints import AdmissibleConfigurations
from robots.measurement_design.design import design_measurements

COUNT = 75  # configurations, as those of the source


@dataclass(frozen=True)
class _Job:
    scenario: Scenario
    q: np.ndarray  # rad, (n, 6)


def calibrated_robots(
    scenarios: Mapping[int, Scenario], executor: Executor, progress: Callable[[float], None] | None = None
) -> dict[int, RobotModel]:
    """Measures and identifies each robot once; they differ by their seeds alone.

    Args:
        scenarios: the station of each seed.
        executor: where the measurements are simulated.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        SimulationError: if a simulation broke off.
        ValueError: if the measurements do not determine a robot.
    """
    if not scenarios:
        return {}
    nominal = load_robot(next(iter(scenarios.values())).robot)
    design = design_measurements(nominal, COUNT, admissible=AdmissibleConfigurations(nominal))
    jobs = [_Job(scenario, design.configurations) for scenario in scenarios.values()]
    return dict(zip(scenarios, in_order(executor, _calibrated, jobs, progress), strict=True))


def _calibrated(job: _Job, progress: Progress) -> RobotModel:
    nominal, load = load_robot(job.scenario.robot), job.scenario.station.payload
    is_elastic = job.scenario.station.elasticity == "structure"
    payloads = [load]
    if is_elastic:  # how far joints yield shows between two loads
        payloads.append(0.0 if load > 0.0 else nominal.payload.largest_mass)
    tables = []
    for number, payload in enumerate(payloads):
        station = replace(job.scenario.station, payload=payload)
        try:
            record = MeasurementRun(replace(job.scenario, station=station)).measure(
                job.q, job.scenario.seed + number, lambda share: progress(share / len(payloads))
            )
        except RuntimeError as error:
            raise SimulationError(f"measurement run: {' '.join(str(error).split())}") from error
        tables.append(record.measured)
    table = tables[0] if len(tables) == 1 else tables[0].joined(tables[1])
    identified = identify(nominal, table, IdentificationConfig(compliance=is_elastic))
    return identified.calibrated_robot(job.scenario.robot)
