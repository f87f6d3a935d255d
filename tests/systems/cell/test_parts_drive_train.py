"""One motor and one link with the parts of a drive train between them: passive, each doing its own."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Gain,
    LinearSystem,
    LogVectorOutput,
    Multiplexer,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial

from robots.description.drive_parts import (
    Backlash,
    Cubic,
    Dahl,
    Efficiency,
    FourierRatio,
    Polynomial,
    Sigmoid,
    StickSlip,
    Stribeck,
    Tanh,
    ViscoElastic,
)
from robots.description.drive_train import DriveTrain
from robots.drivetrain.train import DriveTrains
from systems.cell.parts_drive_train import DriveTrainParts

ROTOR, LINK = 0.3, 2.0  # kg m^2
PARTS = {
    "sigmoid": {"friction": Sigmoid(5.0, 2.0, 200.0)},
    "tanh": {"friction": Tanh(5.0, 2.0, 0.01)},
    "stribeck": {"friction": Stribeck(5.0, 2.0, 200.0, 1.0, 0.02)},
    "polynomial": {"friction": Polynomial(2.0, 200.0, 0.05, 3.0, 5.0)},
    "stick_slip": {"friction": StickSlip(5.0, 2.0, 3.0)},
    "cubic": {"stiffening": Cubic(1e6)},
    "uneven ratio": {"ratio_error": FourierRatio([2e-5, 1e-4], [2.0, 1.0], [30.0, 0.0])},
    "efficiency": {"efficiency": Efficiency(0.9, 0.8)},
    "backlash": {"backlash": Backlash(3.0)},
    "viscoelastic": {"backlash": ViscoElastic(2e4, 1e4, 50.0)},
    "hysteresis": {"hysteresis": Dahl([0.1, 0.2], [5e-4, 2e-4])},
}
PARTS["all"] = {name: part for of_one in PARTS.values() for name, part in of_one.items()} | {
    "friction": PARTS["stribeck"]["friction"],
    "backlash": Backlash(3.0),
}


def train(**parts) -> DriveTrain:
    return DriveTrain(ratio=100.0, rotor_inertia=3e-5, stiffness=4.5e4, **parts)


def turning(inertia: float) -> LinearSystem:
    """Angle and speed of a body under a torque."""
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / inertia]])
    return LinearSystem(A, B, np.eye(2), np.zeros((2, 1)))


class Rig:
    """A motor under a torque, its train, and a link; the link alone is the plant."""

    def __init__(self, parts: DriveTrain, torque: np.ndarray | float = 0.0, load: float = 0.0) -> None:
        """A torque of the motor in N m, held for 10 ms each if there are many; a load of the link in N m."""
        builder = DiagramBuilder()
        self.train = DriveTrainParts(builder, DriveTrains([parts.parts()]))
        self.motor, self.link = (builder.AddSystem(turning(inertia)) for inertia in (ROTOR, LINK))
        samples = np.append(torque, 0.0)[None]
        held = PiecewisePolynomial.ZeroOrderHold([*np.arange(samples.size - 1) * 0.01, 1e3], samples)
        source = builder.AddSystem(TrajectorySource(held))
        loads, total = builder.AddSystem(ConstantVectorSource([load])), builder.AddSystem(Adder(2, 1))
        rest = builder.AddSystem(Adder(2, 1)), builder.AddSystem(Gain(-1.0, 1))
        builder.Connect(self.train.outputs["reaction"], rest[1].get_input_port())
        builder.Connect(source.get_output_port(), rest[0].get_input_port(0))
        builder.Connect(rest[1].get_output_port(), rest[0].get_input_port(1))
        builder.Connect(rest[0].get_output_port(), self.motor.get_input_port())
        builder.Connect(source.get_output_port(), self.train.inputs["motor_torque"])
        builder.Connect(self.motor.get_output_port(), self.train.inputs["motor_state"])
        builder.Connect(self.link.get_output_port(), self.train.inputs["link_state"])
        builder.Connect(self.train.outputs["gear_torque"], total.get_input_port(0))
        builder.Connect(loads.get_output_port(), total.get_input_port(1))
        builder.Connect(total.get_output_port(), self.link.get_input_port())
        # Both states, and the power of the motor.
        both = builder.AddSystem(Multiplexer([2, 2]))
        builder.Connect(self.motor.get_output_port(), both.get_input_port(0))
        builder.Connect(self.link.get_output_port(), both.get_input_port(1))
        self.log = LogVectorOutput(both.get_output_port(), builder, 1e-3)
        self.diagram: Diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.root = self.simulator.get_mutable_context()
        self.torque, self.load = samples[0, :-1], load

    def start(self, motor: float = 0.0, link: float = 0.0, deflection: float = 0.0, **config) -> "Rig":
        """At rest under the load, then with speeds in rad/s and the link turned by so much in rad."""
        self.train.set_at_rest(self.root, np.zeros(1), np.full(1, self.load))
        self.motor.GetMyMutableContextFromRoot(self.root).SetContinuousState([0.0, motor])
        q = self.train.trains.at_rest(np.full(1, self.load), np.zeros(1))[0][0] + deflection
        self.link.GetMyMutableContextFromRoot(self.root).SetContinuousState([q, link])
        options = {"integration_scheme": "runge_kutta3", "accuracy": 1e-4, "max_step_size": 1e-3} | config
        ApplySimulatorConfig(SimulatorConfig(**options), self.simulator)
        self.simulator.Initialize()
        return self

    def energy(self) -> float:
        states = (system.GetMyContextFromRoot(self.root) for system in (self.motor, self.link))
        (theta, w), (q, v) = (context.get_continuous_state_vector().CopyToVector() for context in states)
        memory, trains = self.train.memory(self.root), self.train.trains
        stored = trains.energy(memory, np.array([theta]), np.array([q - theta]))
        return stored + 0.5 * ROTOR * w**2 + 0.5 * LINK * v**2 - self.load * q

    def states(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) and theta, omega, q, v, shape (4, n), every millisecond."""
        log = self.log.FindLog(self.root)
        return log.sample_times(), log.data()


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("start", [(0.3, -0.2, 1e-3), (-1.0, -0.8, 0.0)], ids=str)
def test_left_alone_a_train_only_loses_energy(name: str, start: tuple[float, float, float]):
    rig = Rig(train(**PARTS[name], damping=10.0)).start(*start)
    energies = [rig.energy()]
    for k in range(1, 13):
        rig.simulator.AdvanceTo(5e-3 * k)
        energies.append(rig.energy())
    assert np.diff(energies).max() < 1e-4 * energies[0]  # the integrator's accuracy
    assert energies[-1] < 0.999 * energies[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_under_any_torque_a_train_stores_no_more_than_it_was_given(name: str):
    """The work of the motor is exact for a torque that is held while it turns from one angle to another."""
    torque = np.random.default_rng(3).normal(scale=30.0, size=10)
    rig = Rig(train(**PARTS[name]), torque).start()
    given, last = 0.0, 0.0
    for k, held in enumerate(torque, 1):
        rig.simulator.AdvanceTo(0.01 * k)
        theta = rig.states()[1][0, -1]
        given, last = given + held * (theta - last), theta
        assert rig.energy() < given + 1e-4
    assert given > 0.02  # J


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cubic", "uneven ratio"])
def test_what_has_no_loss_conserves_energy(name: str):
    rig = Rig(train(**PARTS[name])).start(1.0, -1.0, 2e-3, accuracy=1e-7)
    before = rig.energy()
    rig.simulator.AdvanceTo(0.03)
    assert rig.energy() == pytest.approx(before, rel=1e-5)


def test_a_coasting_joint_with_stick_slip_stops_and_stays():
    rig = Rig(train(friction=StickSlip(1.0, 2.0, 3.0), damping=50.0)).start(0.5, 0.5)
    rig.simulator.AdvanceTo(2.0)
    _, (theta, omega, _, _) = rig.states()
    assert abs(omega[-200:]).max() < 1e-9
    assert np.ptp(theta[-200:]) < 1e-11
    # J w' = -F - d w, from 0.5 rad/s with both inertias, until it sticks.
    inertia, exact = 0.3 + LINK, np.linspace(0.0, 1.0, 9)
    expected = (0.5 + 2.0) * np.exp(-exact / inertia) - 2.0
    moving = expected > 0.05
    np.testing.assert_allclose(omega[(1000 * exact).astype(int)][moving], expected[moving], atol=5e-3)


def test_a_joint_that_sticks_holds_its_load_without_creeping_and_breaks_away_beyond():
    for load, moves in ((2.9, False), (3.1, True)):
        rig = Rig(train(friction=StickSlip(0.0, 2.0, 3.0), damping=50.0), load=load).start()
        rig.simulator.AdvanceTo(1.0)
        theta = rig.states()[1][0]
        assert (abs(theta[-1]) > 0.05) == moves
        assert moves or abs(theta).max() < 1e-9


def test_a_motor_gives_its_torque_late():
    """Unhindered it turns by u (t^2 / 2 - T t + T^2 (1 - exp(-t / T))) / J, from eq. (2.2)."""
    T, u = 3e-3, 5.0
    rig = Rig(train(motor_lag=T, backlash=Backlash(600.0)), u).start(accuracy=1e-8)
    rig.simulator.AdvanceTo(0.02)
    t, (theta, _, _, _) = rig.states()
    expected = u / 0.3 * (0.5 * t**2 - T * t + T**2 * (1.0 - np.exp(-t / T)))
    np.testing.assert_allclose(theta, expected, atol=1e-8)


def test_within_the_gap_nothing_is_transmitted_and_beyond_it_the_spring_acts():
    trains = DriveTrains([train(backlash=Backlash(3.0), damping=10.0).parts()])
    half, still = np.deg2rad(0.5 * 3.0 / 60.0), (np.zeros(1), np.zeros(1))
    for x in np.linspace(-3.0, 3.0, 61) * half:
        found = trains.torques(np.zeros(0), still, (np.full(1, x), np.zeros(1)), np.zeros(1))
        beyond = np.sign(x) * max(abs(x) - half, 0.0)
        assert found.link[0] == pytest.approx(-4.5e4 * beyond, abs=1e-12)
        for rate in (-100.0, 100.0):
            pushed = trains.torques(np.zeros(0), still, (np.full(1, x), np.full(1, rate)), np.zeros(1)).link[
                0
            ]
            assert pushed * beyond <= 0.0  # teeth never pull


def test_an_uneven_ratio_shakes_the_link_twice_a_turn_of_the_motor():
    rig = Rig(train(ratio_error=FourierRatio([2e-5], [2.0], [40.0]), damping=500.0))
    rig.start(0.05, 0.05)
    rig.simulator.AdvanceTo(4.0)
    _, (theta, _, q, _) = rig.states()
    lead, turns = q - theta, 100.0 * theta / (2.0 * np.pi)
    wave = np.exp(-2j * np.pi * np.outer([1.0, 2.0, 3.0], turns))
    settled = turns > turns[-1] - 2.0
    once, twice, thrice = 2.0 * np.abs((wave * (lead - lead.mean()))[:, settled].mean(1))
    assert twice == pytest.approx(2e-5, rel=0.02)
    assert max(once, thrice) < 0.05 * twice


def test_a_train_at_rest_stays_at_rest():
    parts = {
        "hysteresis": PARTS["hysteresis"]["hysteresis"],
        "ratio_error": FourierRatio([2e-5], [2.0], [9.0]),
    }
    for backlash in (Backlash(0.5), ViscoElastic(2e4, 1e4, 50.0)):
        described = train(**parts, backlash=backlash, motor_lag=3e-3, damping=50.0)
        load = -12.0
        e = described.parts().ratio.position_error(np.zeros(1))[1][0]  # type: ignore[union-attr]
        rig = Rig(described, -load * (1.0 + e), load).start()
        rig.simulator.AdvanceTo(0.3)
        _, states = rig.states()
        assert np.ptp(states, axis=1).max() < 1e-9
