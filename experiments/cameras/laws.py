"""Effect of the camera model on each servo law: the same run with different cameras."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from experiments.cli.prepare import prepare
from experiments.cli.workers import Executor, Progress, in_order
from experiments.comparison.compare import RunJob, compared_laws, run_job
from experiments.metrics.run_metrics import error_metrics
from systems.cell.cameras import CAMERAS
from systems.servo import LAWS
from systems.servo.contract import law_traits

FRAME_RATES = (31.25, 62.5, 125.0, 250.0)  # Hz


@dataclass(frozen=True)
class LawResult:
    """One law with one camera."""

    law: str
    camera: str
    rate_hz: float
    errors: dict[str, Any]  # `experiments.metrics.run_metrics.error_metrics` of the true errors


def study_laws(
    scenario: str,
    settings: Sequence[str],
    is_quick: bool,
    executor: Executor,
    progress: Progress | None = None,
) -> list[LawResult]:
    """The laws with each camera, and the first law with fewer frames.

    Raises:
        ValueError: if a scenario is wrong.
        SimulationError: if a run broke off.
    """
    laws = [law for law in compared_laws() if law_traits(LAWS[law]).uses_camera]
    rate = 1.0 / prepare(scenario, settings).scenario.station.camera.period
    # Images take longest, so they come first.
    runs = [(law, camera, rate) for camera in reversed(CAMERAS) for law in laws]
    runs += [(laws[0], "features", each) for each in FRAME_RATES if abs(each - rate) > 1e-6]
    jobs = [_law_job(scenario, settings, is_quick, *each) for each in runs]
    logs = in_order(executor, run_job, jobs, progress)
    results = [
        LawResult(law, camera, each, error_metrics(log, "true"))
        for (law, camera, each), log in zip(runs, logs, strict=True)
    ]
    order = {camera: number for number, camera in enumerate(CAMERAS)}
    return sorted(results, key=lambda result: (laws.index(result.law), order[result.camera], -result.rate_hz))


def _law_job(
    scenario: str, settings: Sequence[str], is_quick: bool, law: str, camera: str, rate: float
) -> RunJob:
    own = [f"station.camera.kind={camera}", f"station.camera.period={1.0 / rate:.12g}"]
    prepared = prepare(scenario, [*settings, *own], None, is_quick)
    return RunJob(prepared.scenario, prepared.robot, law, prepared.scenario.seed)
