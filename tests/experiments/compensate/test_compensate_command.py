"""``truetip compensate`` from file to file: what it writes, shows and refuses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.calibration.identification import identify
from robots.calibration.measurements import Measurements
from robots.description.model import load_robot
from robots.description.robot_file import robot_text
from robots.kinematics.forward import Kinematics
from tests.experiments.commands import files, refusal, truetip
from tests.robots.programs.written import configurations, rapid_module, with_random_errors


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot calibrated without noise and a program of 20 targets."""
    folder, nominal = tmp_path_factory.mktemp("compensate"), load_robot("irb1200")
    q = np.random.default_rng(0).uniform(0.9 * nominal.lower, 0.9 * nominal.upper, (60, 6))
    X = Kinematics(with_random_errors(nominal, 2)).forward(q)
    found = identify(nominal, Measurements(q, X[:, :3, 3], X[:, :3, :3]))
    (folder / "robot.yaml").write_text(robot_text(found.calibrated_robot("irb1200")))
    (folder / "m.mod").write_bytes(rapid_module(nominal, configurations(20, 7)).encode())
    return folder


def options(folder: Path, **changes: object) -> list[object]:
    named = {
        "robot": folder / "robot.yaml",
        "out": folder / "new.mod",
        "report": folder / "page.html",
    } | changes
    return [f"--{name}={value}" for name, value in named.items()]


@pytest.mark.slow
def test_from_a_module_to_a_corrected_one(folder: Path):
    result = truetip("compensate", folder / "m.mod", *options(folder, json="-"))
    found = json.loads(result.stdout)
    assert found["error_before_mm"] > 5.0
    assert found["error_after_mm"] < 1e-6
    assert 1e-6 < found["error_in_single_precision_mm"] < 1e-3  # 24 bits of 700 mm are 6e-5 mm
    assert [target["name"] for target in found["targets"]] == [f"p{number}" for number in range(20)]
    old, new = ((folder / name).read_bytes().split(b"\r\n") for name in ("m.mod", "new.mod"))
    changed = [number for number, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
    assert changed == list(range(2, 22))
    page = (folder / "page.html").read_text()
    assert "p19" in page
    assert "to limit" in page


def test_one_target_and_one_place_are_counted_as_such(folder: Path, tmp_path: Path):
    text = rapid_module(load_robot("irb1200"), configurations(1, 7))
    own = "CONST robtarget own:=[[reach+10,0,500],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    text = text.replace("  PROC main()", f"{own}\r\n  PROC main()\r\n    MoveL own,v100,z10,tool0\\WObj:=w;")
    (tmp_path / "one.mod").write_bytes(text.encode())
    changes = {"out": tmp_path / "new.mod", "report": tmp_path / "page.html"}
    result = truetip("compensate", tmp_path / "one.mod", *options(folder, **changes))
    said = " ".join(result.output.split())
    assert "1 target is moved by up to" in said
    assert "1 place is left alone or to be looked at." in said


def test_a_target_may_stay_as_it_is(folder: Path):
    found = json.loads(truetip("compensate", folder / "m.mod", *options(folder, json="-", keep="p3")).stdout)
    assert len(found["targets"]) == 19
    assert (folder / "new.mod").read_bytes().split(b"\r\n")[5] == (folder / "m.mod").read_bytes().split(
        b"\r\n"
    )[5]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"robot": "irb1200"}, "nominal robot"),
        ({"keep": "p99"}, "--keep p99"),
        ({"out": "new.src"}, r"must end in \.mod"),
        ({"near": "1,2"}, "--near must be six angles"),
        ({"payload": 99}, "--payload must be 0 to 7 kg"),
    ],
)
def test_refusals_in_one_line_leave_nothing(folder: Path, tmp_path: Path, change: dict, message: str):
    named = {"out": tmp_path / "new.mod", "report": tmp_path / "page.html"} | change
    assert re.search(message, refusal(truetip("compensate", folder / "m.mod", *options(folder, **named))))
    assert not files(tmp_path)


@pytest.mark.slow
def test_what_was_calibrated_on_a_calibrated_robot_corrects_nothing(folder: Path, tmp_path: Path):
    written = tmp_path / "robot.yaml"
    robot = load_robot(str(folder / "robot.yaml"))
    again = replace(robot, calibration=replace(robot.calibration, of=str(written)))
    written.write_text(robot_text(again))  # of itself
    named = {"robot": written, "out": tmp_path / "new.mod", "report": tmp_path / "page.html"}
    assert "which is calibrated itself" in refusal(
        truetip("compensate", folder / "m.mod", *options(folder, **named))
    )
    assert files(tmp_path) == {"robot.yaml"}


def test_a_target_out_of_reach_is_named_by_its_line_and_nothing_is_written(folder: Path, tmp_path: Path):
    far = tmp_path / "far.mod"
    far.write_text(re.sub(r"p4:=\[\[[^,]*", "p4:=[[9999", (folder / "m.mod").read_text()))
    result = truetip(
        "compensate", far, *options(folder, out=tmp_path / "new.mod", report=tmp_path / "page.html")
    )
    assert "line 7: p4: out of reach" in refusal(result)
    assert files(tmp_path) == {"far.mod"}


def test_a_target_with_an_expression_is_left_alone_and_named_and_the_others_are_corrected(
    folder: Path, tmp_path: Path
):
    own = "CONST robtarget own:=[[reach+10,0,500],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    text = (folder / "m.mod").read_bytes().decode()
    text = text.replace("  PROC main()", f"{own}\r\n  PROC main()\r\n    MoveL own,v100,z10,tool0\\WObj:=w;")
    (tmp_path / "m.mod").write_bytes(text.encode())
    changes = {"out": tmp_path / "new.mod", "report": tmp_path / "page.html"}
    result = truetip("compensate", tmp_path / "m.mod", *options(folder, **changes))
    assert result.exit_code == 0, result.output
    assert "own has expressions" in " ".join(result.output.split())
    old, new = text.split("\r\n"), (tmp_path / "new.mod").read_bytes().decode().split("\r\n")
    changed = [a for a, b in zip(old, new, strict=True) if a != b]
    assert len(changed) == 20
    assert all(line.startswith("CONST robtarget p") for line in changed)


def test_a_program_in_utf_16_is_refused_and_not_written_without_a_correction(folder: Path, tmp_path: Path):
    wide = tmp_path / "wide.mod"
    wide.write_text((folder / "m.mod").read_text(), encoding="utf-16")
    result = truetip(
        "compensate", wide, *options(folder, out=tmp_path / "new.mod", report=tmp_path / "page.html")
    )
    assert "wide.mod: saved as UTF-16, which controllers do not read" in refusal(result)
    assert files(tmp_path) == {"wide.mod"}


def test_a_table_of_metres_below_heads_of_millimetres_is_doubted_before_it_is_corrected(
    folder: Path, tmp_path: Path
):
    table = tmp_path / "m.csv"
    table.write_text("x_mm,y_mm,z_mm,qw,qx,qy,qz\n0.4,0.1,0.5,0,0,1,0\n0.45,-0.1,0.55,0,0,1,0\n")
    changes = {"out": tmp_path / "new.csv", "report": tmp_path / "page.html"}
    result = truetip("compensate", table, *options(folder, **changes))
    assert result.exit_code == 0, result.output
    assert "if they are in m, its columns are x_m, y_m and z_m" in " ".join(result.output.split())
