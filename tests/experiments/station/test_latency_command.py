"""A measurement of delays that failed ends with 1, says why, and leaves no file."""

import pytest
from typer.testing import CliRunner

from experiments.main import app
from experiments.station import latency_command
from experiments.station.latency import ImpossibleDelayError

pytestmark = pytest.mark.real_time


def test_a_failed_measurement_leaves_nothing_behind(tmp_path, monkeypatch: pytest.MonkeyPatch):
    def fails(record):
        raise ImpossibleDelayError("the measurement failed: the loop takes -3.00 ms +- 0.10 ms")

    monkeypatch.setattr(latency_command, "_measured", lambda *given: None)
    monkeypatch.setattr(latency_command, "evaluate", fails)
    page, yaml, numbers = (tmp_path / name for name in ("page.html", "found.yaml", "found.json"))
    options = ["--with-cell", "--report", str(page), "--write", str(yaml), "--json", str(numbers)]
    result = CliRunner().invoke(app, ["latency", *options])
    assert result.exit_code == 1
    assert "-3.00 ms +- 0.10 ms; nothing was written" in result.stderr
    assert not list(tmp_path.iterdir())
