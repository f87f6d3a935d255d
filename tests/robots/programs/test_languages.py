"""What RAPID and KRL say of tools, frames, loads and configurations, and what is left alone and named."""

import numpy as np
import pytest

from robots.programs.program import Program, ProgramContext, ProgramError, Source
from robots.programs.read import parse_program

EXTERNAL = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def rapid(*lines: str, others: tuple[str, ...] = (), tool: str = "") -> Program:
    context = ProgramContext(tuple(Source("other.mod", text) for text in others), tool)
    return parse_program(Source("m.mod", "\n".join(["MODULE m", *lines, "ENDMODULE"])), context)


def robtarget(name: str, x: str = "600") -> str:
    return f"CONST robtarget {name}:=[[{x},0,500],[0,0,1,0],[0,-1,0,1],{EXTERNAL}];"


def krl(*lines: str, suffix: str = "src", others: tuple[str, ...] = ()) -> Program:
    context = ProgramContext(tuple(Source("config.dat", text) for text in others))
    return parse_program(Source(f"m.{suffix}", "\n".join(lines)), context)


GRIPPER = "PERS tooldata grip:=[TRUE,[[0,0,150],[1,0,0,0]],[2.5,[0,0,60],[1,0,0,0],0,0,0]];"
TABLE = 'PERS wobjdata table:=[FALSE,TRUE,"",[[100,0,0],[0,0,0,1]],[[0,20,0],[1,0,0,0]]];'
MOVE_P = "PROC main() MoveL p,v1,fine,tool0;"
PART = "PERS loaddata part:=[1.5,[0,0,80],[1,0,0,0],0,0,0];"


def test_a_target_has_tool_work_object_and_load_of_its_move():
    program = rapid(
        GRIPPER, TABLE, PART, robtarget("p1"), robtarget("p2"),
        "PROC main() MoveL\\Conc, p1, v100\\V:=50, z10, grip\\WObj:=table;",
        "GripLoad part; MoveC p2, p1, v100, fine, grip\\WObj:=table; ENDPROC",
    )  # fmt: skip
    first, second = program.targets
    assert first.tool is not None
    assert first.tool.X[2, 3] == pytest.approx(0.15)
    np.testing.assert_allclose(first.base.X[:3, 3], [0.1, -0.02, 0.0], atol=1e-15)  # turned by 180 degrees
    assert (first.payloads, second.payloads) == ((2.5, 4.0), (4.0,))
    np.testing.assert_allclose(first.X_BT[:3, 3], [0.6, 0.0, 0.5])
    assert [first.numbers[role].value for role in ("cf1", "cf4", "cf6", "cfx")] == [0, -1, 0, 1]


def test_tools_of_another_module_and_arrays_and_inline_targets():
    rest = f"[1,0,0,0],[0,0,0,0],{EXTERNAL}"
    array = f"VAR robtarget p{{2}}:=[[[1,2,3],{rest}],[[4,5,6],{rest}]];"
    program = rapid(
        array, "PROC main() FOR i FROM 1 TO 2 DO MoveL p{i}, v10, fine, grip; ENDFOR",
        f"MoveAbsJ [[0,10,20,0,30,0],{EXTERNAL}]\\NoEOffs, v10, fine, grip; ENDPROC", others=(GRIPPER,),
    )  # fmt: skip
    assert [each.name for each in program.targets] == ["p{1}", "p{2}", ""]
    assert [each.line for each in program.targets] == [2, 2, 4]
    np.testing.assert_allclose(np.rad2deg(program.targets[2].q), [0, 10, 20, 0, 30, 0])


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        ([robtarget("p", "reach+10"), MOVE_P], "p has expressions"),
        ([robtarget("p"), "PROC main() p:=Offs(p,0,0,1); MoveL p,v1,fine,tool0;"], "given another value"),
        ([robtarget("p"), "PROC main() p.trans.x:=3; MoveL p,v1,fine,tool0;"], "given another value"),
        ([robtarget("p"), "PROC main() approach p;"], "--tool NAME says it"),
        (
            [robtarget("p").replace("[0,0,1,0]", "[1,0,1,0]"), MOVE_P],
            "the quaternion has the length 1.414, not 1",
        ),
        (
            ["PROC main()", f"MoveL [[x,0,0],[1,0,0,0],[0,0,0,0],{EXTERNAL}],v1,fine,tool0;"],
            "has expressions",
        ),
        ([robtarget("p", ""), MOVE_P], "p lacks a number"),
        ([robtarget("p").replace("600,0,", "0,"), MOVE_P], "p has too few or too many numbers"),
        ([robtarget("p").replace("[0,0,1,0]", "[0,0,0,0]"), MOVE_P], "p has a quaternion of zero"),
        (
            ["PROC main()", f"MoveAbsJ [[0,,20,0,30,0],{EXTERNAL}],v1,fine,tool0;"],
            "the target of moveabsj lacks a number",
        ),
    ],
)
def test_what_is_no_plain_target_is_left_alone_and_named(lines: list[str], note: str):
    program = rapid(*lines)
    assert not program.targets
    assert [note in each.text for each in program.notes] == [True]


def test_a_tool_whose_millimetres_seem_to_be_metres_is_named():
    program = rapid(GRIPPER.replace("150]", "0.15]"), robtarget("p"), "PROC main() MoveL p,v1,fine,grip;")
    assert [target.name for target in program.targets] == ["p"]
    (note,) = program.notes
    assert note.text == "the tool grip is only 0.15 mm long; is it in mm?"


def test_a_target_beside_another_is_named_and_the_other_corrected():
    program = rapid(robtarget("p"), "PROC main()", "MoveL Offs(p,0,0,50),v1,fine,tool0;", "ENDPROC")
    assert [target.name for target in program.targets] == ["p"]
    assert [(note.line, "Offs of p" in note.text) for note in program.notes] == [(4, True)]


@pytest.mark.parametrize(
    ("lines", "refusal"),
    [
        ([robtarget("p"), "PROC main()", "MoveL p,v1,fine,gone;"], "m.mod, line 4: gone is not declared"),
        (
            [GRIPPER.replace("150],[1", "150],[2"), robtarget("p"), "PROC main()", "MoveL p,v1,fine,grip;"],
            "m.mod, line 2: grip: the quaternion has the length 2, not 1",
        ),
        (
            [GRIPPER.replace("150],[1", "150],[0"), robtarget("p"), "PROC main()", "MoveL p,v1,fine,grip;"],
            "m.mod, line 2: grip: the quaternion is zero",
        ),
        (
            [GRIPPER.replace("150]", "150000]"), robtarget("p"), "PROC main()", "MoveL p,v1,fine,grip;"],
            "m.mod, line 3: the tool grip is 150 m long, more than 5 m; is it in mm?",
        ),
        (
            [GRIPPER, robtarget("p"), "PROC main()", "MoveL p,v1,fine,grip;", "MoveL p,v1,fine,tool0;"],
            "line 6: p is moved to with tool0, and with grip in m.mod, line 5",
        ),
        (
            [GRIPPER.replace("TRUE", "FALSE"), robtarget("p"), "PROC main() MoveL p,v1,fine,grip;"],
            "stands still",
        ),
        ([GRIPPER.replace("150", "len"), robtarget("p"), "PROC main() MoveL p,v1,fine,grip;"], "in numbers"),
        (
            [
                TABLE,
                robtarget("p"),
                "PROC main() measure;",
                "MoveL p,v1,fine,tool0\\WObj:=table;",
                "ENDPROC",
                "PROC measure() table.oframe.trans.x:=seen;",
            ],
            "line 5: table is given another value by the program, which is not read",
        ),
        (
            [
                TABLE.replace("TRUE", "FALSE"),
                robtarget("p"),
                "PROC main() MoveL p,v1,fine,tool0\\WObj:=table;",
            ],
            "unit",
        ),
    ],
)
def test_a_frame_that_nobody_knows_is_refused_with_its_line(lines: list[str], refusal: str):
    with pytest.raises(ProgramError, match=refusal):
        rapid(*lines)


@pytest.mark.parametrize(
    "heading", ["PROC main()", "LOCAL PROC go(VAR num speed, PERS tooldata t\\switch on)", "TRAP stopped"]
)
def test_what_follows_the_heading_of_a_routine_is_read_whatever_its_parameters(heading: str):
    move = "MoveL p,v1,fine,grip;"
    (inside,) = rapid(GRIPPER, heading, robtarget("p"), move).targets
    (before,) = rapid(GRIPPER, robtarget("p"), heading, move).targets
    assert [each.tool and each.tool.name for each in (inside, before)] == ["grip", "grip"]


@pytest.mark.parametrize(
    "condition",
    [
        "flag",
        "NOT flag",
        "di1=high",
        "a AND b",
        "flag=TRUE",
        "n=1",
        "f(1,b)",
        'name="x"',
        "n{2}>m{k}",
        "n>-1",
    ],
)
def test_a_move_under_a_condition_of_one_line_has_the_tool_that_it_names(condition: str):
    program = rapid(
        GRIPPER, robtarget("p"), "PROC main()", f"IF {condition} MoveL p,v1,fine,grip;", "ENDPROC"
    )
    assert [each.tool and each.tool.name for each in program.targets] == ["grip"]
    assert [move.line for move in program.moves] == [5]


CONFIG = """TOOL_DATA[1]={X 0.0,Y 0.0,Z 150.0,A 0,B 0,C 0}
BASE_DATA[2]={X 500,Y 0,Z 0,A 90,B 0,C 0}
LOAD_DATA[1]={M 3.5}"""
POSE = "X 600.0,Y 0.0,Z 500.0,A 0.0,B 180.0,C 0.0,S 2,T 10"


def test_a_taught_position_has_tool_base_and_load_of_its_frame_data():
    lines = (f"DECL E6POS XP1={{{POSE}}}", "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}")
    (target,) = krl("DEFDAT m", *lines, "ENDDAT", suffix="dat", others=(CONFIG,)).targets
    assert target.tool is not None
    assert target.tool.X[2, 3] == pytest.approx(0.15)
    np.testing.assert_allclose(target.base.X[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert target.payloads == (3.5,)
    assert (target.numbers["status"].value, target.numbers["turn"].value) == (2, 10)


def test_an_inline_position_has_the_tool_that_the_text_has_set():
    program = krl(
        "DEF m()", "BAS(#TOOL,1)", "$BASE={X 0,Y 0,Z 100,A 0,B 0,C 0}", f"LIN {{{POSE}}} C_DIS",
        "$TOOL=$NULLFRAME", f"CIRC {{E6POS: {POSE}}},{{{POSE}}}", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}",
        others=(CONFIG,),
    )  # fmt: skip
    heights = [target.tool.X[2, 3] for target in program.targets if target.tool]
    np.testing.assert_allclose(heights, [0.15, 0.0, 0.0, 0.0])
    assert [target.line for target in program.targets] == [4, 6, 6, 7]
    np.testing.assert_allclose(program.targets[3].q, np.deg2rad([0, -90, 90, 0, 0, 0]))


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        (["$TOOL=$NULLFRAME", "PTP {A1 5}"], "parts of a pose"),
        (["$TOOL=$NULLFRAME", "LIN_REL {X 5}"], "by a distance"),
        ([f"LIN {{{POSE}}}"], "nothing says the tool"),
        (["$TOOL=$NULLFRAME", f"P1={{{POSE}}}", "P1.X=P1.X+1", "LIN P1"], "given another value"),
        (["$TOOL=$NULLFRAME", "$IPO_MODE = #tcp", f"LIN {{{POSE}}}"], "a tool that stands still"),
        (["FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #TCP}", "FDAT_ACT=FP1", f"LIN {{{POSE}}}"], "stands still"),
    ],
)
def test_krl_that_is_no_plain_target_is_left_alone_and_named(lines: list[str], note: str):
    program = krl(*lines)
    assert not program.targets
    assert [note in each.text for each in program.notes] == [True]


def test_krl_follows_a_tool_that_the_robot_carries_again():
    lines = ("$TOOL=$NULLFRAME", "$IPO_MODE=#TCP", f"LIN {{{POSE}}}", "$IPO_MODE=#BASE", f"LIN {{{POSE}}}")
    program = krl(*lines)
    assert [target.line for target in program.targets] == [5]
    assert ["stands still" in move.why_not for move in program.moves] == [True, False]


def test_krl_refuses_a_tool_that_is_not_declared():
    with pytest.raises(ProgramError, match=r"m\.src, line 1: TOOL_DATA\[3\] is not declared"):
        krl("$TOOL=TOOL_DATA[3]", f"LIN {{{POSE}}}")


@pytest.mark.parametrize(
    ("line", "refusal"),
    [
        ("$BASE.X=500", r"line 3: \$BASE.X = 500 changes a part of a frame"),
        ("BASE_DATA[2].X=500", r"line 4: BASE_DATA\[2\] is given another value by the program"),
        ("BASE_DATA[2]=SEEN:CUP", r"line 4: BASE_DATA\[2\] is given another value by the program"),
        ("BASE_DATA[ n ]=SEEN", r"line 4: BASE_DATA\[2\] is given another value by the program"),
    ],
)
def test_krl_refuses_a_frame_that_the_program_changes(line: str, refusal: str):
    with pytest.raises(ProgramError, match=refusal):
        krl("$TOOL=TOOL_DATA[1]", "$BASE=$NULLFRAME", line, "$BASE=BASE_DATA[2]", f"LIN {{{POSE}}}",
            others=(CONFIG,))  # fmt: skip


OTHER = "TOOL_DATA[1]={X 0,Y 0,Z 200,A 0,B 0,C 0}"


@pytest.mark.parametrize(
    ("lines", "height"),
    [
        (["$TOOL=TOOL_DATA[1]", f"LIN {{{POSE}}}", CONFIG.splitlines()[0]], 0.15),  # the same once more
        ([OTHER, "$TOOL=TOOL_DATA[1]", f"LIN {{{POSE}}}"], 0.2),
        ([OTHER, "BAS(#TOOL,1)", f"LIN {{{POSE}}}"], 0.2),
        (["$TOOL=TOOL_DATA[1]", f"LIN {{{POSE}}}", OTHER], None),
        ([OTHER, "$TOOL=TOOL_DATA[1]", f"LIN {{{POSE}}}", CONFIG.splitlines()[0]], None),
        (["DECL FDAT FP1={TOOL_NO 1,BASE_NO 0}", f"XP1={{{POSE}}}", OTHER], None),
    ],
)
def test_krl_takes_a_tool_that_the_program_declares_anew_only_where_it_is_plain(
    lines: list[str], height: float | None
):
    if height is None:
        with pytest.raises(ProgramError, match=r"TOOL_DATA\[1\] is given another value by the program"):
            krl(*lines, others=(CONFIG,))
        return
    (target,) = krl(*lines, others=(CONFIG,)).targets
    assert target.tool is not None
    assert target.tool.X[2, 3] == pytest.approx(height)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["$TOOL=TOOL_DATA[1]"], ""),
        (["LOAD_DATA[2].M=5", "$TOOL=TOOL_DATA[1]"], ""),
        (["LOAD_DATA[1].M=5", "$TOOL=TOOL_DATA[1]"], "LOAD_DATA[1] is given another value"),
        (["LOAD_DATA[n]=SEEN", "BAS(#TOOL,1)"], "LOAD_DATA[1] is given another value"),
        (
            ["LOAD_DATA[1].M=5", "$TOOL=$NULLFRAME", "$LOAD=LOAD_DATA[1]"],
            "LOAD_DATA[1] is given another value",
        ),
        (["$TOOL=TOOL_DATA[1]", "$LOAD.M=5"], "$LOAD.M is given another value"),
        (["$TOOL=TOOL_DATA[1]", "$LOAD.CM.X=5"], ""),  # the centre of what hangs there is not asked
        (["$TOOL=TOOL_DATA[1]", "$LOAD.M=5", "$LOAD={M 5}"], ""),
    ],
)
def test_krl_knows_a_load_or_says_why_not(lines: list[str], says: str):
    (target,) = krl("DEF m()", *lines, f"LIN {{{POSE}}}", others=(CONFIG,)).targets
    assert says in target.load_unread
    assert bool(says) == bool(target.load_unread)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("", ""),
        ("other:=seen;", ""),
        ("part.mass:=seen;", "part is given another value"),
        ("part:=seen;", "part is given another value"),
    ],
)
def test_rapid_knows_a_load_or_says_why_not(change: str, says: str):
    program = rapid(
        GRIPPER, PART, robtarget("p"), f"PROC main() {change} GripLoad part;", "MoveL p,v1,fine,grip; ENDPROC"
    )
    (target,) = program.targets
    assert says in target.load_unread
    assert bool(says) == bool(target.load_unread)


def test_krl_has_a_tool_for_each_of_an_array_and_leaves_alone_the_one_that_the_program_changes():
    targets = (f"P[1]={{{POSE}}}", f"P[2]={{{POSE}}}", "$TOOL=$NULLFRAME")
    loop = ("FOR i=1 TO 2", "PTP P[i]", "ENDFOR")
    assert [each.name for each in krl(*targets, *loop).targets] == ["P[1]", "P[2]"]
    assert [each.name for each in krl(*targets, *loop, "P[2].X=5").targets] == ["P[1]"]
    assert [each.name for each in krl(*targets, *loop, "P[i].X=5").targets] == []
