"""The legs of a file: every place that it moves to, in the order in which it does, or a refusal."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.feedforward.rectangle import working_position
from experiments.plan.legs import Leg, legs_of
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.planning.limits import motion_limits
from robots.planning.rigid_start import quickest_rigid
from tests.robots.programs.test_languages import EXTERNAL

KR16 = load_robot("kr16")
HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSES = "x_mm,y_mm,z_mm,qw,qx,qy,qz"
UNREADABLE = {
    "no number": (HEAD, "10,nan,90,0,30,0", "q2_deg is not a number: 'nan'"),
    "typing error": (HEAD, "10,-80,9o,0,30,0", "q3_deg is not a number: '9o'"),
    "short row": (HEAD, "10,-80", "the number of q3_deg is missing"),
    "long row": (HEAD, "10,-80,90,0,30,0,5", "there are 7 values for 6 columns"),
    "beyond all numbers": (HEAD, "1e999,-80,90,0,30,0", "a number is infinite"),
    "no rotation": (POSES, "1100,0,900,0,0,0,0", "the quaternion is zero"),
}


@pytest.mark.parametrize(("head", "row", "why"), UNREADABLE.values(), ids=UNREADABLE)
def test_a_way_point_that_cannot_be_read_is_refused_and_never_passed_by(
    tmp_path: Path, head: str, row: str, why: str
):
    first, last = ("1100,-40,900,0,1,0,0", "1100,60,900,0,1,0,0") if head is POSES else (
        "0,-90,90,0,30,0", "20,-80,90,0,30,0"
    )  # fmt: skip
    table = tmp_path / "way.csv"
    table.write_text("\n".join([head, first, row, last, ""]))
    with pytest.raises(ValueError, match="line 3") as refused:
        legs_of(KR16, str(table))
    assert str(refused.value).startswith(f"{table}, line 3: {why}")


A, C = [1.12, -0.377, 0.804], [1.195, 0.377, 1.257]  # m
DECLARED = "\n".join(
    f"CONST robtarget {name}:=[[{place}],[0,0,1,0],[0,0,0,0],{EXTERNAL}];"
    for name, place in {"a": "1120,-377,804", "c": "1195,377,1257"}.items()
)
JOINTS = f"CONST jointtarget j:=[[10,-70,80,0,40,0],{EXTERNAL}];"


def written(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def places(legs: list[Leg]) -> np.ndarray:
    ends = [legs[0].path.at(np.zeros(1)), *(leg.path.at(np.ones(1)) for leg in legs)]
    return Kinematics(KR16).forward(np.concatenate(ends))[:, :3, 3]


def test_a_program_is_planned_as_it_moves_not_as_it_declares(tmp_path: Path):
    """A joint move to a pose ends there too, but not along a line; a line may begin where joints do."""
    moves = ["MoveL c", "MoveL a", "MoveJ c", "MoveAbsJ j", "MoveL a", "MoveL CalcRobT(j,tool0)"]
    body = "".join(f"{move},v100,fine,tool0;\n" for move in moves)
    text = f"MODULE m\n{DECLARED}\n{JOINTS}\nPROC main()\n{body}ENDPROC\nENDMODULE\n"
    legs = legs_of(KR16, written(tmp_path, "m.mod", text))
    j = Kinematics(KR16).forward(np.deg2rad([10.0, -70.0, 80.0, 0.0, 40.0, 0.0]))[:3, 3]
    assert places(legs) == pytest.approx(np.array([C, A, C, j, A, j]), abs=1e-6)
    assert [leg.is_straight for leg in legs] == [True, False, False, True, True]
    assert legs[0].name == f"to {tmp_path / 'm.mod'}, line 7"


def test_krl_goes_to_the_targets_of_its_data_list(tmp_path: Path):
    pose = "A 0,B 180,C 0}"
    a, c = f"{{X 1120,Y -377,Z 804,{pose}", f"{{X 1195,Y 377,Z 1257,{pose}"
    data = f"DEFDAT m\nDECL E6POS XA={a}\nDECL E6POS XC={c}\nENDDAT"
    source = "DEF m()\n$TOOL=$NULLFRAME\nLIN XC\nLIN XA C_DIS\nPTP XC\nEND\n"
    path = written(tmp_path, "m.src", source)
    legs = legs_of(KR16, path, [written(tmp_path, "m.dat", data)])
    assert places(legs) == pytest.approx(np.array([C, A, C]), abs=1e-6)
    with pytest.raises(ValueError, match=r"m\.src, line 3: LIN goes to XC, which is no target .*--with FILE"):
        legs_of(KR16, path)


@pytest.mark.parametrize(
    ("moves", "why"),
    [
        (
            "PROC main()\nMoveL a,v1,fine,tool0;\nMoveL Offs(a,0,0,300),v1,fine,tool0;\nENDPROC",
            "line 6: MoveL goes",
        ),
        ("", "no instruction moves, and what is declared has no order"),
    ],
)
def test_a_program_whose_moves_are_not_all_known_is_refused(tmp_path: Path, moves: str, why: str):
    text = f"MODULE m\n{DECLARED}\n{moves}\nENDMODULE\n"
    with pytest.raises(ValueError, match=why):
        legs_of(KR16, written(tmp_path, "m.mod", text))


def test_an_arm_with_less_room_plans_a_smaller_rectangle():
    """With joint 3 within half a radian of where it is in the middle, the usual one is out of its reach."""
    third = float(np.rad2deg(working_position(KR16)[2]))
    joints = list(KR16.joints)
    limits = replace(joints[2].limits, lower_deg=third - 15.0, upper_deg=third + 15.0)
    joints[2] = replace(joints[2], limits=limits)
    narrow = replace(KR16, joints=joints)
    sizes = [
        float(
            np.linalg.norm(
                np.diff(Kinematics(robot).forward(leg.path.at(np.array([0.0, 1.0])))[:, :3, 3], axis=0)
            )
        )
        for robot in (KR16, narrow)
        for leg in legs_of(robot, "rectangle")
    ]
    assert np.array(sizes[4:]) / np.array(sizes[:4]) == pytest.approx(np.full(4, sizes[4] / sizes[0]))
    assert 0.2 < sizes[4] / sizes[0] < 0.9


@pytest.mark.parametrize("share", [0.7, 0.8, 0.9])
def test_a_line_on_which_joints_turn_back_half_way_has_a_quickest_motion(
    share: float, caplog: pytest.LogCaptureFixture
):
    robot = load_robot("kr210")
    across = legs_of(robot, "rectangle")[1].path
    most = motion_limits(robot)
    names = "speed", "acceleration", "motor_torque"
    kept = replace(most, **{name: share * getattr(most, name) for name in names})
    times, s = quickest_rigid(robot, 210.0, across, kept)
    assert s[[0, -1]] == pytest.approx([0.0, 1.0])
    assert times[-1] < 1.0
    assert "Toppra" not in caplog.text
