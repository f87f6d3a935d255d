"""The compiled torques of drive trains are those of their parts."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.drivetrain.backlash import contact
from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.efficiency import DirectionalEfficiency
from robots.drivetrain.friction import (
    PolynomialFriction,
    SigmoidFriction,
    StickSlipFriction,
    StribeckFriction,
    TanhFriction,
)
from robots.drivetrain.ratio import FourierRatio
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, GearSpring, LimitedSpring
from robots.drivetrain.train import DriveTrains, JointTrain, SoftBranch

SPRINGS = CubicSpring(4e4, 1e6), ExponentialSpring(3e4, 5e4, 800.0), LimitedSpring(3e4, 1e6, 5e4, 1e-4)
FRICTIONS = (
    SigmoidFriction(5.0, 2.0, 200.0),
    TanhFriction(4.0, 3.0, 0.01),
    StribeckFriction(SigmoidFriction(5.0, 2.0, 200.0), 1.0, 0.02),
    PolynomialFriction(2.0, 200.0, 0.05, 3.0, 5.0),
    StickSlipFriction(5.0, 2.0, 3.0),
)
some = st.sampled_from
maybe_ratio = some([None, FourierRatio(100.0, (0.02, 0.05), (100.0, 200.0), (0.3, 1.0))])
maybe_efficiency = some([None, DirectionalEfficiency(0.9, 0.8, 0.02, 0.03)])
maybe_soft = some([None, SoftBranch(2e4, 1e4, 50.0)])
maybe_hysteresis = some([None, DahlHysteresis((4e3, 8e3), (5e-4, 2e-4)), DahlHysteresis((3e3,), (1e-4,))])
joints = st.builds(
    JointTrain,
    spring=some(SPRINGS),
    damping=some([0.0, 70.0]),
    inertia=some([0.3, 1.0]),
    motor_lag=some([0.0, 3e-3]),
    frictions=st.lists(some(FRICTIONS), max_size=3).map(tuple),
    ratio=maybe_ratio,
    efficiency=maybe_efficiency,
    gap=some([0.0, 3e-4]),
    lubricant=some([0.0, 20.0]),
    soft=maybe_soft,
    hysteresis=maybe_hysteresis,
)


def joint_torques(
    train: JointTrain, torque_unit: float, has_play: bool, state: dict, motion: np.ndarray, command: float
) -> tuple[float, float, dict]:
    """Motor and link torque and the rates of the states of one joint, from the formulas of its parts."""
    theta, speed, x, rate = motion
    slope, rates = 1.0, {}
    if train.ratio:
        error, change = train.ratio.position_error(theta)
        x, rate, slope = x - error, rate - change * speed, 1.0 + change
    beyond = x - np.clip(x, -0.5 * train.gap, 0.5 * train.gap)
    spring, damper = train.spring.torque(beyond), train.damping * rate
    torque = float(contact(beyond, spring, damper)) if train.gap else spring + damper
    torque += train.lubricant * rate * has_play
    if train.soft:
        stretch = train.soft.soft * (x - state["soft"])
        torque += stretch
        rates["soft"] = (stretch - train.soft.damped * state["soft"]) / train.soft.damping
    if train.hysteresis:
        z = state["hysteresis"][: len(train.hysteresis.width)]
        torque += train.hysteresis.torque(z)
        rates["hysteresis"] = train.hysteresis.rate(z, rate)
    motor = slope * torque
    if train.efficiency:
        motor -= train.efficiency.loss(-motor, speed)
    late = torque_unit * state["motor"]
    rates["motor"] = (command - late) / (train.motor_lag or 1.0) / torque_unit
    motor += late if train.motor_lag else command
    motor -= sum(part.torque(speed) for part in train.frictions if not isinstance(part, StickSlipFriction))
    for part in train.frictions:
        if isinstance(part, StickSlipFriction):
            motor -= part.holding(speed, motor, np.asarray(train.inertia))
    return motor, -torque, rates


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.lists(joints, min_size=1, max_size=4), st.integers(0, 2**32 - 1))
def test_the_compiled_torques_are_those_of_the_parts(trains, seed):
    rng, n = np.random.default_rng(seed), len(trains)
    row = DriveTrains(trains)
    motor = rng.normal(size=(2, n)) * rng.choice([0.0, 1e-3, 1.5])
    deflection = rng.normal(size=(2, n)) * [[2e-4], [1e-2]]
    command = rng.normal(size=n) * 50.0
    state = rng.normal(size=row.num_states) * 1e-4
    found = row.torques(state, (motor[0], motor[1]), (deflection[0], deflection[1]), command)
    lags, has_soft = bool(row.motor_lag.any()), any(t.soft for t in trains)
    has_play, ends = any(t.gap for t in trains), [n * lags, n * (lags + has_soft)]
    parts, rates = np.split(state, ends), np.split(found.state_rate, ends)
    elements = parts[2].reshape(n, -1)
    for j, train in enumerate(trains):
        own = {
            "motor": parts[0][j] if lags else 0.0,
            "soft": parts[1][j] if has_soft else 0.0,
            "hysteresis": elements[j],
        }
        motion = np.array([*motor[:, j], *deflection[:, j]])
        expected = joint_torques(train, row.torque_unit[j], has_play, own, motion, command[j])
        # Torques are sums of terms of some hundred N m.
        np.testing.assert_allclose([found.motor[j], found.link[j]], expected[:2], rtol=1e-12, atol=1e-10)
        if lags:
            np.testing.assert_allclose(rates[0][j], expected[2]["motor"], rtol=1e-12)
        if train.soft:
            np.testing.assert_allclose(rates[1][j], expected[2]["soft"], rtol=1e-9, atol=1e-12)
        if train.hysteresis:
            held = rates[2].reshape(n, -1)[j, : len(expected[2]["hysteresis"])]
            np.testing.assert_allclose(held, expected[2]["hysteresis"], rtol=1e-12, atol=1e-15)


def test_springs_of_unknown_kinds_are_refused():
    @dataclass(frozen=True)
    class Rubber(GearSpring):
        c_0: float

        def torque(self, deflection):
            return deflection

        def stiffness(self, deflection):
            return deflection

        def scaled(self, factor):
            return self

    row, still = DriveTrains([JointTrain(Rubber(1.0), 0.0, 1.0)]), (np.zeros(1), np.zeros(1))
    with pytest.raises(TypeError, match="no Rubber"):
        row.torques(np.zeros(0), still, still, np.zeros(1))
