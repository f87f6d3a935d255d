"""compare --plan: a motion from a file in place of the path of a scenario."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.scenario import load_scenario
from experiments.plan.plan_option import plan_settings
from robots.description.model import load_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.planned_file import planned_text
from systems.reference.shapes import Circle, Planned
from tests.experiments.commands import files, refusal, truetip

PERIOD = 4e-3


@pytest.fixture(scope="module")
def motion(tmp_path_factory) -> Path:
    """A small circle of the IRB 1200 in about three seconds."""
    path = make_path(ReferenceConfig(Circle(), acceleration=2.0, timing="polynomial", dwell=0.0))
    times = PERIOD * np.arange(int(np.ceil(path.duration / PERIOD)) + 1)
    X = path.sample(times)[0]
    home = np.deg2rad(load_scenario("nominal").home_deg)
    q = InverseKinematics(load_robot("irb1200")).along(X, home)
    file = tmp_path_factory.mktemp("plan") / "circle.csv"
    file.write_text(planned_text(times, X, q))
    return file


def test_the_scenario_takes_the_path_and_begins_where_it_does(motion: Path):
    scenario = load_scenario("nominal", plan_settings(str(motion)))
    assert scenario.reference.path == Planned(str(motion))
    start = InverseKinematics(load_robot("irb1200")).nearest(
        make_path(scenario.reference).sample(0.0)[0], np.deg2rad(scenario.home_deg)
    )
    assert np.rad2deg(start) == pytest.approx(scenario.home_deg, abs=1e-6)
    assert plan_settings(None) == []


@pytest.mark.slow
def test_a_law_follows_it_as_it_follows_the_path_that_was_written(tmp_path: Path, motion: Path):
    circle = ["path=circle", "acceleration=2", "timing=polynomial"]
    off = []
    for way in ([f"--plan={motion}"], [f"--set=reference.{each}" for each in circle]):
        result = truetip(
            *("compare", "--scenario=nominal", "--laws=numerical_ik", "--cycles=1", "--json=-"),
            *("--set=reference.settle=0.5", "--set=reference.dwell=0.6", f"--out={tmp_path}"),
            *way,
        )
        assert result.exit_code == 0, result.output
        off.append(json.loads(result.stdout)["runs"]["numerical_ik"]["true"]["max_norm_mm"])
    assert off[0] == pytest.approx(off[1], rel=0.01)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path):
    result = truetip("compare", f"--plan={tmp_path / 'none.csv'}", f"--out={tmp_path / 'out'}")
    assert "none.csv: no such file" in refusal(result)
    assert files(tmp_path) == set()


def test_a_planned_path_is_not_carried_over_to_another_robot(tmp_path: Path, motion: Path):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(f"extends: nominal\nreference:\n  path: !Planned {{file: '{motion}'}}\n")
    result = truetip("compare", f"--scenario={scenario}", "--robot=kr16", f"--out={tmp_path / 'out'}")
    assert "a planned path belongs to the robot for which it was planned" in refusal(result)
