"""A guided run that never comes to its path says why, and says it once."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from experiments.cli.prepare import prepare
from experiments.cli.workers import SimulationError
from experiments.station import guided_command
from experiments.station.guided_command import guide
from tests.experiments.synthetic import comparison


def test_a_run_that_ended_before_its_path_is_told_by_the_error_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    """The line stood there twice."""
    (log,) = comparison(period=0.1)["pbvs"]
    nothing = np.empty(0)
    record = SimpleNamespace(
        log=replace(log, time=nothing),
        ended="the controller fell silent",
        stamps=nothing,
        turn_around=nothing,
    )
    silent = SimpleNamespace(records={"pbvs": [record]}, link_json=lambda: {"runs": {}, "cell": None})
    monkeypatch.setattr(guided_command, "compare_on_station", lambda *_: silent)
    (tmp_path / "stage").mkdir()
    folders = (tmp_path / "stage", tmp_path / "out")
    with pytest.raises(
        SimulationError, match="law pbvs: before the path had begun: the controller fell silent"
    ):
        guide(Console(), folders, prepare("cell", []), ["pbvs"], 1, with_cell=False)
    assert capsys.readouterr().err == ""
    assert (tmp_path / "out" / "link.json").is_file()
