"""Tables of poses and joints: what their columns have to be, and which rows and units are doubted."""

from pathlib import Path

import pytest

from robots.programs.program import ProgramError, Source
from robots.programs.read import parse_program, unit_in_doubt

JOINT_HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSE_HEAD = "x_mm,y_mm,z_mm,qw,qx,qy,qz"


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ("x_mm,y_mm\n1,2\n", "line 1: column z_mm or z_m is missing"),
        ("q1,q2,q3,q4,q5,q6\n1,2,3,4,5,6\n", "line 1: column q1_deg or q1_rad is missing; there are q1, q2"),
        ("x_mm,y_mm,z_mm,qw,qx,qy,qz,q1_deg\n", "poses and joint positions"),
        (f"{JOINT_HEAD},beta_deg\n1,2,3,4,5,6,7\n", "poses and joint positions"),
        (f"{JOINT_HEAD},q2_rad\n1,2,3,4,5,6,7\n", "line 1: q2_deg and q2_rad say the same"),
        (f"{POSE_HEAD},x_m\n1,2,3,1,0,0,0,0.001\n", "line 1: x_mm and x_m say the same"),
        (f"{POSE_HEAD},alpha_deg\n1,2,3,1,0,0,0,0\n", "line 1: qw and alpha_deg say the same"),
        ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\na,b,c,d,e,f\n", "no row of numbers"),
    ],
)
def test_a_table_without_targets_is_refused(text: str, refusal: str):
    with pytest.raises(ProgramError, match=refusal):
        parse_program(Source("m.csv", text))


def test_a_row_may_end_before_its_name_and_one_with_an_impossible_load_is_named():
    head = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,payload_kg,name"
    text = f"{head}\n1,2,3,4,5,6,3,one\n1,2,3,4,5,6,3\n1,2,3,4,5,6,-3\n"
    program = parse_program(Source("t.csv", text))
    assert [(each.line, each.name, each.payloads) for each in program.targets] == [
        (2, "one", (3.0,)),
        (3, "", (3.0,)),
    ]
    assert [(note.line, note.text) for note in program.notes] == [
        (4, "payload_kg must not be negative, got -3, row left alone")
    ]


@pytest.mark.parametrize(
    ("head", "good", "bad", "why"),
    [
        (
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg",
            "1,2,3,4,5,6,,",
            "1,5,2,0,3,0,4,0,5,0,6,0",  # decimal commas between commas
            "there are 12 values for 6 columns",
        ),
        (
            "x_mm,y_mm,z_mm,qw,qx,qy,qz",
            "600,0,900,0.71,0,0.7,0",
            "600,0,900,0.07071,0,0.7071,0",
            "the quaternion has the length 0.7106, not 1",
        ),
    ],
)
def test_a_row_that_cannot_be_meant_as_it_stands_is_left_alone_and_named(
    head: str, good: str, bad: str, why: str
):
    program = parse_program(Source("t.csv", f"{head}\n{good}\n{bad}\n"))
    assert [each.line for each in program.targets] == [2]
    assert [(note.line, note.text) for note in program.notes] == [(3, f"{why}, row left alone")]


@pytest.mark.parametrize(
    ("rows", "is_doubted"),
    [
        ("0.17,-1.2,1.4,-0.35,1.05,0.5\n0.5,-1.1,1.3,-0.7,0.9,0.2", True),
        ("10,-70,80,-20,60,30\n30,-60,70,-40,50,10", False),
        ("0,-5,5,0,0,0\n0,5,-5,0,1.5,0", False),  # some degrees about zero
    ],
)
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_radians_below_heads_of_degrees_are_doubted(tmp_path: Path, rows: str, is_doubted: bool, unit: str):
    path = tmp_path / "joints.csv"
    path.write_text(",".join(f"q{joint}_{unit}" for joint in range(1, 7)) + f"\n{rows}\n")
    assert bool(unit_in_doubt(path)) is (is_doubted and unit == "deg")
    assert not unit_in_doubt("rectangle")


@pytest.mark.parametrize(
    ("places", "is_doubted"),
    [
        ("0.4,0.1,0.55", True),
        ("0.4,-3.1,0", True),
        ("400,100,550.5", False),
        ("0,0,0", False),
        ("1,0,-2", False),  # millimetres about the origin of a world that is not in the robot
    ],
)
@pytest.mark.parametrize("unit", ["mm", "m"])
def test_metres_below_heads_of_millimetres_are_doubted(
    tmp_path: Path, places: str, is_doubted: bool, unit: str
):
    path = tmp_path / "places.csv"
    path.write_text(POSE_HEAD.replace("mm", unit) + f"\n{places},0,0,1,0\n")
    says = "places.csv: all numbers of x_mm, y_mm and z_mm are within 5 mm of zero; if they are in m,"
    assert unit_in_doubt(path).partition(says)[1] == (says if is_doubted and unit == "mm" else "")


@pytest.mark.parametrize("row", ["400,,500,0,0,1,0", "400", '400,"",500,0,0,1,0'])
def test_a_number_that_is_missing_is_named_by_its_column(row: str):
    program = parse_program(Source("t.csv", f"{POSE_HEAD}\n400,100,500,0,0,1,0\n{row}\n"))
    assert [note.text for note in program.notes] == ["the number of y_mm is missing, row left alone"]
