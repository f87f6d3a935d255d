"""Motors that do not move as planned: friction and rotors go by how they move, and so they are learnt."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_model import DriveModel
from systems.estimation.kernels.drive_columns import ROW_FRICTION
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives, motion

SLOWLY = 0.01  # times the usual motion: friction turns over all the time, and motors are pulled off by it
_COULOMB = ROW_FRICTION + 2  # of the regressors of a command
STEPS = 20  # of the simulation in a period


def planned(time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    theta, v, a = motion(time)
    return SLOWLY * theta, SLOWLY * v, SLOWLY * a


def followed(model, times: np.ndarray, friction: float) -> np.ndarray:
    """Where motors are whose Coulomb friction is so many times what is believed, rad, (n, 6).

    A simulation, in steps of its own, of inertia a = k_p e + k_i int e dt + k_d e' + torque sent - friction.
    """
    drive = model._drives
    theta, speed, _ = planned(times[0])
    total, positions, step = np.zeros(6), [], PERIOD / STEPS
    for time in times:
        positions.append(theta.copy())
        for k in range(STEPS):
            wanted, v, a = planned(time + k * step)
            sent = drive.inertia * a + drive.viscous * v + drive.coulomb * np.tanh(v / drive.width)
            against = drive.viscous * speed + friction * drive.coulomb * np.tanh(speed / drive.width)
            e = wanted - theta
            pull = drive.kp * e + drive.ki[0] * total + drive.kd * (v - speed)
            speed = speed + step * (sent + pull - against) / drive.inertia
            theta, total = theta + step * speed, total + step * e
    return np.array(positions)


def left_over(friction: float, is_known: bool) -> float:
    """Of following errors, what friction so many times as much as believed does not explain, their share."""
    model, memory = drives(robot="puma560")
    times, share = PERIOD * np.arange(1500), friction - 1.0
    off = np.array([planned(time)[0] for time in times]) - followed(model, times, friction)
    dv = -np.gradient(off, PERIOD, axis=0) * is_known
    da = np.gradient(dv, PERIOD, axis=0)
    left = np.empty_like(off)
    for k, time in enumerate(times):
        theta, v, a = planned(time)
        regressors = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        memory.deviation.faster[:], memory.deviation.accelerated[:] = dv[k], da[k]
        model.deviate(memory, v)
        beyond, _, _, coulomb, *_ = memory.deviation.out
        left[k] = off[k] - beyond - share * (regressors[_COULOMB] + coulomb)
    return float(left[500:].std() / off[500:].std())


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.7, 1.4])
def test_motors_that_friction_pulls_off_their_plan_are_explained_by_how_they_moved(friction):
    """Did friction go by planned speeds, a seventh and more would be left wherever motors turn back."""
    assert left_over(friction, is_known=True) < 0.01
    assert left_over(friction, is_known=False) > 0.1


@pytest.mark.slow
def test_friction_of_motors_off_their_plan_is_learnt():
    model, memory = drives(robot="puma560", following_sigma=1e-5)
    times = PERIOD * np.arange(1500)
    off = np.array([planned(time)[0] for time in times]) - followed(model, times, 1.4)
    dv = -np.gradient(off, PERIOD, axis=0)
    da, left = np.gradient(dv, PERIOD, axis=0), np.empty(len(times))
    model._drives = model._drives._replace(slack=np.zeros(6))
    for k, time in enumerate(times):
        theta, v, a = planned(time)
        regressors = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        memory.deviation.faster[:], memory.deviation.accelerated[:] = dv[k], da[k]
        model.deviate(memory, v)
        motion = theta, v, a
        left[k] = model.look_back(memory, motion, regressors, np.zeros(6), theta - off[k])
    # It is an eighth: motors that hang are doubted, so that not all of it is learnt within five seconds.
    assert left[-250:].max() < 0.3 * np.abs(off[-250:]).max()


def test_drives_that_follow_positions_alone_ring_and_nothing_is_made_of_that():
    belief = ControllerModel(load_robot("irb1200"), 7.0, PERIOD)
    model = DriveModel(belief, DriveModelConfig(), "position")
    memory = model.layout.view(np.zeros(model.layout.size))
    memory.deviation.faster[:], memory.deviation.accelerated[:] = 0.1, 1.0
    model.deviate(memory, motion(0.3)[1])
    assert not model.needed_beyond(memory).any()
    assert not memory.deviation.out.any()


def test_motors_on_their_plan_need_nothing_beyond_it():
    model, memory = drives()
    model.deviate(memory, motion(0.3)[1])
    assert not model.needed_beyond(memory).any()
    assert not memory.deviation.out.any()


def test_what_motors_needed_beyond_their_plan_is_friction_of_their_speed_and_inertia():
    model, memory = drives()
    v, dv, da = motion(0.3)[1], np.full(6, 0.02), np.full(6, 1.0)
    believed = model._drives
    memory.deviation.faster[:], memory.deviation.accelerated[:] = dv, da
    model.deviate(memory, v)
    needed = model.needed_beyond(memory)
    coulomb = believed.coulomb * (np.tanh((v + dv) / believed.width) - np.tanh(v / believed.width))
    np.testing.assert_allclose(needed[2], coulomb, atol=1e-9)
    np.testing.assert_allclose(needed[1], believed.rotor, atol=1e-9)
    np.testing.assert_allclose(needed[0], believed.inertia + believed.viscous * dv + coulomb, atol=1e-9)
    assert not needed[3].any()  # the load is where it was planned
