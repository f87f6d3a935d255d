"""Gears of the MuJoCo cell with play and hysteresis: what they lose, where they lie, and the law on them."""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest

from experiments.bench.mujoco_cell.arm import STEP, Arm, Wrong, true_arm
from experiments.bench.mujoco_cell.gears import SLIPS, Wear, WornGears
from experiments.bench.mujoco_cell.run import CellRun, run
from robots.description.model import load_robot

EXACT = Wrong(0.0, 0.0, 0.0, 0.0, 0.0)


def worn(wear: Wear) -> tuple[Arm, WornGears, mujoco.MjData]:
    robot = load_robot("irb1200")
    arm = true_arm(robot, 7.0, EXACT, 0)
    gears = WornGears(arm, robot, wear, 0)
    data = arm.data_at_rest(np.zeros(6))
    arm.model.dof_armature[arm.motors] = 1e6  # they stay where they are
    gears.rest(data)
    return arm, gears, data


def cycle(arm: Arm, gears: WornGears, data: mujoco.MjData, largest: float, duration: float) -> np.ndarray:
    """Torque and deflection of the first gear, whose axis is upright, in the second of two cycles."""
    rows = []
    for k in range(round(2 * duration / STEP)):
        torque = largest * np.sin(2.0 * np.pi * k * STEP / duration)
        gears.step(data)
        data.qfrc_applied[gears.joints[0]] += torque
        rows.append((torque, data.qpos[gears.joints[0]]))  # of one instant
        mujoco.mj_step(arm.model, data)
    return np.array(rows[len(rows) // 2 :])


@pytest.mark.slow
def test_a_gear_without_load_lies_between_its_flanks_and_under_load_behind_one():
    arm, gears, data = worn(Wear(hysteresis=0.0, unevenness=0.0))
    torque, x = cycle(arm, gears, data, 20.0, 8.0).T
    k, half = gears.stiffness[0], gears.half_play[0]
    loaded = np.abs(torque) > 10.0
    expected = torque / k + np.copysign(half, torque)
    # Behind by what the damper takes: 80 N m s/rad at up to 0.6 mrad/s, over 25000 N m/rad.
    np.testing.assert_allclose(x[loaded], expected[loaded], atol=3e-6)


@pytest.mark.slow
def test_springs_that_slip_lose_what_friction_takes():
    """4 k w (X - w) a cycle each, with the stretch w at which it slips and the largest deflection X."""
    arm, gears, data = worn(Wear(play=0.0, unevenness=0.0, grease=0.0))
    torque, x = cycle(arm, gears, data, 12.0, 8.0).T
    by_damper = load_robot("irb1200").joint_damping[0] * np.sum(np.gradient(x) ** 2) / STEP
    lost = np.sum(torque * np.gradient(x)) - by_damper
    springs, X = gears.springs[0], np.abs(x).max()
    expected = np.sum(4.0 * springs * SLIPS * np.maximum(X - SLIPS, 0.0))
    assert expected > 0.0
    assert lost == pytest.approx(expected, rel=1e-4)  # steps of the physics leave 2e-6


def test_an_uneven_gear_is_ahead_and_behind_twice_a_turn_of_its_motor():
    gears, robot = worn(Wear())[1], load_robot("irb1200")
    turns = np.linspace(0.0, 1.0, 200, endpoint=False)
    ahead = np.array([gears.uneven(2.0 * np.pi * turn / robot.gear_ratio) for turn in turns])
    size = np.abs(np.fft.rfft(ahead, axis=0)) / 100.0  # the amplitude of each number of waves a turn
    np.testing.assert_allclose(size[2], 2e-5, rtol=0.21)  # rad, a fifth more or less
    assert np.delete(size, 2, axis=0).max() < 1e-12


def test_friction_has_most_more_at_low_speeds():
    gears = worn(Wear(hump_speed=0.02))[1]
    speeds = np.linspace(0.0, 0.2, 201)
    more = np.array([gears.more_friction(np.full(6, speed)) for speed in speeds])
    np.testing.assert_array_equal(speeds[more.argmax(axis=0)], 0.02)
    np.testing.assert_allclose(more.max(axis=0), gears.hump)
    assert (more[-1] < 1e-15).all()
    np.testing.assert_array_equal(gears.more_friction(np.full(6, -0.02)), -more[20])


def test_what_gears_have_is_another_robot_for_another_seed():
    robot = load_robot("irb1200")
    halves = [WornGears(true_arm(robot, 7.0, EXACT, 0), robot, Wear(), seed).half_play for seed in (0, 1)]
    assert (halves[0] != halves[1]).all()
    np.testing.assert_allclose(halves, 7.3e-5, rtol=0.21)  # rad, half of 0.5', a fifth more or less


@pytest.mark.slow
def test_the_law_learns_gears_that_are_no_model_of_its_own():
    """Half an arc minute is 0.1 mm at 0.7 m; from the nominal robot, with everything else wrong, too."""
    found = run(CellRun("irb1200", 1, wear=Wear()), lambda share: None)
    assert found["laps"][0]["max_norm_mm"] < 0.08
    assert found["laps"][1]["max_norm_mm"] < 0.06
    assert found["static_mm"] < 0.015
    assert all(lap["times_planned"] < 1.01 for lap in found["laps"])
    assert found["guard"] == 0
