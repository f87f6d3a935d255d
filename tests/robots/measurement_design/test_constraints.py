"""Where a robot may be measured: clear of itself, of boxes and the floor, in a volume."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.configuration.nodes import ConfigurationError
from robots.description.model import Placement, RobotModel, load_robot
from robots.kinematics.forward import Kinematics
from robots.measurement_design.candidate_grid import AxisRange, CandidateGrid, own_ranges
from robots.measurement_design.candidates import Candidates
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations, floor_under
from robots.measurement_design.design import design_measurements
from robots.measurement_design.obstacles import Obstacle, read_obstacles

UR10 = load_robot("ur10")
COARSE = tuple(
    AxisRange(a, b, 4) for a, b in ((-90, 90), (-150, -30), (-120, 120), (-150, 90), (-90, 90), (-90, 90))
)


def random(robot: RobotModel, count: int) -> np.ndarray:
    limits = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return np.random.default_rng(0).uniform(*limits, (count, 6))


def test_a_folded_arm_touches_itself():
    """The forearm of a UR10 folded onto its upper arm touches it; bent by 90 degrees it is free."""
    allowed = AdmissibleConfigurations(UR10)
    q = np.deg2rad([[0, -90, 90, -90, -90, 0], [0, -90, 175, -90, -90, 0]]).astype(float)
    np.testing.assert_array_equal(allowed(q), [True, False])


def test_links_on_either_side_of_one_without_length_touch_by_design():
    """As in the elbow of a Fanuc CRX-10iA: Drake's search for the distance of the two did not end."""
    robot = load_robot("irb1200")
    joints = list(robot.joints)
    at_elbow = replace(joints[3].placement, translation=np.zeros(3))
    joints[3] = replace(joints[3], placement=at_elbow)
    allowed = AdmissibleConfigurations(replace(robot, joints=joints))
    assert allowed(np.deg2rad([[0.0, 0.0, -30.0, 0.0, 60.0, 0.0]])).all()


def test_the_tool_stays_in_the_volume_and_the_arm_off_the_boxes():
    corners = np.array([0.2, -0.6, 0.2]), np.array([1.0, 0.6, 1.0])
    q = random(UR10, 600)
    inside = AdmissibleConfigurations(UR10, AdmissibleConfig(box=corners))(q)
    p = Kinematics(UR10).forward(q)[inside, :3, 3]
    assert inside.sum() > 5
    assert ((p >= corners[0]) & (p <= corners[1])).all()
    wall = Obstacle("wall", np.array([0.02, 4.0, 4.0]), Placement(np.array([0.5, 0.0, 1.0])))
    free = AdmissibleConfigurations(UR10)(q)
    walled = AdmissibleConfigurations(UR10, AdmissibleConfig(obstacles=(wall,)))(q)
    assert not (walled & ~free).any()
    tips = Kinematics(UR10).forward(q)[:, 0, 3]
    assert 5 < walled.sum() < free.sum()
    assert tips[walled].max() < 0.5  # what is beyond cannot be reached without going through


@pytest.mark.parametrize("name", ["ur10", "kr16", "puma560"])
def test_what_does_not_depend_on_axes_1_and_6_need_be_checked_once(name: str):
    robot = load_robot(name)
    allowed = AdmissibleConfigurations(robot)
    grid = CandidateGrid(robot, COARSE)
    assert allowed.indifferent(grid.angles) == (0, 5)
    numbers = np.random.default_rng(1).choice(len(grid), 300, replace=False)
    cases = Candidates(grid, allowed, (0, 5))
    each = Candidates(grid, allowed)
    np.testing.assert_array_equal(cases._check(numbers), allowed(grid.configurations(numbers)))
    assert cases.num_refused == each.num_refused


def test_a_view_a_wall_or_a_tool_beside_its_axis_make_them_matter():
    angles = [axis.angles() for axis in COARSE]
    wall = AdmissibleConfig(obstacles=(Obstacle("wall"),))
    assert AdmissibleConfigurations(UR10, wall).indifferent(angles) == (5,)
    beside = replace(UR10, tool=Placement(np.array([0.1, 0.1, 0.0])))
    assert AdmissibleConfigurations(beside).indifferent(angles) == (0,)
    leaning = replace(UR10, base=Placement(np.zeros(3), np.array([0.0, 0.0, 5.0])))
    assert 0 not in AdmissibleConfigurations(leaning, AdmissibleConfig(floor=0.0)).indifferent(angles)


def test_heights_are_those_of_the_tool_and_the_links():
    """A large ball around the tool is often the lowest, and it is where the tool is."""
    robot = load_robot("kr16")
    q = random(robot, 300)
    heights = AdmissibleConfigurations(robot, AdmissibleConfig(tool_radius=0.3))._shapes.lowest(q)
    tips = Kinematics(robot).forward(q)[:, 2, 3] - 0.3
    assert (heights <= tips + 1e-12).all()
    assert (np.abs(heights - tips) < 1e-12).mean() > 0.3


def test_the_floor_is_under_an_upright_robot_and_far_from_others():
    assert floor_under(replace(UR10, base=Placement(np.array([0.0, 0.0, 0.8])))) == 0.8
    assert floor_under(replace(UR10, base=Placement(np.zeros(3), np.array([0.0, 90.0, 0.0])))) < -50.0


@pytest.mark.parametrize("height", [0.675, 0.0])
def test_a_robot_whose_file_has_no_base_is_not_always_on_the_floor(height: float):
    """Joint 1 is on the floor, as in many URDFs, or the origin is in the shoulder, as in tables of links."""
    robot = load_robot("kr16")
    joints = list(robot.joints)
    for index, translation in enumerate(([0.0, 0.0, 0.0], [0.26, 0.0, height])):
        placement = replace(joints[index].placement, translation=np.array(translation))
        joints[index] = replace(joints[index], placement=placement)
    changed, q = replace(robot, joints=joints), random(robot, 200)
    free = AdmissibleConfigurations(changed)(q)
    assert free.sum() > 0.7 * AdmissibleConfigurations(robot, AdmissibleConfig(floor=0.675 - height))(q).sum()
    assert Kinematics(changed).forward(q)[free, 2, 3].min() > min(0.0, height - 0.3)


def test_the_grid_has_the_robot_s_own_ranges():
    robot = load_robot("puma560")
    for axis, joint in zip(own_ranges(robot), robot.joints, strict=True):
        assert (axis.lower_deg, axis.upper_deg) == pytest.approx(
            (max(joint.limits.lower_deg, -180.0), min(joint.limits.upper_deg, 180.0))
            if joint.limits.upper_deg - joint.limits.lower_deg > 360.0
            else (joint.limits.lower_deg, joint.limits.upper_deg)
        )
    assert [axis.lower_deg for axis in own_ranges(load_robot("irb1200"))] == [-100, -45, -90, -180, -90, -180]


@pytest.mark.slow
def test_narrow_ranges_are_no_reason_to_refuse_a_design():
    robot = load_robot("kr16")
    for joint, middle in zip(robot.joints, (0.0, -70.0, 80.0, 0.0, 40.0, 0.0), strict=True):
        joint.limits.lower_deg, joint.limits.upper_deg = middle - 20.0, middle + 20.0
    ranges = tuple(replace(axis, samples=5) for axis in own_ranges(robot))
    design = design_measurements(robot, 30, ranges=ranges, admissible=AdmissibleConfigurations(robot))
    assert design.value > 0.95 * design.bound
    assert (design.configurations >= robot.lower).all()


@pytest.mark.slow
def test_a_design_for_the_source_s_parameters_has_as_many_as_one_for_the_complete_model():
    """The UR10 with frames that its URDF turns, too."""
    counts = {
        (name, is_complete): design_measurements(
            load_robot(name), 20, ranges=COARSE, is_complete=is_complete or None
        ).num_parameters
        for name in ("ur10", "irb1200")
        for is_complete in (False, True)
    }
    assert set(counts.values()) == {30}


def test_obstacles_are_read_from_a_file_and_mistakes_named_with_their_line(tmp_path: Path):
    path = tmp_path / "cell.yaml"
    path.write_text("obstacles:\n- {name: table, size: [1, 2, 0.1], placement: {translation: [0, 0, 1]}}\n")
    (table,) = read_obstacles(str(path))
    assert (table.name, table.size.tolist()) == ("table", [1.0, 2.0, 0.1])
    path.write_text("obstacles:\n- {name: table,\n   size: [1, -2, 0.1]}\n")
    with pytest.raises(ConfigurationError, match=r"cell.yaml, line 3: .*size.* must be positive"):
        read_obstacles(str(path))
    with pytest.raises(ValueError, match="a box needs increasing corners"):
        AdmissibleConfigurations(UR10, AdmissibleConfig(box=(np.ones(3), np.zeros(3))))
