"""The true robot arrives where the program says, when the controller runs the false targets."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.description.model import RobotModel, load_robot
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import Kinematics
from robots.programs.compensation import Compensation, FalseTarget, Refusal
from robots.programs.program import Program, Source, edited
from robots.programs.read import parse_program
from tests.robots.programs.written import (
    WOBJ,
    configurations,
    flange,
    krl_list,
    rapid_module,
    with_random_errors,
)

CALIBRATED = {"of": "irb1200", "source": "a test"}


def corrected(
    program: Program, nominal: RobotModel, true: RobotModel, **keywords
) -> tuple[str, list[FalseTarget]]:
    found = Compensation(nominal, true, **keywords).false_targets(program, np.zeros(6))
    results = [each for each in found if isinstance(each, FalseTarget)]
    assert len(results) == len(found), [each.why for each in found if isinstance(each, Refusal)]
    return edited(program.text, [edit for each in results for edit in each.edits.items()]), results


def numbers(line: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+\.?\d*(?:[eE][+-]?\d+)?", line.partition(":=")[2])]


@pytest.mark.slow
def test_the_flange_of_the_true_robot_arrives_at_200_robtargets():
    """A controller that knows nothing of all this solves the numbers of the new text, read by other means."""
    nominal = load_robot("irb1200")
    true, q = with_random_errors(nominal, 3), configurations(200, 0)
    text = rapid_module(nominal, q)
    new, results = corrected(parse_program(Source("m.mod", text)), nominal, true)
    inverse, commanded = InverseKinematics(nominal), []
    for k, line in enumerate(line for line in new.split("\r\n") if "robtarget" in line):
        x, quaternion = np.array(numbers(line)[:3]), numbers(line)[3:7]
        X_cmd = np.eye(4)
        X_cmd[:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        X_cmd[:3, 3] = 1e-3 * x
        X_cmd = WOBJ @ X_cmd
        commanded.append(inverse.nearest(X_cmd, q[k]))  # E of this robot file is tool0
    np.testing.assert_allclose([each.q_after for each in results], commanded, atol=1e-9)
    wanted = flange(nominal, q)[:, :3, 3]
    before, after = (flange(true, each)[:, :3, 3] - wanted for each in (q, np.array(commanded)))
    assert np.linalg.norm(before, axis=1).max() > 10e-3  # m
    assert np.linalg.norm(after, axis=1).max() < 1e-9  # m: 1e-6 mm


def test_without_errors_not_a_byte_changes():
    for name, write, suffix in (("irb1200", rapid_module, "mod"), ("kr16", krl_list, "dat")):
        robot, q = load_robot(name), configurations(20, 1)
        if name == "kr16":
            q[:, 1:3] += np.deg2rad([-90, 90])
        text = write(robot, q)
        new, results = corrected(parse_program(Source(f"m.{suffix}", text)), robot, robot)
        assert new == text
        np.testing.assert_allclose([each.q_before for each in results], q, atol=1e-8)  # its configuration


def test_a_kuka_keeps_its_status_and_its_turns_follow_the_axes():
    nominal = load_robot("kr16")
    true, q = with_random_errors(nominal, 1), configurations(60, 2)
    q[:, 1:3] += np.deg2rad([-90, 90])
    q[::2, 0] = np.deg2rad(0.05)  # an axis that the correction moves across zero
    new, results = corrected(parse_program(Source("m.dat", krl_list(nominal, q))), nominal, true)
    turns = [int(each) for each in re.findall(r"T (\d+)", new)]
    expected = [sum(1 << j for j in range(6) if each.q_after[j] < 0.0) for each in results]
    assert turns == expected
    assert any(each.q_after[0] < 0.0 < each.q_before[0] for each in results)
    reached = flange(true, np.array([each.q_after for each in results]))
    assert np.abs(reached - flange(nominal, q))[:, :3, 3].max() < 1e-9


@pytest.mark.parametrize(("name", "kind"), [("irb1200", "joints"), ("irb1200", "poses"), ("ur10", "joints")])
def test_tables_have_the_tool_of_the_robot_file(name: str, kind: str):
    nominal = load_robot(name)
    true, q = with_random_errors(nominal, 5), configurations(10, 3)
    if name == "ur10":
        q[:, 2] = 1.2 + 0.3 * q[:, 2]  # not stretched
    poses = Kinematics(nominal).forward(q)
    if kind == "joints":
        head = ";".join(f"q{number}_deg" for number in range(1, 7))
        rows = [";".join(f"{value:.9f}".replace(".", ",") for value in each) for each in np.rad2deg(q)]
    else:
        head = "x_m;y_m;z_m;qw;qx;qy;qz"
        turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
        table = np.hstack([poses[:, :3, 3], turns])
        rows = [";".join(f"{value:.12f}".replace(".", ",") for value in each) for each in table]
    new, results = corrected(parse_program(Source("m.csv", "\n".join([head, *rows]))), nominal, true)
    reached = Kinematics(true).forward(np.array([each.q_after for each in results]))
    assert np.abs(reached - poses).max() < 1e-9
    if kind == "joints":
        written = np.deg2rad(
            [[float(x.replace(",", ".")) for x in row.split(";")] for row in new.split("\n")[1:]]
        )
        assert np.abs(Kinematics(true).forward(written) - poses).max() < 1e-9


def test_a_robot_that_bends_is_corrected_for_the_load_of_each_target():
    nominal = load_robot("irb1200")
    calibration = replace(
        nominal.calibration, compliance=(1.0 / nominal.joint_stiffness).tolist(), **CALIBRATED
    )
    true, q = replace(nominal, calibration=calibration), configurations(4, 4)
    poses, X = Kinematics(nominal).forward(q), []
    for payload in (0.0, 6.0):
        head = "x_m,y_m,z_m,qw,qx,qy,qz,payload_kg"
        turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
        rows = [
            ",".join(map(repr, [*a, *b, payload]))
            for a, b in zip(poses[:, :3, 3].tolist(), turns.tolist(), strict=True)
        ]
        _, results = corrected(parse_program(Source("m.csv", "\n".join([head, *rows]))), nominal, true)
        q_after = np.array([each.q_after for each in results])
        assert np.abs(controller_kinematics(true, payload).forward(q_after) - poses).max() < 1e-9
        X.append(Kinematics(nominal).forward(q_after))
    assert np.abs(X[1] - X[0])[:, 2, 3].min() > 1e-5  # m: the load is lifted


def test_a_load_that_a_program_changes_is_asked_for_where_the_robot_bends():
    nominal, q = load_robot("kr16"), configurations(1, 0)
    text = krl_list(nominal, q).replace("\n", "\nLOAD_DATA[0]={M 2}\nLOAD_DATA[0].M=SEEN\n", 1)
    program = parse_program(Source("m.dat", text))
    compliance = (1.0 / nominal.joint_stiffness).tolist()
    for given, payload, refused in (([], None, False), (compliance, None, True), (compliance, 2.0, False)):
        true = replace(nominal, calibration=replace(nominal.calibration, compliance=given, **CALIBRATED))
        (found,) = Compensation(nominal, true, payload).false_targets(program, np.zeros(6))
        assert isinstance(found, Refusal) == refused
        if isinstance(found, Refusal):
            assert "LOAD_DATA[0] is given another value by the program" in found.why
            assert "--payload" in found.why


def test_what_cannot_be_reached_is_refused_and_the_others_are_not():
    nominal = load_robot("irb1200")
    rows = ["0.4,0.1,0.4,0,0,1,0", "0.9,0.1,0.4,0,0,1,0", "0.4,0.1,0.5,0,0,1,0"]
    program = parse_program(Source("m.csv", "\n".join(["x_m,y_m,z_m,qw,qx,qy,qz", *rows])))
    found = Compensation(nominal, with_random_errors(nominal, 0)).false_targets(program, np.zeros(6))
    assert [isinstance(each, Refusal) for each in found] == [False, True, False]
    assert isinstance(found[1], Refusal)
    assert found[1].target.line == 3
    assert "out of reach" in found[1].why


def test_another_tool_hangs_at_the_flange_and_leaves_the_error_of_the_calibrated_one_behind():
    """A probe that was mounted 2 mm off says nothing of a gripper."""
    nominal = load_robot("irb1200")
    nominal.tool = replace(nominal.tool, translation=np.array([0.0, 0.0, 0.1]))
    off = replace(nominal.tool, translation=np.array([0.0, 0.002, 0.1]))
    true = replace(nominal, tool=off)
    q = configurations(3, 6)
    for length, moved in ((0.15, 0.0), (0.1, 2e-3)):
        tool = f"PERS tooldata t:=[TRUE,[[0,0,{1e3 * length}],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
        text = rapid_module(load_robot("irb1200"), q, length).replace("MODULE m", f"MODULE m\r\n{tool}", 1)
        _, results = corrected(parse_program(Source("m.mod", text.replace("tool0", "t"))), nominal, true)
        shifts = np.linalg.norm([each.shift[3:] for each in results], axis=1)
        np.testing.assert_allclose(shifts, moved, atol=1e-9)
