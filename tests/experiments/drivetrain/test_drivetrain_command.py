"""truetip drivetrain: the pictures open, and the numbers are those of the models."""

import json
from pathlib import Path

import pytest

from experiments.drivetrain.figures import efficiency_run
from tests.experiments.browser import open_page
from tests.experiments.commands import refusal, truetip


@pytest.mark.slow
def test_the_pictures_open_and_the_inverse_compensates(tmp_path: Path):
    result = truetip("drivetrain", "--report", tmp_path / "page.html", "--json", "-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["hysteresis"]["residual"] < 1e-12
    # With the table's parameters, and with psi = 100 and T = 5 ms.
    assert numbers["hysteresis"]["smooth_residual"]["table 2.1"] == pytest.approx(0.096, abs=1e-3)
    assert numbers["hysteresis"]["smooth_residual"]["sharper"] == pytest.approx(0.024, abs=1e-3)
    assert numbers["parts"]["stick_slip_friction"] == {"invertible": False}
    opened = open_page(tmp_path / "page.html")
    assert opened.console == []
    assert opened.dom.count("js-plotly-plot") >= 4


def test_the_gear_of_figure_2_4_starts_only_against_its_losses():
    """Friction of 5 N m and an efficiency of 0.9 let it creep until the ramp is at 5 / 0.9 N m."""
    times, speed, _ = efficiency_run()
    assert abs(speed[times < 0.1]).max() < 0.01  # where the smooth friction gives 4 N m
    assert speed[(times > 1.0) & (times < 1.5)].min() > 0.1


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    assert "cannot write" in refusal(truetip("drivetrain", "--report", tmp_path / "file" / "page.html"))
