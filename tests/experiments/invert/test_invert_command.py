"""truetip invert: its numbers are those of its runs, its page opens, wrong input is one line."""

import json
from pathlib import Path

import pytest
from typer.testing import Result

from experiments.invert.study import KINDS
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip


def run(folder: Path, *arguments: str) -> Result:
    return truetip("invert", f"--report={folder / 'invert.html'}", "--jobs=2", *arguments)


@pytest.mark.slow
def test_the_stable_inverse_of_a_kr210_leaves_a_quarter_of_the_best_causal_one(tmp_path: Path):
    result = run(tmp_path, "--robot=kr210", "--json=-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert set(numbers["criterion"]) == set(KINDS)
    assert numbers["positions"] == 4
    assert numbers["not_converged"] == 0
    assert numbers["ratio_stable"] <= 0.25
    assert numbers["worst_ratio_stable"] <= 0.4
    assert 0.0 < numbers["seconds"] < 60.0
    opened = open_page(tmp_path / "invert.html")
    assert not [line for line in opened.console if "rror" in line]
    assert opened.dom.count("js-plotly-plot") >= 2


@pytest.mark.slow
def test_after_a_rehearsal_wrong_springs_cost_little(tmp_path: Path):
    """Which otherwise leave no more of its advantage over a causal one."""
    result = run(tmp_path, "--robot=kr210", "--grid=1", "--spring-error=0.2", "--rehearse", "--json=-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["ratio_stable"] > 0.6
    assert numbers["rehearsed"]["ratio_stable"] <= 0.4
    assert "rehearsed" in (tmp_path / "invert.html").read_text()


REFUSED = {
    "robot": ("--robot=kr211", "robot 'kr211': no file"),
    "parts": ("--robot=kr16-realistic", "have parts beyond springs, dampers and friction"),
    "grid": ("--grid=0", "--grid and --seeds must be at least 1, got 0 and 1"),
    "springs": ("--spring-error=1", "--spring-error must be from 0 to below 1, got 1"),
    "rehearsal": ("--rehearse", "--rehearse learns springs that are off: give --spring-error too"),
    "seeds": ("--seeds=3", "--seeds has no effect without --spring-error: all robots are the same"),
    "angle": ("--angle=0", "--angle must be up to 45 degrees and not zero, got 0"),
    "jobs": ("--jobs=0", "--jobs must be at least 1, got 0"),
}  # fmt: skip


@pytest.mark.parametrize(("option", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, option: str, message: str):
    assert message in refusal(run(tmp_path, option))
    assert files(tmp_path) == set()
