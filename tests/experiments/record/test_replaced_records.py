"""Records of an earlier run are not taken for those of a new one in the same folder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.log import RunLog
from experiments.metrics.run_metrics import summary
from experiments.record.replaced import replaced_records
from experiments.record.simulated import write_records
from experiments.report.files import write_json
from tests.experiments.commands import files
from tests.experiments.synthetic import comparison


@pytest.fixture(scope="module")
def logs() -> dict[str, list[RunLog]]:
    return comparison(period=0.1, cycles=2)


def results(folder: Path, logs: dict[str, list[RunLog]], has_records: bool = True) -> None:
    """What a command leaves."""
    write_json(folder / "summary.json", summary("", logs))
    if has_records:
        write_records(folder, "", logs)


@pytest.mark.parametrize("has_records", [True, False])
def test_records_of_a_simulation_are_replaced_as_its_other_results_are(
    has_records: bool, logs: dict[str, list[RunLog]], tmp_path: Path
):
    results(tmp_path, {"pbvs": logs["pbvs"], "open_loop": logs["open_loop"]})
    (tmp_path / "mine.mcap").write_text("of somebody else")
    with replaced_records(tmp_path):
        results(tmp_path, {"pbvs": logs["pbvs"][:1]}, has_records)
    new = {"pbvs-1.mcap"} if has_records else set()
    assert files(tmp_path) == {"summary.json", "mine.mcap", *new}


def test_a_run_that_fails_leaves_the_records_before_it(logs: dict[str, list[RunLog]], tmp_path: Path):
    results(tmp_path, {"pbvs": logs["pbvs"]})
    with pytest.raises(RuntimeError, match="broke off"), replaced_records(tmp_path):
        raise RuntimeError("broke off")
    assert files(tmp_path) == {"summary.json", "pbvs-1.mcap", "pbvs-2.mcap"}


def test_what_was_recorded_on_a_station_stays_and_is_named(
    logs: dict[str, list[RunLog]], tmp_path: Path, capsys: pytest.CaptureFixture
):
    """No simulation makes it again."""
    (log,) = logs["pbvs"][:1]
    results(tmp_path, {"pbvs": [replace(log, X_WE_true=np.full_like(log.X_WE_true, np.nan))]})
    with replaced_records(tmp_path):
        results(tmp_path, {"open_loop": logs["open_loop"][:1]})
    assert files(tmp_path) == {"summary.json", "pbvs-1.mcap", "open_loop-1.mcap"}
    assert "pbvs-1.mcap is of an earlier run and stays" in capsys.readouterr().err
