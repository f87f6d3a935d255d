"""The moves of a program are those that its controller would make: all, in their order, or a refusal."""

import pytest

from robots.programs.program import Program
from tests.robots.programs.test_languages import CONFIG, EXTERNAL, GRIPPER, POSE, krl, rapid, robtarget

P, R = robtarget("p"), robtarget("r", "700")
JOINTS = f"CONST jointtarget j:=[[0,-60,60,0,30,0],{EXTERNAL}];"
TO_P, TO_R = "MoveL p,v1,fine,tool0;", "MoveJ r,v1,fine,tool0;"


def made(program: Program) -> list[tuple[int, str, bool]]:
    assert not [move for move in program.moves if move.why_not]
    return [(move.line, move.target.name, move.is_straight) for move in program.moves if move.target]


def refused(program: Program) -> list[tuple[int, str]]:
    return [(move.line, move.why_not) for move in program.moves if move.why_not]


def test_rapid_moves_in_the_order_of_its_instructions_however_often():
    program = rapid(P, R, "PROC main()", TO_R, TO_P, TO_R, "ENDPROC")
    assert made(program) == [(5, "r", False), (6, "p", True), (7, "r", False)]
    assert [target.name for target in program.targets] == ["p", "r"]  # in the order of the text


def test_krl_moves_in_the_order_of_its_instructions_however_often():
    lines = (f"P1={{{POSE}}}", f"P2={{{POSE}}}", "$TOOL=$NULLFRAME", "PTP P2", "LIN P1 C_DIS", "LIN P2")
    assert made(krl("DEF m()", *lines, "END")) == [(5, "P2", False), (6, "P1", True), (7, "P2", True)]
    data = "\n".join(
        ["DEFDAT m", f"DECL E6POS XP1={{{POSE}}}", "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2}", "ENDDAT"]
    )
    program = krl("DEF m()", "BAS(#INITMOV,0)", "LIN XP1", "END", others=(data, CONFIG))
    assert made(program) == [(3, "XP1", True)]
    assert program.moves[0].target
    assert program.moves[0].target.tool
    assert program.moves[0].target.tool.X[2, 3] == pytest.approx(0.15)
    assert not program.targets  # none that could be corrected in this file


def test_each_move_has_the_tool_of_its_own_instruction_and_arrays_and_poses_of_joints_are_known():
    rest = f"[1,0,0,0],[0,0,0,0],{EXTERNAL}"
    array = f"CONST robtarget a{{2}}:=[[[1,2,3],{rest}],[[4,5,6],{rest}]];"
    program = rapid(
        GRIPPER, JOINTS, array, "PROC main()", "MoveAbsJ j\\NoEOffs,v1,fine,grip;",
        "MoveL CalcRobT(j,tool0),v1,fine,tool0;", "MoveL a{2},v1\\T:=1,z10,grip\\WObj:=wobj0;",
        f"MoveJ [[1,2,3],{rest}],v1,fine,tool0;", "ENDPROC",
    )  # fmt: skip
    assert made(program) == [(6, "j", False), (7, "j", True), (8, "a{2}", True), (9, "", False)]


def test_one_routine_that_another_calls_once_is_followed():
    assert made(rapid(P, R, "PROC main()", "pick;", "ENDPROC", "PROC pick()", TO_P, TO_R, "ENDPROC"))


UNSURE = {
    "beside": (["MoveL Offs(p,0,0,300),v1,fine,tool0;"], 6, "MoveL goes to Offs(p,0,0,300), which"),
    "circle": (["MoveC p,r,v1,fine,tool0;"], 6, "MoveC is not followed"),
    "unknown": (["MoveL nosuch,v1,fine,tool0;"], 6, "MoveL goes to nosuch"),
    "search": (["SearchL di1,q,p,v1,tool0;"], 6, "SearchL is not followed"),
    "routine with a target": (["approach p;"], 6, "approach is not followed"),
    "condition": (["IF di1=1 THEN", TO_R, "ENDIF"], 7, "stands within IF of line 6"),
    "short condition": ([f"IF di1=1 {TO_R}"], 6, "stands within IF of line 6"),
    "short condition of two names": ([f"IF di1=high {TO_R}"], 6, "stands within IF of line 6"),
    "loop": (["FOR i FROM 1 TO 3 DO", TO_R, "ENDFOR"], 7, "stands within FOR of line 6"),
    "return": (["IF di1=1 RETURN;", TO_R], 7, "stands behind RETURN of line 6"),
    "jump": (["again:", "GOTO again;"], 5, "GOTO of line 7"),
    "new value": (["p.trans.z:=3;"], 5, "p is given another value"),
    "displaced": (["PDispOn r,tool0;"], 6, "PDispOn"),
    "another file": (["home;"], 6, "calls home, which is not in this file"),
    "late binding": (['%"home"%;'], 6, "whose name is an expression"),
    "two routines": (["ENDPROC", "PROC pick()", TO_R], 8, "moves stand in main and in pick"),
    "called twice": (["ENDPROC", "PROC cycle()", "main;", "main;"], 9, "calls main once more"),
    "called in a loop": (["ENDPROC", "PROC cycle()", "WHILE TRUE DO main; ENDWHILE"], 8, "within WHILE"),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "line", "why"), UNSURE.values(), ids=UNSURE)
def test_rapid_that_may_move_otherwise_is_named_with_its_line(lines: list[str], line: int, why: str):
    program = rapid(P, R, "PROC main()", TO_P, *lines, "ENDPROC")
    assert [(at, why in text) for at, text in refused(program)[:1]] == [(line, True)], refused(program)


def test_conditions_and_calls_without_moves_do_not_matter():
    calm = ["IF di1=1 THEN SetDO do1,1; ENDIF", "WaitTime 1;", "IF flag SetDO do1,0;", "Stop;"]
    assert made(rapid(P, R, "PROC main()", TO_P, *calm, TO_R, "ENDPROC")) == [
        (5, "p", True),
        (10, "r", False),
    ]


UNSURE_KRL = {
    "by a distance": (["LIN_REL {X 5}"], 5, "by a distance"),
    "circle": ([f"CIRC {{{POSE}}},{{{POSE}}}"], 5, "only PTP, SPTP, LIN and SLIN are"),
    "parts": (["PTP {A1 5}"], 5, "goes to {A1 5}"),
    "sum": (["LIN P1:{X 5,Y 0,Z 0,A 0,B 0,C 0}"], 5, "sum of frames"),
    "unknown": (["PTP XHOME"], 5, "goes to XHOME"),
    "condition": (["IF $IN[1] THEN", "PTP P1", "ENDIF"], 6, "stands within IF of line 5"),
    "loop": (["LOOP", "PTP P1", "ENDLOOP"], 6, "stands within LOOP of line 5"),
    "spline": (["SPLINE", "SLIN P1", "ENDSPLINE"], 6, "stands within SPLINE of line 5"),
    "another file": (["pick()"], 5, "calls PICK, which is not in this file"),
    "jump": (["again:", "GOTO again"], 4, "GOTO of line 6"),
    "new value": (["P1.X=3"], 4, "P1 is given another value"),
    "no tool": ([], 4, "nothing says the tool"),
    "two routines": (["END", "DEF pick()", "PTP P1"], 7, "moves stand in M and in PICK"),
}


@pytest.mark.parametrize(("lines", "line", "why"), UNSURE_KRL.values(), ids=UNSURE_KRL)
def test_krl_that_may_move_otherwise_is_named_with_its_line(lines: list[str], line: int, why: str):
    tool = ";" if why == "nothing says the tool" else "$TOOL=$NULLFRAME"
    program = krl("DEF m()", f"P1={{{POSE}}}", tool, "LIN P1", *lines, "END")
    assert [(at, why in text) for at, text in refused(program)[:1]] == [(line, True)], refused(program)
