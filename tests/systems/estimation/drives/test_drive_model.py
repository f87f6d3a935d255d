"""The drive model on motors that do exactly what it says: what it learns, and what it commands then."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_model import (
    DEAD_TIME,
    GIVING,
    MASS,
    MOMENT,
    NOT_HELD,
    OTHER_GAINS,
    SHARP,
    SIZE,
    SMOOTHED,
    THIRD,
    DriveModel,
)
from systems.link.abb.motion import EgmMotion, EgmMotionConfig
from tests.systems.estimation.drives.motors import LOADS, PERIOD, drives, motion


def run(model, memory, duration: float, beta: np.ndarray):
    """Motors that follow commands up to Phi beta; returns how far behind the plan they are in the end."""
    worst = []
    for k in range(round(duration / PERIOD)):
        theta, v, a = motion(k * PERIOD)
        columns = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        Phi = model.features(v, a, columns)
        behind = Phi @ beta
        worst.append(np.abs(behind - memory.correction).max())
        model.learn(memory, Phi, behind)
    return np.array(worst)


def test_a_dead_time_and_wrong_friction_are_learnt():
    model, memory = drives()
    beta = np.zeros(SIZE)
    beta[DEAD_TIME], beta[1:7], beta[14:37:4] = 3e-3, 1e-4 * np.array([1, -1, 2, 0, 1, -2]), 0.3
    behind = run(model, memory, 3.0, beta)
    assert behind[0] > 1e-3
    assert behind[-250:].max() < 2e-5
    assert memory.beta[DEAD_TIME] == pytest.approx(3e-3, abs=1e-4)


def test_a_load_that_turns_over_with_the_motion_is_not_taken_for_friction():
    # What a payload whose centre is elsewhere weighs at the wrist changes its sign as the motion does.
    def friction(last: int) -> np.ndarray:
        """By how much Coulomb friction was ever believed to be off, which it is not; shape (6,)."""
        model, memory = drives()
        worst = np.zeros(6)
        for k in range(500):
            theta, v, a = motion(k * PERIOD)
            loads = LOADS.copy()
            loads[2, :6] = 9.81 * np.sin(3.0 * theta)
            columns = model.command(memory, (theta, v, a), loads, 7.0).regressors
            Phi = model.features(v, a, columns)
            behind = 0.05 * Phi[:, MOMENT.start]
            Phi[:, last + 1 :] = 0.0  # columns that the model is to do without
            model.learn(memory, Phi, behind)
            worst = np.maximum(worst, np.abs(memory.beta[15:37:4]))
        return worst

    with_moment, without = friction(MOMENT.stop), friction(MASS)
    assert with_moment.max() < 0.3 * without.max()


@pytest.mark.parametrize("pace", [1.0, 2.0, 5.0, 12.0])
def test_a_joint_whose_model_does_not_hold_leaves_the_others_on_their_plan(pace):
    """All are 3 ms late, and one is off by a centiradian besides that no parameter stands for."""
    model, memory = drives()
    beta, others = np.zeros(SIZE), [0, 1, 2, 4, 5]
    beta[DEAD_TIME] = 3e-3
    for k in range(750):
        theta, v, a = motion(k * PERIOD)
        Phi = model.features(v, a, model.command(memory, (theta, v, a), LOADS, 7.0).regressors)
        behind = Phi @ beta
        behind[3] += 1e-2 * np.sin(pace * k * PERIOD)
        model.learn(memory, Phi, behind)
    left = Phi @ (beta - memory.beta)
    assert np.abs(left[others]).max() < 5e-5


def test_a_load_that_drives_hold_unlike_belief_is_learnt_joint_by_joint():
    """The gains of a robot's controller follow the load that it was told, most of all in the wrist."""
    model, memory = drives()
    beta = np.zeros(SIZE)
    # Drives know nothing of the 7 kg that they are believed to hold.
    beta[NOT_HELD] = 7.0 * np.array([1.0, 1.0, 1.1, 1.3, 2.0, 1.0])
    behind = run(model, memory, 6.0, beta)
    assert behind[-250:].max() < 0.1 * behind[:125].max()
    np.testing.assert_allclose(memory.beta[NOT_HELD][3:5], beta[NOT_HELD][3:5], rtol=0.1)


@pytest.mark.parametrize("share", [-0.3, 0.4])
def test_drives_that_give_way_unlike_belief_are_learnt_where_they_take_no_torques(share):
    model, memory = drives(takes_torque=False)
    beta = np.zeros(SIZE)
    beta[GIVING] = share
    behind = run(model, memory, 3.0, beta)
    assert behind[-250:].max() < 0.05 * behind[:125].max()
    assert (np.abs(memory.beta[GIVING]) > 0.05).all()
    torques, memory = drives()  # what they are given as torques nobody has to make up for
    columns = torques.command(memory, motion(1.0), LOADS, 7.0).regressors
    assert not torques.features(*motion(1.0)[1:], columns)[:, GIVING.start :].any()


@pytest.mark.parametrize(("position", "integral"), [(25.0, 5.0), (25.0, 16.0), (17.0, 10.0), (35.0, 7.0)])
def test_gains_that_nobody_told_are_learnt_where_drives_take_no_torques(position, integral):
    """Drives are e = G w with G = s / (k_d (s + position) (s + integral)), see `DriveModel`."""
    model, memory = drives(takes_torque=False)
    kd, times = model._drives.kd, PERIOD * np.arange(1500)
    planned, needed, known = [motion(time) for time in times], np.empty((1500, 6)), np.empty((1500, 6))
    for k, instant in enumerate(planned):
        model.command(memory, instant, LOADS, 7.0)
        needed[k], known[k] = memory.w[0], memory.z[0, 0, :, 1]
    model, memory = drives(takes_torque=False)
    filters = [([1.0, 0.0], kd[i] * np.polymul([1.0, position], [1.0, integral])) for i in range(6)]
    # From rest, where the drives hold the torque of the first instant
    steps = (needed - needed[0]).T
    behind = np.transpose([lsim(each, w, times)[1] for each, w in zip(filters, steps, strict=True)]) - known
    left = np.empty_like(behind)
    for k, instant in enumerate(planned):
        columns = model.command(memory, instant, LOADS, 7.0).regressors
        left[k] = behind[k] - memory.correction
        model.learn(memory, model.features(*instant[1:], columns), behind[k])
    assert (left[-500:].std(axis=0) < 0.15 * behind[-500:].std(axis=0)).all()


def test_with_torques_other_gains_show_by_a_load_alone_that_drives_do_not_hold():
    model, memory = drives()
    memory.beta[NOT_HELD] = memory.led[0, NOT_HELD] = 7.0
    shown = [model.command(memory, motion(k * PERIOD), LOADS, 7.0).regressors for k in range(50)]
    last = model.features(*motion(49 * PERIOD)[1:], shown[-1])
    weighed = slice(1, 5)  # joints that a load turns
    assert np.abs(last[weighed, OTHER_GAINS]).min() > 0.0


@pytest.mark.parametrize(
    ("kind", "behind"), [("position", 100.0 / 80.0), ("velocity", 100.0 / (7.0 * 100.0))]
)
def test_a_drive_that_follows_one_thing_alone_is_behind_by_its_own_gain(kind, behind):
    robot = load_robot("irb1200")
    belief = ControllerModel(robot, 7.0, PERIOD)
    model = DriveModel(belief, DriveModelConfig(), kind)
    drives = model._drives
    # 100 N m of the motor that nobody gives, after a second
    step, torque = drives.step[0, 1], 100.0 * abs(robot.gear_ratio[1])
    z = np.zeros(2)
    for _ in range(round(1.0 / PERIOD)):
        z = step @ [*z, torque, 0.0]
    assert z[1] == pytest.approx(behind, rel=0.03)


def test_torques_are_sent_ahead_by_the_dead_time_that_was_learnt():
    def torques(dead_time: float, shift: float) -> np.ndarray:
        model, memory = drives()
        memory.beta[DEAD_TIME] = dead_time
        sent = [model.command(memory, motion(k * PERIOD + shift), LOADS, 7.0).torque for k in range(50)]
        return np.array(sent)[2:]

    now, ahead, wanted = torques(0.0, 0.0), torques(3e-3, 0.0), torques(0.0, 3e-3)
    off, left = (np.abs(sent - wanted).max(axis=0) for sent in (now, ahead))
    assert (left < 0.2 * off).all()


def test_a_dead_time_beyond_what_is_left_to_the_drives_does_not_make_torques_jump():
    def largest(dead_time: float) -> np.ndarray:
        model, memory = drives()
        memory.beta[DEAD_TIME] = dead_time
        return np.abs([model.command(memory, motion(k * PERIOD), LOADS, 7.0).torque for k in range(200)]).max(
            0
        )

    np.testing.assert_array_equal(largest(30e-3), largest(1.5 * PERIOD))


@pytest.mark.parametrize("dead_time", [0.0, 3e-3])
def test_where_a_motor_turns_over_its_friction_is_sent_as_the_mean_of_a_period_and_never_more(dead_time):
    model, memory = drives()
    memory.beta[DEAD_TIME] = dead_time
    believed, acceleration = model._drives, 4.0  # rad/s^2: through all of the width within a period
    assert (acceleration * PERIOD > believed.width).all()
    weightless = [0, 5]  # of the joints: what holds the others changes on the way

    def friction(time: np.ndarray) -> np.ndarray:
        return believed.coulomb * np.tanh(acceleration * time[:, None] / believed.width)

    for k in range(-25, 25):
        time = (k + 0.3) * PERIOD
        v = np.full(6, acceleration * time)
        moved = 0.5 * acceleration * time**2 * np.ones(6)
        sent = model.command(memory, (moved, v, np.full(6, acceleration)), LOADS, 0.0).torque
        if k == -25:
            continue
        # Rotor and viscous friction change evenly.
        even = believed.rotor * acceleration + believed.viscous * acceleration * (
            time + dead_time + 0.5 * PERIOD
        )
        lasts = friction(time + dead_time + np.linspace(0.0, PERIOD, 2001)).mean(axis=0)
        held = memory.w[0] - believed.rotor * acceleration - believed.viscous * v
        left = sent - even - held - lasts
        np.testing.assert_allclose(left[weightless], 0.0, atol=1e-3 * believed.coulomb.min())


def test_of_a_dead_time_all_that_is_commanded_is_late_and_not_the_plan_alone():
    model, memory = drives(takes_torque=False)
    sent, columns = [], []
    for k in range(300):
        theta, v, a = motion(k * PERIOD)
        command = model.command(memory, (theta, v, a), LOADS, 7.0)
        sent.append(command.position)
        columns.append(model.features(v, a, command.regressors)[:, DEAD_TIME])
    rates = np.gradient(np.array(sent), PERIOD, axis=0)[100:-1]
    planned = np.array([motion(k * PERIOD)[1] for k in range(100, 299)])
    off = np.std(np.array(columns)[100:-1] - rates, axis=0)
    assert (off < 0.2 * np.std(planned - rates, axis=0)).all()


@pytest.mark.parametrize("bandwidth", [30.0, 100.0, 0.0])
def test_what_the_planner_of_egm_is_behind_is_a_multiple_of_its_column_at_any_frequency(bandwidth):
    model, memory = drives(takes_torque=False)
    egm = EgmMotion(EgmMotionConfig(bandwidth=bandwidth), PERIOD)
    context, behind, column = egm.CreateDefaultContext(), [], []
    egm.set_at_rest(context, motion(0.0)[0])
    for k in range(1000):
        theta, v, a = motion(k * PERIOD)
        columns = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
        egm.GetInputPort("position_command").FixValue(context, theta)
        egm.GetInputPort("velocity_command").FixValue(context, v)
        behind.append(theta - egm.GetOutputPort("position_command").Eval(context))
        column.append(model.features(v, a, columns)[:, SMOOTHED])
        context.SetDiscreteState(egm.EvalUniquePeriodicDiscreteUpdate(context))
    y, x = np.ravel(behind[200:]), np.ravel(column[200:])  # from when the start is forgotten
    smoothed = (x @ y) / (x @ x)  # s
    assert np.std(y - smoothed * x) < 0.05 * np.std(y)


def test_what_drives_are_ahead_that_know_their_speed_late_is_a_multiple_of_the_same_column():
    """A filter of T makes a speed loop push, until the position loop with its gain p holds against it."""
    model, memory = drives()
    p, i, gain, late, joint = 25.0, 10.0, 100.0, 1e-3, 1
    times = PERIOD * np.arange(1000)
    planned = np.array([motion(time) for time in times])[:, :, joint]

    def rates(t, state):
        theta, v, seen, integral = state
        wanted, speed, acceleration = (np.interp(t, times, planned[:, k]) for k in range(3))
        error = speed - seen + p * (wanted - theta)
        # The torque that the plan needs is given; of what moves, the inertia is one.
        return [v, acceleration + gain * (error + i * integral), (v - seen) / late, error]

    start = [*planned[0, :2], planned[0, 1], 0.0]
    theta = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-9, max_step=PERIOD).y[0]
    behind = planned[:, 0] - theta
    column = []
    for time in times:
        instant = motion(time)
        columns = model.command(memory, instant, LOADS, 7.0).regressors
        column.append(model.features(*instant[1:], columns)[joint, SMOOTHED])
    y, x = behind[200:], np.array(column[200:])
    lag = -(x @ y) / (x @ x)  # s
    assert np.std(y + lag * x) < 0.1 * np.std(y)
    assert lag == pytest.approx(late, rel=0.1)


def test_the_position_command_makes_up_for_a_torque_that_nobody_gives():
    model, memory = drives(takes_torque=False)
    kd, kp, ki = model._drives.kd[1], model._drives.kp[1], model._drives.ki[0, 1]
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
            columns = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
            unknown = 2e-5 * np.sin(3.0 * k * PERIOD + np.arange(6))
            model.learn(memory, model.features(v, a, columns), unknown + 1e-6 * rng.normal(size=6))
    assert abs(slow[1].beta[MASS]) <= abs(quick[1].beta[MASS]) + 1e-12
    assert np.abs(slow[1].beta).max() < np.abs(quick[1].beta).max()


def test_what_is_learnt_does_not_make_the_command_jump():
    # All at once the dead time is known to be 20 ms longer: the command goes there smoothly, within 0.2 s.
    model, memory = drives()
    added = []
    for k in range(300):
        memory.beta[DEAD_TIME] = 0.0 if k < 200 else 20e-3
        theta, v, a = motion(k * PERIOD)
        position, velocity, *_ = model.command(memory, (theta, v, a), LOADS, 7.0)
        added.append(position - theta)
        assert np.isfinite(velocity).all()
    np.testing.assert_allclose(added[199], 0.0, atol=1e-12)
    there = np.abs(20e-3 * v).max()
    # At 40 rad/s the first tick makes (w T)^2 / (1 + w T)^2 of the way, 0.02; v has changed since then.
    assert np.abs(np.diff(added[199:], n=2, axis=0)).max() < 0.05 * there
    np.testing.assert_allclose(added[-1], 20e-3 * v, atol=1e-3 * there)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.02, 0.06])
def test_friction_that_is_larger_at_low_speeds_is_made_up_for(velocity):
    # The hump of these motors is Reiner's (2.4), highest at a velocity; that of the model is Tustin's.
    model, memory = drives()
    times = PERIOD * np.arange(1500)
    v = 0.3 * motion(times[:, None])[1]
    hump = 0.3 * model._drives.coulomb * 2.0 * v * velocity / (v**2 + velocity**2)
    gains = zip(model._drives.kd, model._drives.kp, model._drives.ki[0], strict=True)
    behind = np.transpose(
        [lsim(([1.0, 0.0], gain), torque, times)[1] for gain, torque in zip(gains, hump.T, strict=True)]
    )
    left = np.empty_like(behind)
    for k, time in enumerate(times):
        theta, rate, a = (0.3 * each for each in motion(time))
        columns = model.command(memory, (theta, rate, a), LOADS, 7.0).regressors
        left[k] = behind[k] - memory.correction
        model.learn(memory, model.features(rate, a, columns), behind[k])
        if k == 250:  # motors keep to their plan from now on; nothing was said of humps before
            assert not memory.beta[16:37:4].any()
            model.open_low_speeds(memory)
    # Two shapes of a hump differ by up to a fifth of it.
    assert left[-500:].std() < 0.3 * behind[-500:].std()


@pytest.mark.parametrize("robot", ["kr16", "kr16-realistic"])
def test_friction_that_is_off_by_a_third_is_not_taken_for_another_load(robot):
    """Whether the robot's file has it as two numbers or as a curve; of the wrists it is a milliradian."""
    model, memory = drives(robot=robot)
    theta, v, a = motion(1.0)
    columns = model.command(memory, (theta, v, a), LOADS, 7.0).regressors
    behind = 0.3 * load_robot("kr16").joint_coulomb_friction / model._drives.kp
    assert behind.max() > 1e-3
    left = [
        model.look_back(memory, (theta, v, a), columns, np.zeros(6), theta - each, most=-1.0)
        for each in (behind, behind + 4e-4)
    ]
    assert left[0] <= 1e-12
    assert 3e-4 < left[1] <= 4e-4 + 1e-12


def test_friction_is_learnt_anew_where_the_load_was_another_one():
    """With a load that nobody told motors are off their plan, and turn over at other times than planned."""
    model, memory = drives()
    model.open_low_speeds(memory)
    friction = np.r_[14:37:4, 15:37:4, SHARP, THIRD]
    memory.beta[friction], memory.P[friction, 0], memory.P[0, friction] = 0.5, 1e-4, 1e-4
    model.widen(memory)
    assert memory.beta[friction].all()
    model.widen(memory, is_told_otherwise=True)
    assert memory.beta[friction].all()  # on the path commands must not leap
    model.widen(memory, is_told_otherwise=True, is_on_path=False)
    assert not memory.beta[friction].any()
    assert not memory.P[SHARP].any()
    assert not memory.P[THIRD].any()
    assert not memory.P[friction, 0].any()
    started = drives()[1].P
    np.testing.assert_array_equal(memory.P[friction[:12]], started[friction[:12]])
    model.open_low_speeds(memory)
    assert (np.diag(memory.P)[np.r_[SHARP, THIRD]] > 0.5).all()


@pytest.mark.parametrize(("robot", "early"), [("kr16", [3, 4, 5]), ("irb1200", [])])
def test_humps_are_open_early_where_friction_moves_a_joint_most(robot, early):
    model, memory = drives(robot=robot)

    def spreads():
        return np.diag(memory.P)[16:37:4].copy()

    model.open_low_speeds(memory, is_early=True)
    assert np.flatnonzero(spreads()).tolist() == early
    assert (np.diag(memory.P)[np.r_[SHARP, THIRD]] > 0.0).all()  # how sharply it turns over
    known = 0.5 * spreads()
    memory.P[np.arange(16, 37, 4), np.arange(16, 37, 4)] = known
    model.open_low_speeds(memory)
    assert spreads().all()
    # What was learnt in the meantime is not forgotten.
    np.testing.assert_array_equal(spreads()[early], known[early])
