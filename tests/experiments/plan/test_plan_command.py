"""truetip plan: quicker and more frugal in the same limits, driven by the plant; wrong input is one line."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import Result

from experiments.cli.console import print_table
from experiments.plan.command import result_table
from experiments.plan.study import STILL
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Planned
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip

SMALL = (
    "x_mm, y_mm, z_mm, alpha_deg, beta_deg, gamma_deg\n1100, -40, 900, 0, 180, 0\n1100, 60, 900, 0, 180, 0\n"
)
# 604 mm across, level.
LINE = (
    "x_mm, y_mm, z_mm, alpha_deg, beta_deg, gamma_deg\n"
    "1421.85, -301.87, 1105.9, 180, 0, 180\n1421.85, 301.87, 1105.9, 180, 0, 180\n"
)


def run(folder: Path, *arguments: str) -> Result:
    return truetip("plan", f"--report={folder / 'out' / 'plan.html'}", *arguments)


@pytest.mark.slow
@pytest.mark.parametrize(("objective", "saved"), [("time", 0.92), ("energy", 0.85)])
def test_a_motion_of_three_axes_is_better_than_the_best_jerk_profile(
    tmp_path: Path, objective: str, saved: float
):
    result = run(tmp_path, "--path=joints", f"--objective={objective}", "--reserve=0", "--json=-")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["limits_kept"]
    assert found["baseline_limits_kept"]
    if objective == "time":
        assert found["time_s"] <= saved * found["baseline_s"]
    else:
        assert found["time_s"] == pytest.approx(found["baseline_s"])
        assert found["energy_j"] <= saved * found["baseline_energy_j"]
    assert found["criterion"] <= found["baseline_criterion"]
    assert found["iterations"] <= 60
    opened = open_page(tmp_path / "out" / "plan.html")
    assert not [line for line in opened.console if "rror" in line]
    assert opened.dom.count("js-plotly-plot") >= 2


@pytest.mark.slow
def test_a_line_is_written_as_a_path_from_pose_to_pose(tmp_path: Path):
    table, motion = tmp_path / "line.csv", tmp_path / "motion.csv"
    table.write_text(SMALL)
    result = run(
        *(tmp_path, f"--path={table}", "--dynamics=rigid", f"--write={motion}", "--program=krl", "--json=-")
    )
    assert result.exit_code == 0, result.output
    source = (tmp_path / "out" / "plan.src").read_text()
    assert "LIN_REL {X 0,Y 100,Z 0} #BASE" in source.replace("-0,", "0,")
    path = make_path(ReferenceConfig(Planned(str(motion))))
    ends = path.sample(np.array([0.0, path.dwell_start]))[0][:, :3, 3]
    assert ends == pytest.approx(np.array([[1.1, -0.04, 0.9], [1.1, 0.06, 0.9]]), abs=1e-6)
    times = np.linspace(0.0, path.dwell_start, 50)
    assert np.abs(path.sample(times)[0][:, [0, 2], 3] - [1.1, 0.9]).max() < 1e-6  # straight


@pytest.mark.slow
def test_a_law_keeps_to_a_planned_line_that_leaves_it_the_usual_reserve(tmp_path: Path):
    """It is late, as on any fast path without feedforward, but it stays with the motion and ends on it."""
    table, motion = tmp_path / "line.csv", tmp_path / "motion.csv"
    table.write_text(LINE)
    result = run(tmp_path, f"--path={table}", f"--write={motion}", "--json=-")
    assert result.exit_code == 0, result.output
    plan = json.loads(result.stdout)
    assert plan["limits_kept"]
    assert plan["legs"][0]["rigid_s"] < plan["time_s"] < plan["baseline_s"]
    assert plan["criterion"] <= max(plan["baseline_criterion"], STILL)
    driven = truetip(
        *("compare", f"--plan={motion}", "--robot=kr16", "--set=station.payload=16", "--cycles=1"),
        *("--laws=pbvs,position_level", f"--out={tmp_path / 'out'}", "--json=-"),
    )
    assert driven.exit_code == 0, driven.output
    for law in json.loads(driven.stdout)["runs"].values():
        assert law["true"]["max_norm_mm"] < 40.0
        assert max(law["true"]["static_mm"]) < 0.3


@pytest.mark.parametrize("width", [30, 80, 200])
def test_the_table_folds_names_and_never_cuts_a_number_off(width: int):
    numbers = ["12.345", "13.456", "-35.2", "123456", "234567", "+123.4", "0.010", "0.011"]
    name = "to somebody/robots/programs/welding_of_the_left_door.mod, line 123"
    console = Console(width=width, file=io.StringIO(), record=True)
    print_table(console, result_table("welding", [[name, *numbers, "kept"]] * 2))
    text = console.export_text()
    assert all(text.count(each) == 2 for each in numbers)
    assert "…" not in text


TABLES = {
    "start outside the limits": (
        "q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg\n200,-90,90,0,0,0\n0,-90,90,0,0,0\n",
        "joint 1 must be between -185 and 185 deg, but is at 200 deg at 0 % of the path",
    ),
    "no motion": (
        "q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg\n0,-90,90,0,0,0\n0,-90,90,0,0,0\n",
        "targets.csv, line 3: the motion ends where it starts: no joint moves",
    ),
    "hardly a motion": (
        "q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg\n0,-90,90,0,30,0\n0.000001,-90,90,0,30,0\n",
        "targets.csv, line 3: the motion is negligible: no joint moves by more than 1e-06 deg",
    ),
    "hardly a line": (SMALL.replace("60, 900", "-39.9999, 900"), "line 3: the motion is negligible"),
    "out of reach": (SMALL.replace("60, 900", "60, 2900"), "line 3"),
    "singular": (
        # The wrist passes straight over axis 1, where axis 1 would have to turn by half a turn at once.
        "x_mm, y_mm, z_mm, alpha_deg, beta_deg, gamma_deg\n-300, 0, 1700, 0, 0, 0\n300, 1, 1700, 0, 0, 0\n",
        "not smooth near",
    ),
    "one target": (SMALL.rsplit("\n", 2)[0] + "\n", "needs at least two targets, got 1"),
}


@pytest.mark.parametrize(("table", "message"), TABLES.values(), ids=TABLES)
def test_a_path_that_cannot_be_followed_is_refused_with_its_place(tmp_path: Path, table: str, message: str):
    (tmp_path / "targets.csv").write_text(table)
    assert message in refusal(run(tmp_path, f"--path={tmp_path / 'targets.csv'}"))
    assert files(tmp_path) == {"targets.csv"}


REFUSED = {
    "path": ("--path=circle", "--path must be rectangle, joints or a file that ends in"),
    "others": ("--with=config.dat", "--with counts for a program only, --path is rectangle"),
    "objective": ("--objective=speed", "--objective must be one of time, energy, front, got 'speed'"),
    "dynamics": ("--dynamics=soft", "--dynamics must be one of rigid, flexible_joint, elastic_structure"),
    "tool speed": ("--tool-speed=0", "the speed of the tool must be positive, got 0"),
    "duty": ("--duty=0", "the duty must be above 0 and at most 1, got 0"),
    "reserve": ("--reserve=1", "--reserve must be at least 0 and below 1, got 1"),
    "obstacles": ("--obstacles=boxes.yaml", "--obstacles counts on free ways only; give --free too"),
    "program": ("--program=vb", "--program must be one of rapid, krl, got 'vb'"),
    "payload": ("--payload=17", "payload of KUKA KR 16-2 must be between 0 and 16"),
}  # fmt: skip


@pytest.mark.parametrize(("option", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, option: str, message: str):
    assert message in refusal(run(tmp_path, option))
    assert files(tmp_path) == set()


def test_a_free_way_has_no_program(tmp_path: Path):
    message = refusal(run(tmp_path, "--path=joints", "--free", "--program=krl"))
    assert "--program has no move for a free way; leave out --free or use --write" in message
    assert files(tmp_path) == set()
