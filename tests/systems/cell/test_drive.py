"""The drives: torque by torque against their formulas, and closed around a rigid robot."""

from collections.abc import Callable

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Demultiplexer,
    LogVectorOutput,
    Multiplexer,
    ZeroOrderHold,
)

from robots.description.model import load_robot
from robots.dynamics.plant import add_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import Kinematics, robust_inverse
from systems.cell.drive import CascadeGains, Drive, DriveConfig, PiGains
from systems.cell.drive_train import CoulombFriction
from systems.cell.motors import motor_controllers
from systems.reference.paths import ReferenceConfig, make_path
from tests.systems.rigs import PERIOD, VectorSignal

ROBOT = load_robot("irb1200")
POSE = np.deg2rad([20.0, 30.0, -10.0, 40.0, 60.0, -25.0])
CONFIG = DriveConfig()
Command = tuple[np.ndarray, np.ndarray]


def rigid_plant(payload: float) -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    add_robot(plant, ROBOT, "rigid", payload)
    plant.Finalize()
    return plant


def gravity_torque(theta: np.ndarray, payload: float = 0.0) -> np.ndarray:
    plant = rigid_plant(payload)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, theta)
    return -plant.CalcGravityGeneralizedForces(context)


class Controllers:
    """Drives and their loops on motors whose state comes from a port."""

    def __init__(
        self,
        builder: DiagramBuilder,
        kind: str,
        config: DriveConfig,
        payload: float,
        motor_state: OutputPort,
        takes_torque=False,
    ) -> None:
        self.drive = builder.AddSystem(Drive(ROBOT, kind, config, PERIOD, payload, takes_torque))
        self.loops = builder.AddSystem(motor_controllers(self.drive.gains))
        inputs = builder.AddSystem(Multiplexer([6, 6, 12]))
        parts = builder.AddSystem(Demultiplexer([6, 6, 12]))
        for index, name in enumerate(("acceleration", "added_torque")):
            builder.Connect(self.drive.GetOutputPort(name), inputs.get_input_port(index))
        builder.Connect(motor_state, inputs.get_input_port(2))
        builder.Connect(motor_state, self.drive.GetInputPort("motor_state"))
        builder.Connect(inputs.get_output_port(), self.loops.get_input_port())
        builder.Connect(self.loops.get_output_port(), parts.get_input_port())
        builder.Connect(parts.get_output_port(2), self.drive.GetInputPort("setpoint"))
        self.motor_torque, self.setpoint = parts.get_output_port(0), parts.get_output_port(2)

    def set_at_rest(self, root: Context, theta: np.ndarray) -> None:
        self.drive.set_at_rest(root, theta)
        loops = self.loops.GetMyMutableContextFromRoot(root)
        loops.SetContinuousState(np.concatenate([theta, np.zeros(12)]))


def torques(kind: str, state: Callable, command: Callable, times, payload: float = 0.0, config=CONFIG):
    """Motor torques and the set-point, with the motors moved by force: state(t) is given."""
    builder = DiagramBuilder()
    motor_state = builder.AddSystem(VectorSignal(lambda t: np.concatenate(state(t)))).get_output_port()
    controllers = Controllers(builder, kind, config, payload, motor_state)
    signals = {
        "position_command": lambda t: command(t)[0],
        "velocity_command": lambda t: command(t)[1],
    }
    for name, signal in signals.items():
        source = builder.AddSystem(VectorSignal(signal))
        builder.Connect(source.get_output_port(), controllers.drive.GetInputPort(name))
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-8), simulator)
    root = simulator.get_mutable_context()
    controllers.set_at_rest(root, command(0.0)[0])
    found = {"motor_torque": [], "setpoint": []}
    for time in times:
        # Until just after the ticks, at which the load is determined anew.
        simulator.AdvanceTo(time + 1e-9)
        for name, port in (("motor_torque", controllers.motor_torque), ("setpoint", controllers.setpoint)):
            found[name].append(port.Eval(port.get_system().GetMyContextFromRoot(root)))
    return {name: np.array(values) for name, values in found.items()}


def still(theta: np.ndarray) -> Callable[[float], Command]:
    return lambda time: (theta, np.zeros(6))


def motion(kind: str, command: Callable, duration: float, config=CONFIG, load=0.0, known_load=0.0, extra=0.0):
    """Motor positions and velocities (n, 6) at the ticks of a rigid robot that starts at the command."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(rigid_plant(load))
    controllers = Controllers(
        builder, kind, config, known_load, plant.get_state_output_port(), takes_torque=extra != 0.0
    )
    drive, friction = controllers.drive, builder.AddSystem(CoulombFriction(ROBOT))
    joint_torque = builder.AddSystem(Adder(2, 6))
    builder.Connect(plant.get_state_output_port(), friction.get_input_port())
    builder.Connect(controllers.motor_torque, joint_torque.get_input_port(0))
    builder.Connect(friction.get_output_port(), joint_torque.get_input_port(1))
    builder.Connect(joint_torque.get_output_port(), plant.get_actuation_input_port())
    holds = []
    for k, name in enumerate(("position_command", "velocity_command")):
        signal = builder.AddSystem(VectorSignal(lambda time, k=k: command(time)[k]))
        hold = builder.AddSystem(ZeroOrderHold(PERIOD, 6))
        holds.append(hold)
        builder.Connect(signal.get_output_port(), hold.get_input_port())
        builder.Connect(hold.get_output_port(), drive.GetInputPort(name))
    if extra:
        feedforward = builder.AddSystem(ConstantVectorSource(np.full(6, extra)))
        builder.Connect(feedforward.get_output_port(), drive.GetInputPort("torque_feedforward"))
    log = LogVectorOutput(plant.get_state_output_port(), builder, PERIOD)
    simulator = Simulator(builder.Build())
    # Velocity control of the light wrist is stiff: 100 N m s / rad times the gear on 0.2 kg m^2.
    scheme = "radau3" if kind == "velocity" else "runge_kutta3"
    ApplySimulatorConfig(SimulatorConfig(integration_scheme=scheme, accuracy=1e-4), simulator)
    root = simulator.get_mutable_context()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), command(0.0)[0])
    controllers.set_at_rest(root, command(0.0)[0])
    for hold, value in zip(holds, command(0.0), strict=True):
        hold.SetVectorState(hold.GetMyMutableContextFromRoot(root), value)
    simulator.AdvanceTo(duration)
    states = log.FindLog(root).data().T
    return states[:, :6], states[:, 6:]


@pytest.mark.parametrize("kind", ["position", "velocity", "cascade"])
@pytest.mark.parametrize("payload", [0.0, 7.0])
def test_at_its_setpoint_a_drive_gives_just_the_torque_of_gravity(kind: str, payload: float):
    found = torques(kind, still(POSE), still(POSE), [0.02], payload)
    np.testing.assert_allclose(found["motor_torque"][0], gravity_torque(POSE, payload), atol=1e-9)


@pytest.mark.parametrize(("kind", "gain"), [("position", 80.0), ("velocity", 1.0)])
def test_the_published_gains_are_motor_torques_so_a_joint_gets_them_times_its_gear(kind: str, gain: float):
    off = 1e-3 * np.arange(1, 7)
    found = torques(kind, still(POSE - off), still(POSE), [0.0])
    expected = gain * ROBOT.gear_ratio * off + gravity_torque(POSE - off)
    np.testing.assert_allclose(found["motor_torque"][0], expected, rtol=1e-9)


def test_a_velocity_controlled_joint_answers_a_velocity_error_with_its_gain():
    v = np.linspace(-0.2, 0.3, 6)
    found = torques("velocity", lambda t: (POSE, v), still(POSE), [0.0])
    expected = -100.0 * ROBOT.gear_ratio * v + gravity_torque(POSE + 0.5 * PERIOD * v)
    np.testing.assert_allclose(found["motor_torque"][0], expected, rtol=1e-9)


def test_the_cascade_is_a_position_loop_around_a_pi_velocity_loop():
    """The torque of the PID law against P and PI loops integrated by the trapezoidal rule.

    Both start without an error, which is where a PID law and the loops agree in their integral.
    """
    gains = CascadeGains(position=20.0, velocity=100.0, integral=10.0)
    config = DriveConfig(cascade=gains)
    sway = lambda t, w: (POSE + 0.1 * (1.0 - np.cos(w * t)), np.full(6, 0.1 * w * np.sin(w * t)))  # noqa: E731
    times = np.arange(0.0, 0.3, 1e-3)
    found = torques("cascade", lambda t: sway(t, 11.0), lambda t: sway(t, 17.0), times, config=config)
    p, v = (np.array(part) for part in zip(*(sway(t, 11.0) for t in times), strict=True))
    p_wanted, v_wanted = found["setpoint"][:, :6], found["setpoint"][:, 6:]
    velocity_error = gains.position * (p_wanted - p) + v_wanted - v
    integral = np.zeros_like(p)
    integral[1:] = np.cumsum(0.5e-3 * (velocity_error[1:] + velocity_error[:-1]), axis=0)
    plant = rigid_plant(0.0)
    inertia = np.diag(plant.CalcMassMatrix(plant.CreateDefaultContext()))
    torque = inertia * gains.velocity * (velocity_error + gains.integral * integral)
    # Of the last tick, half a tick ahead of it.
    ticks = np.floor(times / PERIOD + 1e-9) * PERIOD
    gravity = np.array([gravity_torque(q + 0.5 * PERIOD * v) for q, v in (sway(t, 11.0) for t in ticks)])
    # h^2/12 of the second derivative, 0.1 rad/s * 20^2 / s^2 * 0.3 s, times 2300 N m s / rad.
    np.testing.assert_allclose(found["motor_torque"] - gravity, torque, atol=0.01)
    assert np.abs(torque).max() > 100.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "config"),
    [
        ("position", DriveConfig(position=PiGains(80.0, 40.0))),
        ("cascade", DriveConfig(cascade=CascadeGains(20.0, 100.0, 10.0))),
    ],
)
def test_an_unknown_load_is_held_in_the_end_without_an_error(kind: str, config: DriveConfig):
    """7 kg that the gravity compensation does not know of, at gains whose integral acts within seconds."""
    theta, _ = motion(kind, still(POSE), 20.0, config, load=7.0)
    sag = np.abs(theta - POSE).max(axis=1)
    assert sag.max() > 1e-3
    assert sag[-1] < 1e-4 * sag.max()


def test_the_proportional_gain_alone_leaves_the_load_over_the_stiffness():
    """So the published K_I = 1 needs 80 s, and a drive that knows its load nothing at all."""
    config = DriveConfig(position=PiGains(80.0, 0.0))
    theta = motion("position", still(POSE), 6.0, config, load=7.0)[0][-1]
    expected = (gravity_torque(theta, 0.0) - gravity_torque(theta, 7.0)) / (80.0 * ROBOT.gear_ratio)
    assert np.abs(expected).max() > 5e-3
    np.testing.assert_allclose(theta - POSE, expected, atol=1e-8)
    theta, _ = motion("position", still(POSE), 0.2, config, load=7.0, known_load=7.0)
    np.testing.assert_allclose(theta[-1], POSE, atol=1e-9)


def test_a_torque_feedforward_adds_to_the_motor_torque():
    config = DriveConfig(position=PiGains(80.0, 0.0))
    theta, _ = motion("position", still(POSE), 2.0, config, extra=5.0)
    np.testing.assert_allclose(theta[-1] - POSE, 5.0 / (80.0 * ROBOT.gear_ratio), rtol=0.05)


@pytest.fixture(scope="module")
def rectangle() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ticks, joint positions and velocities of the first half of the rectangle, with its longest side."""
    path = make_path(ReferenceConfig())
    times = np.arange(0.0, 0.5 * path.dwell_start, PERIOD)
    X, V, _ = path.sample(times)
    q = InverseKinematics(ROBOT).along(X, np.zeros(6))
    qd = (robust_inverse(Kinematics(ROBOT).jacobian(q)) @ V[..., None])[..., 0]
    return times, q, qd


@pytest.mark.parametrize(("kind", "limit"), [("position", 2.0e-3), ("velocity", 2.2e-3), ("cascade", 4.5e-3)])
def test_a_loaded_robot_tracks_the_rectangle_within_milliradians(rectangle, kind: str, limit: float):
    """The motors against the commands one command delay before.

    What remains is the torque of inertia and friction, up to 10 N m, over the stiffness of the drive, from
    2000 N m / rad on. One period more of delay would add 6 mrad at 1.6 rad/s.
    """
    times, q, qd = rectangle
    index = lambda t: min(len(times) - 1, round(t / PERIOD))  # noqa: E731
    theta, _ = motion(kind, lambda t: (q[index(t)], qd[index(t)]), times[-1], load=7.0, known_load=7.0)
    error = np.abs(theta[1 : len(times)] - q[: len(theta) - 1]).max()
    assert 1e-5 < error < limit


def test_refuses_an_unknown_kind():
    with pytest.raises(
        ValueError, match="drive kind must be one of position, velocity, cascade, got 'torque'"
    ):
        Drive(ROBOT, "torque", CONFIG, PERIOD)
