"""The measurement run against a virtual cell over UDP, in real time: it calibrates as the simulated one."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams.runs.measurement import MeasurementRun
from diagrams.scenario.scenario import load_scenario
from experiments.station.measured_table import read_configurations
from robots.calibration.measurement_file import measurement_text
from tests.experiments.commands import truetip

FAULTS = [f"station.faults.{name}" for name in ("loss=0.05", "jitter=0.003", "reordering=0.02")]
# For a busy machine: a controller that waits for a client that is late.
PATIENT = ["station.link.run.timeout=5", "station.link.break_after=5"]


def done(*arguments: object) -> str:
    result = truetip(*arguments)
    assert result.exit_code == 0, result.output
    return result.output


def calibrated(folder: Path, table: Path) -> dict[str, Any]:
    numbers = folder / f"{table.stem}.json"
    done(
        "calibrate",
        "--scenario",
        "cell",
        "--measurements",
        table,
        "--out",
        folder / table.stem,
        "--json",
        numbers,
    )
    return json.loads(numbers.read_text())


@pytest.mark.slow
@pytest.mark.real_time
def test_a_calibration_recorded_with_faults_equals_the_simulated_one_within_its_standard_deviations(
    tmp_path: Path,
):
    design, measured, simulated = (tmp_path / f"{name}.csv" for name in ("design", "measured", "simulated"))
    done("design", "--count", "12", "--write", design)
    settings = [each for setting in (*FAULTS, *PATIENT) for each in ("--set", setting)]
    done("record", design, "--with-cell", "--speed", "1", "--write", measured, *settings)
    run = MeasurementRun(load_scenario("cell")).measure(read_configurations(design))
    simulated.write_text(measurement_text(run.measured))
    over_wire, other = calibrated(tmp_path, measured), calibrated(tmp_path, simulated)
    assert over_wire["names"] == other["names"]
    values, sigmas = ([np.array(each[name]) for each in (over_wire, other)] for name in ("values", "sigmas"))
    off = (values[0] - values[1]) / np.hypot(*sigmas)
    assert np.abs(off).max() < 3.5  # the largest of 30
    assert np.sqrt(np.mean(off**2)) < 1.5
