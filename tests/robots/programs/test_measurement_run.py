"""The measurement run as a program: it visits what was designed, settles, triggers, and notes the joints."""

import re

import numpy as np
import pytest

from robots.calibration.measurement_file import MeasurementFileError, parse_measurements
from robots.programs.measurement_run import MeasurementRun, krl_run, rapid_run, table_to_fill
from robots.programs.program import ProgramContext, Source
from robots.programs.read import parse_program
from tests.robots.programs.written import configurations

Q = configurations(7, 0)


@pytest.mark.parametrize("language", ["rapid", "krl"])
def test_the_program_read_back_visits_the_configurations_in_their_order(language: str):
    files = (rapid_run if language == "rapid" else krl_run)(MeasurementRun(Q))
    name = "measure.mod" if language == "rapid" else "measure.dat"
    context = ProgramContext(tool="" if language == "rapid" else "0")
    program = parse_program(Source(name, files[name]), context)
    np.testing.assert_allclose([target.q for target in program.targets], Q, atol=1e-7)  # 5 digits of a degree


def test_after_every_move_the_robot_settles_before_the_trigger_and_notes_its_joints():
    (module,) = rapid_run(MeasurementRun(Q, settle=0.8, trigger="doCamera")).values()
    assert re.findall(r"MoveAbsJ (\w+), v200, fine, tool0;\n +take;", module) == [
        f"m{k}" for k in range(1, 8)
    ]
    steps = ["WaitTime\\InPos, settle", "PulseDO\\PLength:=0.1, doCamera", "CJointT()", "WaitTime 0.3"]
    assert [module.index(step) for step in steps] == sorted(module.index(step) for step in steps)
    assert "settle := 0.8;" in module
    source = krl_run(MeasurementRun(Q, trigger="17"))["measure.src"]
    steps = ["PTP M[i]", "WAIT SEC 0.5", "PULSE($OUT[17],TRUE,0.1)", "Q[i]=$AXIS_ACT", "WAIT SEC 0.3"]
    assert [source.index(step) for step in steps] == sorted(source.index(step) for step in steps)
    assert "FOR i=1 TO 7" in source


def test_the_table_that_rapid_writes_has_six_columns_and_no_empty_seventh():
    (module,) = rapid_run(MeasurementRun(Q)).values()
    written = ""
    for what, stays in re.findall(r"Write table, (.*?)(\\NoNewLine)?;\n", module):
        joint = re.sub(r"NumToStr\(here.robax.rax_(\d),5\)", r'"\1"', what)
        written += joint.replace('" + "', "").strip('"') + ("" if stays else "\n")
    assert written.splitlines() == ["q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg", "1;2;3;4;5;6"]


def test_via_points_stand_before_the_moves_that_they_belong_to():
    none = np.zeros((0, 6))
    ways = (none, Q[4:6], *[none] * 4, Q[:1])
    (module,) = rapid_run(MeasurementRun(Q, vias=ways)).values()
    moves = re.findall(r"MoveAbsJ (\w+), v200, (\w+), tool0;", module)
    between = [("v2_1", "z10"), ("v2_2", "z10")], [("v7_1", "z10")]
    stops = [(f"m{k}", "fine") for k in range(1, 8)]
    assert moves == [stops[0], *between[0], *stops[1:6], *between[1], stops[6]]
    files = krl_run(MeasurementRun(Q, vias=ways))
    first = [int(k) for k in re.findall(r"^F\[\d+\]=(\d+)$", files["measure.dat"], re.MULTILINE)]
    assert first == [1, 1, 3, 3, 3, 3, 3, 4]
    assert files["measure.dat"].count("V[") == 1 + 3
    source = files["measure.src"]
    assert source.index("PTP V[k]") < source.index("PTP M[i]")


@pytest.mark.parametrize("position_only", [False, True])
def test_the_table_is_refused_while_it_is_empty_and_read_when_it_is_filled(position_only: bool):
    text = table_to_fill(MeasurementRun(Q), position_only)
    with pytest.raises(MeasurementFileError, match="no usable row; x_mm is not a finite number"):
        parse_measurements(text)
    filled = re.sub(r",(?=,|$)", ",12.5", text.partition("\n")[2], flags=re.MULTILINE)
    table, problems = parse_measurements(filled)
    assert not problems
    assert (table.rotation is None) is position_only
    np.testing.assert_allclose(table.q, Q, atol=1e-7)
    np.testing.assert_allclose(table.position, 0.0125)


@pytest.mark.parametrize(
    ("make", "changes", "message"),
    [
        (rapid_run, {"trigger": "1"}, "name of a digital output in RAPID"),
        (krl_run, {"trigger": "doTrigger"}, "number of a digital output in KRL"),
        (rapid_run, {"settle": -1.0}, "between 0 and 60 s, got -1 s"),
        (krl_run, {"vias": (Q[:1],)}, "7 configurations need as many ways, got 1"),
    ],
)
def test_what_no_controller_could_run_is_refused(make, changes: dict, message: str):
    with pytest.raises(ValueError, match=message):
        make(MeasurementRun(Q, **changes))
