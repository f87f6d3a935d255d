"""A cell on MuJoCo: it is the same robot as Drake's, and the law puts its true tip on the path, too."""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

import experiments.bench.mujoco_cell.arm as arm_module
import experiments.bench.mujoco_cell.cell as cell_module
from experiments.bench.mujoco_cell.arm import STEP, Wrong, drawn_arm, true_arm
from experiments.bench.mujoco_cell.cell import Camera, Drives, MujocoCell
from experiments.bench.mujoco_cell.run import CellRun, run
from robots.description.model import load_robot
from robots.dynamics.plant import add_robot

EXACT = Wrong(0.0, 0.0, 0.0, 0.0, 0.0)
ROBOTS = ["irb1200", "ur10", "puma560", "crx10ial", "mh5"]
WITH_BEAMS = ["kr16", "kr210"]  # the second has a counterbalance, too


def masses(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M


@pytest.mark.parametrize("name", ROBOTS + WITH_BEAMS)
def test_two_engines_have_the_same_rigid_robot(name: str):
    robot = load_robot(name)
    load = 0.5 * robot.payload.largest_mass
    plant = MultibodyPlant(0.0)
    links = add_robot(plant, robot, "rigid", load)
    plant.Finalize()
    context, arm = plant.CreateDefaultContext(), drawn_arm(robot, load)
    data = mujoco.MjData(arm.model)
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6)):
        plant.SetPositions(context, q)
        data.qpos[:] = q
        mujoco.mj_forward(arm.model, data)
        np.testing.assert_allclose(masses(arm.model, data), plant.CalcMassMatrix(context), atol=1e-12)
        held = -links.load(context)
        np.testing.assert_allclose(arm.holding(data, q), held, atol=1e-11 * max(1.0, np.abs(held).max()))
        np.testing.assert_allclose(
            arm.tip(data), links.tool.CalcPoseInWorld(context).GetAsMatrix4(), atol=1e-13
        )


def sag(name: str) -> tuple[np.ndarray, np.ndarray]:
    """How far the tip sags in MuJoCo, m, (5, 3), and how far elsewhere it does in Drake."""
    robot = load_robot(name)
    load = robot.payload.largest_mass
    plant = MultibodyPlant(0.0)
    links = add_robot(plant, robot, "structure", load)
    plant.Finalize()
    arm, rigid = true_arm(robot, load, EXACT, 0), drawn_arm(robot, load)
    context, tips = plant.CreateDefaultContext(), []
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (5, 6)):
        links.set_at_rest(context, q)
        straight = mujoco.MjData(rigid.model)
        straight.qpos[:] = q
        mujoco.mj_kinematics(rigid.model, straight)
        theirs, drawn = arm.tip(arm.data_at_rest(q))[:3, 3], rigid.tip(straight)[:3, 3]
        tips.append((theirs - drawn, theirs - links.tool.CalcPoseInWorld(context).translation()))
    return tuple(np.swapaxes(tips, 0, 1))


@pytest.mark.parametrize("name", ROBOTS)
def test_two_engines_let_the_elastic_robot_sag_alike(name: str):
    """To a micrometre: the sag itself is millimetres, and each engine finds it in a few steps."""
    _, apart = sag(name)
    assert np.abs(apart).max() < 1e-6


@pytest.mark.parametrize("name", WITH_BEAMS)
def test_a_beam_on_one_hinge_sags_nearly_as_one_that_is_made_of_segments(name: str):
    """Apart are where a link's own mass hangs, and how far a moment at its end turns that of a KR 210."""
    way, apart = (np.linalg.norm(each, axis=1) for each in sag(name))
    assert way.max() > 5e-4
    assert apart.max() < 0.1 * way.max()


def test_links_that_bend_let_the_tip_sag_further():
    robot, q = load_robot("irb1200"), np.zeros(6)
    tips = []
    for bending in (0.0, 0.3):
        arm = true_arm(robot, 7.0, replace(EXACT, bending=bending), 0)
        tips.append(arm.tip(arm.data_at_rest(q))[2, 3])
    assert 1e-5 < tips[0] - tips[1] < 1e-3


def test_friction_sticks_the_harder_the_shorter_its_time():
    """Half of what would move a motor lets it creep, and in proportion to that time."""
    robot, crept = load_robot("irb1200"), []
    for friction_time in (5e-4, 2e-3):
        arm = true_arm(robot, 0.0, replace(EXACT, friction_time=friction_time), 0)
        ways = []
        for share in (0.5, 0.0):
            data = arm.data_at_rest(np.zeros(6))
            mujoco.mj_forward(arm.model, data)
            data.qfrc_applied[arm.motors] = data.qfrc_bias[arm.motors]
            data.qfrc_applied[arm.motors[5]] += share * robot.joint_coulomb_friction[5]
            mujoco.mj_step(arm.model, data, 400)
            ways.append(data.qpos[arm.motors[5]])
        crept.append(ways[0] - ways[1])
    assert crept[1] == pytest.approx(4.0 * crept[0], rel=0.1)


def test_a_set_point_is_where_the_commands_were_a_delay_before():
    """A cubic between values and rates is off by h^4 / 384 of the fourth derivative, here 7e-11 rad."""
    robot, period, delay = load_robot("irb1200"), 4e-3, 7e-3
    arm, drives = drawn_arm(robot, 0.0), Drives(delay=delay)
    cell = MujocoCell(arm, arm, drives, Camera(), period, np.zeros(6), 0)
    context = cell.CreateDefaultContext()
    now = context.get_abstract_state(0).get_value()
    now.ticks = 10
    for k in range(len(now.commands)):
        issued = (10 - (len(now.commands) - 1 - k)) * period
        now.commands[k] = np.repeat([np.sin(3.0 * issued), 3.0 * np.cos(3.0 * issued), issued], 6)
    for time in np.arange(10 * period, 11 * period, STEP):
        position, speed, torque = cell._setpoint(now, time)
        np.testing.assert_allclose(position, np.sin(3.0 * (time - delay)), atol=2e-10)
        np.testing.assert_allclose(speed, 3.0 * np.cos(3.0 * (time - delay)), atol=1e-6)
        assert 0.0 <= time - delay - torque[0] + 1e-12 < period


def test_a_controller_before_the_drives_comes_to_its_reference_with_its_gain():
    arm, gain, period = drawn_arm(load_robot("irb1200"), 0.0), 20.0, 4e-3
    cell = MujocoCell(arm, arm, Drives(planner=gain), Camera(), period, np.zeros(6), 0)
    assert cell.num_input_ports() == 2  # no torques
    speed = np.arange(1.0, 7.0)
    planned = np.concatenate([np.full(6, -0.01), speed, np.zeros(6)])
    off = []
    for k in range(1, 101):
        planned = cell._planned(planned, k * period * speed, speed)
        off.append(k * period * speed - planned[:6])
    np.testing.assert_allclose(off[49], 0.01 * np.exp(-gain * 50 * period), rtol=0.15)  # its speed lags
    np.testing.assert_allclose(off[-1], 0.0, atol=1e-5)


@pytest.mark.slow
def test_what_a_step_of_the_physics_changes_is_microns_and_in_proportion_to_it(monkeypatch):
    """Of the same commands, with reversals of all joints; the drives are sampled at each step, too."""
    robot, period, tips = load_robot("irb1200"), 4e-3, []
    rate = np.array([3.0, 4.0, 5.0, 6.0, 7.0, 8.0])  # rad/s
    for step in (STEP, 0.5 * STEP, 0.25 * STEP):
        for module in (arm_module, cell_module):
            monkeypatch.setattr(module, "STEP", step)
        true, drawn = true_arm(robot, 7.0, Wrong(), 0), drawn_arm(robot, 0.0)
        cell = MujocoCell(true, drawn, Drives(), Camera(), period, np.zeros(6), 0)
        simulator, way = Simulator(cell), []
        context = simulator.get_mutable_context()
        for time in period * np.arange(500):
            motion = 0.1 * (1.0 - np.cos(rate * time)), 0.1 * rate * np.sin(rate * time), np.zeros(6)
            for port, value in enumerate(motion):
                cell.get_input_port(port).FixValue(context, value)
            simulator.AdvanceTo(time + period)
            way.append(cell.GetOutputPort("truth.X_WE").Eval(context)[[3, 7, 11]])
        tips.append(np.array(way))
    first, second = (np.linalg.norm(a - b, axis=1).max() for a, b in pairwise(tips))
    assert first < 1.5e-5
    assert second == pytest.approx(0.5 * first, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "planner"), [("irb1200", 0.0), ("irb1200", 20.0), ("ur10", 0.0)])
def test_the_true_tip_is_on_its_path_from_the_first_lap_on_physics_that_are_not_ours(
    robot: str, planner: float
):
    """With every frame of the robot wrong, friction that sticks, and drives that the law has never seen."""
    found = run(CellRun(robot, 1, drives=Drives(planner=planner)), lambda share: None)
    one, two = found["laps"]
    assert one["max_norm_mm"] < 0.05
    assert two["max_norm_mm"] < 0.025
    assert found["static_mm"] < 0.005
    assert found["guard"] == 0
    assert not found["learnt"]["events"]


@pytest.mark.slow
def test_a_wrist_whose_friction_moves_its_motors_by_milliradians_is_known_at_rest_and_in_motion():
    """Ten times the friction for what its motors turn as that of other robots: a KR 16."""
    found = run(CellRun("kr16", 2), lambda share: None)
    assert max(lap["max_norm_mm"] for lap in found["laps"]) < 0.2
    assert found["static_mm"] < 0.05


@pytest.mark.slow
def test_friction_unlike_any_that_is_known_moves_the_tip_less_on_the_first_lap_with_feedback():
    """That of a PUMA moves its motors by a quarter of a milliradian, before it has been learnt."""
    alone, fed_back = (
        run(CellRun("puma560", 2, laps=1, more=more), lambda share: None)["laps"][0]["max_norm_mm"]
        for more in (("servo.laws.self_calibrating.drives.feedback=0",), ())
    )
    assert fed_back < 0.75 * alone
