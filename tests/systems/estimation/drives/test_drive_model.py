"""The drive model on motors that do exactly what it says: what it learns, and what it commands then."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_model import DEAD_TIME, MASS, SIZE, DriveModel, DriveModelConfig

PERIOD = 4e-3
LOADS = np.zeros((5, 18))


def motion(time: float):
    """Position, velocity and acceleration of six joints."""
    w, u = 2.0 + 0.4 * np.arange(6), 1.0 + np.arange(6)
    return 0.3 * np.sin(w * time + u), 0.3 * w * np.cos(w * time + u), -0.3 * w**2 * np.sin(w * time + u)


def drives(takes_torque=True, **config):
    belief = ControllerModel(load_robot("irb1200"), 7.0, PERIOD, takes_torque=takes_torque)
    model = DriveModel(belief, DriveModelConfig(**config))
    memory = model.layout.view(np.zeros(model.layout.size))
    model.start(memory)
    return model, memory


def run(model, memory, duration: float, beta: np.ndarray):
    """Motors that follow commands up to Phi beta; returns how far behind the plan they are in the end."""
    worst = []
    for k in range(round(duration / PERIOD)):
        theta, v, a = motion(k * PERIOD)
        columns = model.command(memory, (theta, v, a), LOADS, 7.0).columns
        Phi = model.features(v, a, columns)
        behind = Phi @ beta
        worst.append(np.abs(behind - memory.correction).max())
        model.learn(memory, Phi, behind)
    return np.array(worst)


def test_a_dead_time_and_wrong_friction_are_learnt():
    model, memory = drives()
    beta = np.zeros(SIZE)
    beta[DEAD_TIME], beta[1:7], beta[14:31:3] = 3e-3, 1e-4 * np.array([1, -1, 2, 0, 1, -2]), 0.3
    behind = run(model, memory, 3.0, beta)
    assert behind[0] > 1e-3
    assert behind[-250:].max() < 2e-5
    assert memory.beta[DEAD_TIME] == pytest.approx(3e-3, abs=1e-4)


def test_the_position_command_makes_up_for_a_torque_that_nobody_gives():
    model, memory = drives(takes_torque=False)
    kd, kp, ki = model._drives.kd[1], model._drives.kp[1], model._drives.ki[1]
    times, errors, torques = [], [], []
    for k in range(500):
        theta, v, a = motion(k * PERIOD)
        position = model.command(memory, (theta, v, a), LOADS, 7.0).position
        times.append(k * PERIOD)
        errors.append(position[1] - theta[1] - memory.correction[1])
        torques.append(memory.w[0, 1])

    def rates(t, z):
        return [z[1], (np.interp(t, times, torques) - kp * z[1] - ki * z[0]) / kd]

    found = solve_ivp(
        rates, (0.0, times[-1]), [torques[0] / ki, 0.0], t_eval=times, rtol=1e-8, max_step=PERIOD
    )
    np.testing.assert_allclose(errors[1:], found.y[1][1:], atol=1e-4 * np.abs(errors).max())


def test_confidence_is_honest_about_errors_that_last():
    # What the model leaves of the following errors lasts: taken for noise, it would be fitted by anything.
    slow, quick = drives(), drives(following_sigma=2e-6)
    rng = np.random.default_rng(0)
    for model, memory in (slow, quick):
        for k in range(250):
            theta, v, a = motion(k * PERIOD)
            columns = model.command(memory, (theta, v, a), LOADS, 7.0).columns
            unknown = 2e-5 * np.sin(3.0 * k * PERIOD + np.arange(6))
            model.learn(memory, model.features(v, a, columns), unknown + 1e-6 * rng.normal(size=6))
    assert abs(slow[1].beta[MASS]) <= abs(quick[1].beta[MASS]) + 1e-12
    assert np.abs(slow[1].beta).max() < np.abs(quick[1].beta).max()


def test_what_is_learnt_does_not_make_the_command_jump():
    model, memory = drives()
    beta = np.zeros(SIZE)
    beta[DEAD_TIME] = 20e-3
    last = None
    for k in range(300):
        theta, v, a = motion(k * PERIOD)
        position, velocity, _, columns = model.command(memory, (theta, v, a), LOADS, 7.0)
        if last is not None:
            assert np.abs(position - theta - last).max() <= 0.05 * PERIOD + 1e-12
        last = position - theta
        Phi = model.features(v, a, columns)
        model.learn(memory, Phi, Phi @ beta)
        assert np.isfinite(velocity).all()
