"""Reading a program and writing it again changes nothing but the numbers that are meant to change."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robots.programs.program import Program, ProgramError, Source, edited
from robots.programs.read import parse_program
from tests.robots.programs.texts import krl_lists, rapid_modules, tables

PROGRAMS = {"m.mod": rapid_modules(), "m.dat": krl_lists(), "m.csv": tables()}
programs = st.one_of(
    *(
        texts.map(lambda text, name=name: parse_program(Source(name, text)))
        for name, texts in PROGRAMS.items()
    )
)


def around(program: Program) -> str:
    """Everything in a program but its numbers of targets."""
    every = {literal: "#" for target in program.targets for literal in target.numbers.values()}
    return edited(program.text, every.items())


@given(programs)
@settings(max_examples=60, deadline=None)
def test_every_number_of_a_target_is_where_it_says(program: Program):
    assert program.targets
    for target in program.targets:
        for literal in target.numbers.values():
            text = re.sub(r"\s", "", program.text[literal.start : literal.end])
            assert float(text.replace(",", ".")) == literal.value


@given(programs, st.floats(-1e-3, 1e-3), st.floats(-0.1, 0.1))
@settings(max_examples=60, deadline=None)
def test_only_the_numbers_of_targets_change_and_they_say_the_new_pose(program, shift: float, turn: float):
    X_moved = np.eye(4)
    X_moved[:3, :3], X_moved[:3, 3] = Rotation.from_euler("x", turn).as_matrix(), shift
    edits = {}
    for target in program.targets:
        edits |= target.driven(target.q + turn) if target.has_joints else target.moved(target.X_BT @ X_moved)
    again = parse_program(Source(program.name, edited(program.text, edits.items())))
    assert around(again) == around(program)
    for target, new in zip(program.targets, again.targets, strict=True):
        if target.has_joints:
            np.testing.assert_allclose(new.q, target.q + turn, rtol=0, atol=2e-10)
        else:  # 1e-9 mm, and 1e-10 rad below which nothing is written
            np.testing.assert_allclose(new.X_BT, target.X_BT @ X_moved, rtol=0, atol=2e-10)


@given(programs)
@settings(max_examples=60, deadline=None)
def test_a_target_that_does_not_move_keeps_its_digits(program: Program):
    """Also where its quaternion is not of length one and its angles are beyond half a turn."""
    for target in program.targets:
        assert not (target.driven(target.q) if target.has_joints else target.moved(target.X_BT))


@pytest.mark.parametrize("name", PROGRAMS)
def test_anything_is_read_or_refused_in_words(name: str):
    """Cut, doubled and shuffled programs: nothing but a refusal is ever raised."""

    @given(
        PROGRAMS[name], st.integers(0, 600), st.integers(0, 200), st.text("[]{}(),;:=!\\\"'1.X\n", max_size=4)
    )
    @settings(max_examples=100, deadline=None)
    def check(text: str, start: int, length: int, put: str):
        damaged = text[:start] + put + text[start + length :]
        try:
            program = parse_program(Source(name, damaged))
        except ProgramError:
            return
        assert edited(program.text, []) == damaged

    check()


def test_a_quoted_name_may_end_before_or_with_a_tab_between_tabs():
    header = "\t".join(["name", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"])
    for name in ('"p"', '"p\t"'):
        text = f"{header}\n{name}\t1\t2\t3\t1\t0\t0\t0"
        (target,) = parse_program(Source("m.csv", text)).targets
        assert [number.value for number in target.numbers.values()][:3] == [1.0, 2.0, 3.0]
