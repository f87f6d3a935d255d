"""Friction that sticks: how sharply it turns over is learnt, and motors that hung start well."""

import numpy as np
import pytest
from scipy.signal import lsim

from systems.estimation.drives.drive_model import SHARP, THIRD
from systems.estimation.kernels.drive_columns import CONSTANT, FRICTION, OF_FRICTION
from systems.estimation.kernels.drives.regression import SHARP_WIDTH, THIRD_WIDTH
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives, motion


# A jump and a fiftieth of the width differ, and each takes a time constant of the drive to pass. Of a width
# between 0.15 would be left without a shape of its own.
@pytest.mark.parametrize(("width", "left"), [(1e-9, 0.35), (0.3, 0.12)])
def test_friction_that_turns_over_more_sharply_is_learnt_once_it_may(width, left):
    """Coulomb's own friction jumps where the speed changes its sign; the file of the robot has a width."""
    model, memory = drives()
    times = PERIOD * np.arange(3000)
    v = 0.05 * motion(times[:, None])[1]
    believed = model._drives.width
    sharper = model._drives.coulomb * (np.tanh(v / (width * believed)) - np.tanh(v / believed))
    gains = zip(model._drives.kd, model._drives.kp, model._drives.ki[0], strict=True)
    behind = np.transpose(
        [lsim(([1.0, 0.0], gain), torque, times)[1] for gain, torque in zip(gains, sharper.T, strict=True)]
    )
    remains = np.empty_like(behind)
    model.open_low_speeds(memory)
    for k, time in enumerate(times):
        theta, rate, a = (0.05 * each for each in motion(time))
        regressors = model.command(memory, (theta, rate, a), LOADS, 7.0).regressors
        remains[k] = behind[k] - memory.correction
        model.learn(memory, model.features(rate, a, regressors), behind[k])
    assert remains[-1000:].std() < left * behind[-1000:].std()
    # Of the wrist; friction moves the heavy axes too little for all of it to be seen.
    np.testing.assert_allclose((memory.beta[SHARP] + memory.beta[THIRD])[3:], 1.0, atol=0.2)


def test_three_shapes_leave_less_than_half_of_what_two_leave_of_any_other():
    """A speed that changes evenly passes through where friction turns over."""
    v = np.linspace(-5.0, 5.0, 20001)  # of the believed width

    def left(widths):
        shapes = np.tanh(np.divide.outer(v, widths))
        others = np.tanh(np.divide.outer(v, np.geomspace(SHARP_WIDTH, 1.0, 30)))
        return np.sqrt(np.square(others - shapes @ np.linalg.lstsq(shapes, others)[0]).mean(axis=0)).max()

    assert left([1.0, THIRD_WIDTH, SHARP_WIDTH]) < 0.5 * left([1.0, SHARP_WIDTH])


def test_that_friction_sticks_one_joint_shows_for_all():
    """All have bearings and seals of a kind: what has been seen of one is expected of the others."""
    model, memory = drives()
    model.open_low_speeds(memory)
    for k in range(1000):
        theta, v, a = (0.05 * each for each in motion(PERIOD * k))
        regressors = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        Phi = model.features(v, a, regressors)
        Phi[np.arange(6) != 4] = 0.0
        model.learn(memory, Phi, Phi[:, SHARP][:, 4])
    np.testing.assert_allclose(memory.beta[SHARP][4], 1.0, atol=0.1)
    np.testing.assert_allclose(memory.beta[SHARP], memory.beta[SHARP][4], atol=0.1)


def moved_with_sticking_friction(model, memory, is_hanging_known: bool = True) -> np.ndarray:
    """Eight motions with rests between: how far motors were off as each began, at most, in rad, (8, 6).

    At rest friction is whatever keeps a motor there: it hangs until its drive pulls more than that. The
    motors, without inertia: k_d (v_command - v) + k_p e + k_i int e dt and the torque that was sent for
    friction are the friction that there is.
    """
    coulomb, width, kp, (ki, *_), kd = (
        getattr(model._drives, name) for name in ("coulomb", "width", "kp", "ki", "kd")
    )
    theta = command = begin = sum_of_e = np.zeros(6)
    farthest = np.zeros((8, 6))
    for k, way in enumerate((0.1, 0.1, -0.1, 0.1, -0.1, -0.1, 0.1, 0.1)):  # rad within a second, and a rest
        for time in np.arange(0.0, 1.4, PERIOD):
            s, w = min(time, 1.0), 2.0 * np.pi
            turn, v, a = way * np.outer(
                [s - np.sin(w * s) / w, 1.0 - np.cos(w * s), w * np.sin(w * s)], np.ones(6)
            )
            memory.hung[1] *= is_hanging_known
            issued = model.command(memory, (begin + turn, v, a), LOADS, 7.0)
            before, command = command, issued.position
            for part in 0.1 * np.arange(1, 11):
                e = before + part * (command - before) - theta
                pull = (
                    kd * (command - before) / PERIOD + kp * e + ki * sum_of_e + coulomb * np.tanh(v / width)
                )
                theta = theta + 0.1 * PERIOD * np.sign(pull) * np.maximum(np.abs(pull) - coulomb, 0.0) / kd
                sum_of_e = sum_of_e + 0.1 * PERIOD * e
            if time < 0.3:
                farthest[k] = np.maximum(farthest[k], np.abs(begin + turn - theta))
            model.look_back(memory, (begin + turn, v, a), issued.regressors, memory.correction.copy(), theta)
        begin = begin + way
    return farthest


@pytest.mark.slow
def test_what_motors_that_hung_do_after_a_rest_does_not_hide_that_they_stick():
    model, memory = drives()
    model.open_low_speeds(memory)
    moved_with_sticking_friction(model, memory)
    # Were what they do after a rest believed as all else is, it would be 0.5 to 0.6.
    assert (memory.beta[SHARP] + memory.beta[THIRD] > 0.65).all()


@pytest.mark.slow
def test_motors_that_hung_do_not_start_with_what_their_drives_wound_up_meanwhile():
    farthest = []
    for is_known in (True, False):
        model, memory = drives()
        model.open_low_speeds(memory)
        farthest.append(moved_with_sticking_friction(model, memory, is_known)[-3:, 3:])
    assert (farthest[0] < 0.6 * farthest[1]).all()  # of the wrist, which friction moves most


def test_on_the_path_torques_take_over_what_positions_have_made_up_for():
    """What torques are sent beyond those of a model without them moves motors as positions did before."""
    learnt = {0: 0.2, 1: -0.1, 2: 0.3, 3: 0.1}  # of rotor, viscous and Coulomb friction, and its hump
    times, told = PERIOD * np.arange(2000), []
    for on_path in (True, False):
        model, memory = drives(robot="kr16")
        for k, share in learnt.items():
            memory.beta[FRICTION + k : CONSTANT : OF_FRICTION] = share
        memory.beta[SHARP] = 0.5
        told.append([])
        for time in times:
            if on_path and time > 2.0:
                model.give_by_torque(memory)
            theta, v, a = (0.05 * each for each in motion(time))
            issued = model.command(memory, (theta, v, a), LOADS, 7.0)
            told[-1].append((issued.position - theta, issued.torque, issued.beside))
    (position, torque, beside), (before, without, same) = (np.array(each).swapaxes(0, 1) for each in told)
    np.testing.assert_array_equal(beside, same)  # what is learnt from is the same
    assert not (torque - without)[times <= 2.0].any()
    gains = model._drives
    moved_most = np.flatnonzero(gains.slack > 1e-3)
    assert len(moved_most)
    assert not np.delete(torque - without, moved_most, axis=1).any()
    np.testing.assert_allclose(position[-1000:, moved_most], 0.0, atol=1e-9)  # these have nothing left to do
    for joint in moved_most:
        drive = [1.0, 0.0], [gains.kd[joint], gains.kp[joint], gains.ki[0, joint]]
        moved = lsim(drive, (torque - without)[:, joint], times, interp=False)[1]
        off = (moved - (before - position)[:, joint])[-1000:]
        assert np.abs(off).max() < 0.1 * np.abs(before[-1000:, joint]).max()


@pytest.mark.parametrize(("sharp", "sticks"), [(0.1, False), (0.5, True)])
def test_torques_take_over_only_where_a_motor_is_seen_to_stick(sharp: float, sticks: bool):
    """What else is learnt of friction may stand in for gains that are not as believed."""
    torque = []
    for on_path in (True, False):
        model, memory = drives(robot="kr16")
        memory.beta[SHARP], memory.beta[FRICTION + 2 : CONSTANT : OF_FRICTION] = sharp, 0.5
        if on_path:
            model.give_by_torque(memory)
        plans = (motion(PERIOD * k) for k in range(200))
        torque.append([model.command(memory, (q, v, a), LOADS, 7.0).torque for q, v, a in plans])
    assert np.array_equal(*torque) != sticks


def test_no_more_friction_is_made_up_for_than_there_can_be():
    """What is learnt of motors that hang may be some times Coulomb's friction, and would push them about."""

    def beside(sharp: float, within: float) -> np.ndarray:
        model, memory = drives(robot="kr16")
        memory.beta[SHARP], memory.beta[THIRD] = sharp, within
        rows = []
        for k in range(1000):
            theta, v, a = (0.05 * each for each in motion(PERIOD * k))
            rows.append(model.command(memory, (theta, v, a), LOADS, 7.0).beside)
        return np.array(rows)

    np.testing.assert_array_equal(beside(4.0, 0.5), beside(1.5, 0.0))
    np.testing.assert_array_equal(beside(0.5, 3.0), beside(0.5, 1.0))
    assert not np.array_equal(beside(1.4, 0.0), beside(1.5, 0.0))


@pytest.mark.parametrize("robot", ["irb1200", "kr16-realistic"])
def test_of_motors_that_hang_less_is_learnt_and_of_those_that_move_again_more(robot: str):
    """A motor at rest has whatever friction holds it; one that moves that of its speed."""

    def learnt(hung: float, hangs: bool) -> np.ndarray:
        model, memory = drives(robot=robot)
        memory.hung[0] = hung
        theta, v, a = motion(1.0)
        regressors = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        memory.deviation.faster[:] = -hangs * v
        model.look_back(memory, (theta, v, a), regressors, np.zeros(6), theta - 1e-4)
        return np.abs(memory.beta).sum()

    assert 0.0 < learnt(1e-3, True) < 0.1 * learnt(1e-4, True)
    assert learnt(1.0, True) < 1e-3 * learnt(1.0, False)
    assert learnt(1.0, False) == learnt(0.1, False)


@pytest.mark.parametrize(("speed", "hangs"), [(0.0, True), (2e-3, True), (5e-3, False), (0.02, False)])
def test_a_motor_hangs_that_encoders_show_at_rest_whatever_is_planned(speed: float, hangs: bool):
    """Friction turns over within 0.01 rad/s, and what holds a motor that should move nobody knows."""
    model, memory = drives()
    theta, _, a = motion(1.0)
    v, off = np.full(6, 0.1), 2e-4
    regressors = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
    memory.deviation.faster[:] = speed - v
    model.deviate(memory, v)
    model.look_back(memory, (theta, v, a), regressors, np.zeros(6), theta - off)
    np.testing.assert_allclose(memory.hung[0], off if hangs else 0.0, atol=1e-12)
    assert not memory.hung[1].any()  # nor would a drive that is wound up be told from a late one
