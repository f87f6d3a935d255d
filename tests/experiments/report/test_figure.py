"""The still figure of a comparison."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.comparison.figure import LEFT, RIGHT, WIDTH, write_figure


def log(end: float) -> Any:
    """A run of so many seconds whose tip is off by a millimetre, as far as the figure looks at it."""
    time = np.linspace(0.0, end, 50)
    wanted = np.tile(np.eye(4), (50, 1, 1))
    true = wanted.copy()
    true[:, 0, 3] = 1e-3
    ends = {"path_start": 1.0, "dwell_start": end - 0.5, "path_end": end}
    return SimpleNamespace(time=time, X_WE_desired=wanted, X_WE_true=true, **ends)


@pytest.mark.parametrize("ends", [(4.0, 6.0), (6.0, 4.0), (5.0, 5.0)])
def test_the_longest_run_fills_the_width_and_none_leaves_the_plot(ends, tmp_path):
    logs = {law: log(end) for law, end in zip(("open_loop", "self_calibrating"), ends, strict=True)}
    write_figure(tmp_path / "figure.svg", "runs of different length", logs)
    lines = re.findall(r'<polyline points="([^"]*)"', (tmp_path / "figure.svg").read_text())
    last = [float(line.split()[-1].split(",")[0]) for line in lines]
    assert len(last) == 2
    assert max(last) == pytest.approx(WIDTH - RIGHT, abs=0.1)
    shortest = LEFT + (WIDTH - LEFT - RIGHT) * min(ends) / max(ends)
    assert min(last) == pytest.approx(shortest, abs=0.1)
