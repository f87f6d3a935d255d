"""truetip modes: its numbers are those of the analysis, its pages open, wrong input is one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from experiments.modes.study import SHOWN_MODES, TIP_MOTIONS
from robots.description.model import load_robot
from robots.dynamics.modes import ModalAnalysis, stretched
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip


def run(folder: Path, *arguments: str) -> Result:
    outputs = [f"--report={folder / 'modes.html'}", f"--animation={folder / 'motion.html'}"]
    return truetip("modes", *outputs, "--grid=3", *arguments)


def test_the_numbers_are_those_of_the_analysis(tmp_path: Path):
    result = run(tmp_path, "--robot=kr210", "--payload=100", "--json", "-")
    assert result.exit_code == 0, result.output
    numbers, robot = json.loads(result.stdout), load_robot("kr210")
    analysis = ModalAnalysis(robot, "structure", 100.0)
    expected = analysis.at(stretched(robot))
    found = numbers["stretched"]
    assert found["frequency_hz"] == pytest.approx(expected.frequency_hz[:SHOWN_MODES], rel=1e-6)
    assert found["damping_ratio"] == pytest.approx(expected.damping_ratio[:SHOWN_MODES], rel=1e-6)
    assert np.deg2rad(found["position_deg"]) == pytest.approx(stretched(robot))
    for share in found["energy_share"]:
        assert sum(share.values()) == pytest.approx(1.0)
    space = numbers["workspace"]
    assert space["axis_2_deg"] == pytest.approx([-140.0, -72.5, -5.0])
    middle = analysis.at(np.deg2rad([0.0, -72.5, space["axis_3_deg"][1], 0.0, 0.0, 0.0]))
    assert space["lowest_frequency_hz"][1][1] == pytest.approx(middle.frequency_hz[0], rel=1e-6)
    lowest = np.array(space["lowest_frequency_hz"])
    spread = {"min": lowest.min(), "median": np.median(lowest), "max": lowest.max()}
    assert space["frequency_hz"][0] == pytest.approx(spread)
    assert space["damping_ratio"][0]["min"] <= middle.damping_ratio[0] <= space["damping_ratio"][0]["max"]
    for place in (found, space):
        for motion, share in zip(place["tip_motion"], place["energy_share"], strict=True):
            assert set(motion) == set(TIP_MOTIONS)
            assert sum(motion.values()) == pytest.approx(sum(share.values()))


def test_shapes_say_what_the_two_slowest_modes_of_an_arm_do(tmp_path: Path):
    """Stretched ahead of the robot, it swings sideways by gear 1 and up and down by gear 2."""
    numbers = json.loads(run(tmp_path, "--robot=kr16", "--json", "-").stdout)["stretched"]
    for mode, motion, gear in ((0, "sideways", "deflection_1"), (1, "up/down", "deflection_2")):
        assert numbers["tip_motion"][mode][motion] > 0.95
        assert max(numbers["energy_share"][mode], key=numbers["energy_share"][mode].get) == gear
        assert max(map(abs, numbers["shape"][mode].values())) == 1.0


def test_sideways_is_meant_as_seen_from_the_robot_however_it_stands(tmp_path: Path):
    base = "base: {translation: [0, 0, 0], zyx_deg: [90, 0, 0], source: assumed}"
    (tmp_path / "turned.yaml").write_text(f"extends: kr16\n{base}\n")
    ahead, turned = (
        json.loads(run(tmp_path, f"--robot={name}", "--json", "-").stdout)
        for name in ("kr16", tmp_path / "turned.yaml")
    )
    for place in ("stretched", "workspace"):
        for mode, motion in enumerate(ahead[place]["tip_motion"]):
            assert turned[place]["tip_motion"][mode] == pytest.approx(motion, abs=1e-6)


def test_the_table_names_frequencies_and_what_yields(tmp_path: Path):
    result = run(tmp_path, "--robot=irb1200", "--elasticity=joints")
    assert result.exit_code == 0, result.output
    frequency = ModalAnalysis(load_robot("irb1200"), "joints", 7.0).at(stretched(load_robot("irb1200")))
    assert f"{frequency.frequency_hz[0]:.2f}" in result.stdout
    assert "gear 1 100%" in result.stdout
    assert "tilt" not in result.stdout


def test_a_mode_can_be_watched_live(tmp_path: Path):
    result = run(tmp_path, "--robot=kr16", "--shape=2", "--meshcat")
    assert result.exit_code == 0, result.output
    assert "Mode 2 swings at http://localhost:" in result.stdout


@pytest.mark.slow
def test_the_pages_open(tmp_path: Path):
    assert run(tmp_path, "--robot=kr16").exit_code == 0
    opened = open_page(tmp_path / "modes.html")
    assert opened.console == []
    assert "js-plotly-plot" in opened.dom
    moving = open_page(tmp_path / "motion.html")
    assert "mode 1 of KUKA KR 16-2" in moving.dom
    assert not [line for line in moving.console if "rror" in line]


def test_the_animation_stands_beside_the_page(tmp_path: Path):
    result = truetip("modes", f"--report={tmp_path / 'here' / 'arm.html'}", "--grid=2")
    assert result.exit_code == 0, result.output
    assert files(tmp_path) == {"here", "here/arm.html", "here/arm-animation.html"}


REFUSED = {
    "robot": ("--robot=kr211", "robot 'kr211': no file"),
    "payload": ("--payload=300", "payload of KUKA KR 210 R2700 extra must be between 0 and 210.0 kg"),
    "rigid": ("--elasticity=rigid", "elasticity must be joints or structure"),
    "elasticity": ("--elasticity=foam", "elasticity must be one of rigid, joints, structure, got 'foam'"),
    "grid": ("--grid=1", "--grid must be at least 2, got 1"),
    "shape": ("--shape=0", "--shape must be between 1 and 6, got 0"),
}  # fmt: skip


@pytest.mark.parametrize(("option", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, option: str, message: str):
    assert message in refusal(run(tmp_path, option))
    assert files(tmp_path) == set()
