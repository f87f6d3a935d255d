"""truetip zeros: numbers as published, pages that open, wrong input in one line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.zeros.study import two_joint_arm_limit, two_joint_arm_zeros
from robots.dynamics.modal.flexible_body import beam_body
from robots.dynamics.modal.sid_file import sid_text
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip


def run(folder: Path, *arguments: str):
    return truetip("zeros", f"--report={folder / 'zeros.html'}", *arguments)


@pytest.mark.parametrize(("elasticity", "is_stable"), [("structure", False), ("joints", True)])
def test_a_robot_with_an_elastic_structure_has_no_stable_inverse_anywhere(
    tmp_path: Path, elasticity: str, is_stable: bool
):
    result = run(tmp_path, "--robot=kr210", f"--elasticity={elasticity}", "--grid=3", "--json", "-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["poses"] == 9
    assert numbers["poses_with_unstable_inverse"] == (0 if is_stable else 9)
    assert (numbers["slowest_rhp"] is None) == is_stable
    if not is_stable:
        assert numbers["slowest_rhp"] in [re for re, _ in numbers["zeros"]]
        assert numbers["slowest_rhp"] == min(min(row) for row in numbers["slowest_rhp_map"])


def test_axes_4_to_6_may_be_elsewhere(tmp_path: Path):
    def slowest(*wrist: str) -> np.ndarray:
        result = run(tmp_path, "--robot=kr210", "--grid=2", "--json", "-", *wrist)
        assert result.exit_code == 0, result.output
        return np.array(json.loads(result.stdout)["slowest_rhp_map"])

    same = slowest(f"--wrist=0,{float(np.rad2deg(0.7))},0")
    usual, bent, turned = slowest(), slowest("--wrist=0,80,0"), slowest("--wrist=90,40.107,0")
    np.testing.assert_allclose(same, usual, rtol=1e-6)
    assert np.abs(bent / usual - 1.0).max() > 1e-3
    assert np.abs(turned / usual - 1.0).max() > 1e-3
    assert "axes 4, 5 and 6 at 90, 40, 0 degrees" in (tmp_path / "zeros.html").read_text()


@pytest.mark.parametrize(
    ("wrist", "why"),
    [
        ("0,40", "--wrist must be three angles in degrees such as 0,40,0, got '0,40'"),
        ("0,200,0", "--wrist 0,200,0: axes 4 to 6 of KUKA"),
    ],
)
def test_a_wrist_that_cannot_be_is_refused(tmp_path: Path, wrist: str, why: str):
    assert why in refusal(run(tmp_path, f"--wrist={wrist}"))


def test_positions_of_an_arm_that_turns_further_are_counted_once_and_singular_ones_named(tmp_path: Path):
    result = run(tmp_path, "--robot=ur10", "--grid=4", f"--json={tmp_path / 'zeros.json'}")
    numbers = json.loads((tmp_path / "zeros.json").read_text())
    assert numbers["axis_2_deg"] == pytest.approx([-180.0, -60.0, 60.0, 180.0])
    singular = 16 - numbers["poses"]
    assert 0 < singular < 16
    assert f"Left out: {singular} positions where the arm is singular." in " ".join(result.stdout.split())
    assert "White: no such zero or the arm is singular." in (tmp_path / "zeros.html").read_text()


@pytest.mark.slow
def test_the_examples_give_the_published_figures(tmp_path: Path):
    arm = json.loads(run(tmp_path, "--example=two_joint_arm", "--json", "-").stdout)
    assert [re for re, _ in arm["zeros"]] == pytest.approx([-292.19, 305.58], abs=0.01)
    assert arm["largest_stable_x_l_m"] == pytest.approx(0.0625)
    beam = json.loads(run(tmp_path, "--example=beam", "--json", "-").stdout)
    assert beam["largest_stable_xi"]["clamped"]["1"] == pytest.approx(0.89, abs=2e-3)
    assert beam["largest_stable_xi"]["clamped"]["3"] == pytest.approx(0.309, abs=2e-3)
    assert beam["slowest_rhp"] > 0.0
    assert beam["decoupled"]["slowest_rhp"] is None
    observer = json.loads(run(tmp_path, "--example=observer", "--json", "-").stdout)
    assert observer["highest_bandwidth_hz"] == pytest.approx(48.63, abs=0.01)
    assert observer["relative_error"]["30"] == pytest.approx(0.48, abs=0.03)
    assert observer["relative_error"]["50"] is None
    virtual = json.loads(run(tmp_path, "--example=virtual_output", "--json", "-").stdout)
    assert all(re < 0.0 for re, _ in virtual["zeros"])
    assert (
        virtual["largest_deviation_mm"]["corrected"] < 0.02 < 20.0 < virtual["largest_deviation_mm"]["alone"]
    )


@pytest.mark.slow
def test_arms_with_beams_come_from_the_command(tmp_path: Path):
    """Figure 3.7: near the path with outputs at 0.9; figure 3.20: 1 < 2 << 3; and only C_t, C_r forbid it."""
    two = json.loads(run(tmp_path, "--example=two_beams", "--json", "-").stdout)
    assert two["slowest_rhp"] is None
    placed, rigid = (
        two["largest_deviation_mm"]["one mode, output at 0.9"],
        two["largest_deviation_mm"]["rigid"],
    )
    assert placed < 0.25 * rigid
    arm = json.loads(run(tmp_path, "--example=beam_arm", "--json", "-").stdout)
    first, second, third = arm["largest_deviation_mm"].values()
    assert first < 0.5 * second < 0.2 * third
    assert [name for name, value in arm["variants_mm"].items() if value is None] == ["5"]


@pytest.mark.slow
def test_the_arm_in_space_comes_from_the_command(tmp_path: Path):
    """Figures 3.16 to 3.18: C_t and C_r make the inverse unstable and weigh most, C_r's first order not."""
    arm = json.loads(run(tmp_path, "--example=spatial_arm", "--json", "-").stdout)
    assert arm["slowest_rhp"] > 100.0
    assert arm["simplified"]["slowest_rhp"] is None
    off = arm["load_off_mm"]
    assert off["variant 5"] < 0.05 * off["variant 4"]
    assert all(off[f"variant {n}"] == pytest.approx(off["variant 4"], rel=0.1) for n in (1, 2, 3))
    assert 3.0 * off["variant 1"] < off["rigid"]
    lowest = [row[0] for row in arm["frequencies_by_modes_hz"].values()]
    assert lowest == sorted(lowest, reverse=True)  # more modes, less stiff
    assert lowest[2] - lowest[3] < 0.5 * (lowest[1] - lowest[2])


@pytest.mark.slow
def test_the_page_opens(tmp_path: Path):
    assert run(tmp_path, "--robot=kr16", "--grid=3").exit_code == 0
    opened = open_page(tmp_path / "zeros.html")
    assert opened.console == []
    assert "js-plotly-plot" in opened.dom


def test_the_published_zeros_of_the_two_joint_arm():
    """Reiner (2010), section 3.5.3; the printed zeros belong to c = 1e6, d = 150, not to c = 1e5, d = 15."""
    assert np.real(two_joint_arm_zeros(0.5).values) == pytest.approx([-292.1857, 305.5786], abs=1e-3)
    softer = np.real(two_joint_arm_zeros(0.5, stiffness=1e5, damping=15.0).values)
    assert softer == pytest.approx([-93.8238, 95.1631], abs=1e-3)


def test_the_two_joint_arm_is_minimum_phase_up_to_the_limit_of_the_source():
    limit = two_joint_arm_limit()
    assert limit == pytest.approx(0.0625)
    assert two_joint_arm_zeros(0.999 * limit).is_minimum_phase
    assert not two_joint_arm_zeros(1.001 * limit).is_minimum_phase


def test_a_body_of_a_file_on_a_joint(tmp_path: Path):
    (tmp_path / "beam.sid").write_text(sid_text(beam_body(2.0, 3.0, 500.0, 8, 3)))
    result = run(tmp_path, f"--body={tmp_path / 'beam.sid'}", "--payload=1.35", "--json", "-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["nodes"]["3"] is None  # a quarter of the way
    assert numbers["nodes"]["9"] == numbers["slowest_rhp"] > 0.0
    assert (tmp_path / "zeros.html").exists()


def test_nodes_of_a_body_may_be_in_any_order(tmp_path: Path):
    """The nearest node with an unstable inverse is named, not the first one of the file."""
    beam = beam_body(2.0, 3.0, 500.0, 8, 3)
    order = [0, 7, 6, 5, 4, 3, 2, 1, 8]
    shuffled = replace(beam, places=beam.places[order], shapes=beam.shapes[order], turns=None)
    (tmp_path / "beam.sid").write_text(sid_text(shuffled))
    result = run(tmp_path, f"--body={tmp_path / 'beam.sid'}", "--payload=1.35")
    words = " ".join(result.output.split())
    assert "unstable with 6 of 8 nodes as its output, the nearest is node 6, 0.750 m from it" in words


REFUSED = {
    "body": ("--body=nothing.sid", "nothing.sid"),
    "robot": ("--robot=kr211", "robot 'kr211': no file"),
    "example": (
        "--example=bridge",
        "must be one of two_joint_arm, beam, two_beams, driven_beam, beam_arm, spatial_arm, observer, "
        "virtual_output, prefilter, got 'bridge'",
    ),
    "rigid": ("--elasticity=rigid", "elasticity must be joints or structure"),
    "grid": ("--grid=1", "--grid must be at least 2, got 1"),
    "singular": ("--robot=ur10 --grid=2", "axes 2 and 3 with axes 4 to 6 at 0,40.1,0 degrees"),
    "singular wrist": ("--robot=ur10 --grid=2", "another --wrist or a larger --grid may have others"),
    "example of a robot": ("--example=beam --robot=kr210", "--robot has no effect with --example"),
    "load of an example": ("--payload=3 --example=beam", "--payload has no effect with --example"),
    "body on a grid": ("--body=nothing.sid --grid=15", "--grid has no effect with --body"),
}  # fmt: skip


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, options: str, message: str):
    assert message in refusal(run(tmp_path, *options.split()))
    assert files(tmp_path) == set()
