"""Planned motions as programs: each takes as long as it was planned, as far as its language can say so."""

import re
from dataclasses import replace

import numpy as np
import pytest

from robots.programs.planned_moves import PlannedMove, even_acceleration, krl_moves, rapid_moves
from robots.programs.program import ProgramContext, Source
from robots.programs.read import parse_program

A, B, C = np.deg2rad([[0, -60, 60, 0, 30, 0], [20, -50, 60, 0, 30, 10], [40, -50, 60, 0, 30, 10]])
LINE = PlannedMove(
    "the line",
    np.array([A, B]),
    0.5,
    np.full(6, 0.5),
    np.full(6, 0.7),
    True,
    np.array([0.0, 0.3, -0.4]),
    0.0,
    1.6,
)
SWING = replace(LINE, name="the swing", q=np.array([B, C]), duration=0.467, is_straight=False, turn=1.0)


@pytest.mark.parametrize("speed", [1.05, 1.5, 2.0, 5.0])
def test_an_even_move_covers_the_length_in_the_time(speed: float):
    """Speeding up and braking take v / a each, at half the speed: T = L / v + v / a."""
    v, a = even_acceleration(0.5, speed, 0.5)
    assert v <= min(speed, 2.0 * 0.5 / 0.5)
    assert 0.5 / v + v / a == pytest.approx(0.5)
    assert v / a <= 0.25 * (1.0 + 1e-9)  # it does not brake before it has sped up


def test_rapid_has_the_places_and_the_durations():
    (module,) = rapid_moves([LINE, SWING]).values()
    assert re.findall(r"(Move\w+) .*\\T:=([\d.]+), fine", module) == [
        ("MoveL", "0.500"),
        ("MoveAbsJ", "0.467"),
    ]
    places = re.findall(r"jointtarget p\d := \[\[([^]]*)\]", module)
    found = np.deg2rad([[float(each) for each in place.split(",")] for place in places])
    assert found == pytest.approx(np.array([A, B, C]), abs=1e-6)


def test_krl_has_a_way_in_mm_and_speeds_that_take_as_long():
    (source,) = krl_moves([LINE, SWING]).values()
    assert "LIN_REL {X 0,Y 300,Z -400} #BASE" in source
    v, a = (float(re.search(rf"\$({name})\.CP=([\d.]+)", source)[2]) for name in ("VEL", "ACC"))  # type: ignore[index]
    assert 0.5 / v + v / a == pytest.approx(LINE.duration, abs=1e-3)
    assert "BAS(#VEL_PTP,50)" in source
    assert "BAS(#ACC_PTP,70)" in source
    assert source.index("#ACC_PTP") < source.index("PTP {A1 40")


def test_what_a_controller_cannot_do_is_refused():
    fast = replace(LINE, speed=3.5, duration=0.2)
    with pytest.raises(
        ValueError, match=r"the line: KRL takes at most 3 m/s along a line, the plan has 3\.50"
    ):
        krl_moves([fast])
    for write in (krl_moves, rapid_moves):
        with pytest.raises(ValueError, match=r"a line that turns the tool, here by 5\.73 deg"):
            write([replace(LINE, turn=0.1)])


def test_rapid_is_read_back_like_any_program():
    (module,) = rapid_moves([SWING]).values()
    program = parse_program(Source("plan.mod", module), ProgramContext())
    assert [each.q for each in program.targets][-1] == pytest.approx(C, abs=1e-6)
