"""One motion of axes 1 to 3 under a feedforward, and how the wrist rings after it.

The criterion of Reiner (2010), section 6.2.1: how much the wrist still accelerates once it should be at rest.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, EventStatus, LeafSystem
from scipy.integrate import trapezoid

from diagrams.integration import Integration, IntegratorConfig
from diagrams.scenario.scenario import StationConfig
from diagrams.station import Station
from experiments.cli.workers import Progress
from robots.description.model import NUM_JOINTS, RobotModel
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS, FeedforwardConfig, JointReference
from systems.reference.timing import TIMINGS, Profile

SETTLE = 0.1  # s at rest before the motion
RINGING = 0.9  # s after the motion, T of (6.1)
SPEEDING_UP = 0.5  # s, from rest to the largest speed with the mean acceleration of the motions
_AXES = 3  # that move
_WRIST = 5  # the origin of this link is the point where axes 4, 5 and 6 meet
_MAX_STEP = 2e-3  # s; the ringing of the best feedforward is then right to some percent

Note = Callable[[DiagramBuilder, Station], None]


@dataclass(frozen=True)
class Trial:
    """A motion from rest to rest, all three axes by the same angle at the same time."""

    robot: RobotModel
    payload: float  # kg
    start: np.ndarray  # rad, shape (6,)
    angle: float  # rad, signed
    config: FeedforwardConfig
    plant: RobotModel | None = None  # in the station, if it is another one than the model's
    timing: str = "polynomial"  # of `systems.reference.timing.TIMINGS`
    settle: float = SETTLE  # s at rest before the motion
    speeding_up: float = SPEEDING_UP  # s, see `profile`

    @property
    def profile(self) -> Profile:
        """How far the axes have turned, in rad.

        It takes as long as a constant acceleration would that brings the slowest of them to its largest speed
        in ``speeding_up``, then as constant a deceleration.
        """
        acceleration = float(self.robot.speed[:_AXES].min()) / self.speeding_up
        return TIMINGS[self.timing].lasting(
            2.0 * float(np.sqrt(abs(self.angle) / acceleration)), abs(self.angle)
        )

    def run(self, progress: Progress | None = None) -> float:
        """Simulates it; returns C of (6.1) in m/s."""
        return criterion(*self.ringing(progress))

    def ringing(self, progress: Progress | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Simulates it with the drives of the station and an elastic structure.

        Returns:
            From the end of the motion on: times in s, shape (n,), and how the wrist accelerates, in m/s^2,
            shape (n, 3).
        """
        return self.simulated(progress)[0].found

    def simulated(
        self, progress: Progress | None = None, note: Note | None = None
    ) -> tuple["WristWatch", Context]:
        """Simulates it; returns what the wrist did after the motion, and the context of the diagram.

        Args:
            progress: is called at the end.
            note: adds what else is to be logged, see `at_rest`.
        """
        config = StationConfig(elasticity="structure", payload=self.payload)
        period, ahead = config.period, config.drive.command_delay + config.drive.dead_time
        stop = self.settle + self.profile.duration
        told = commands(self, np.arange(0.0, stop + RINGING, period) + ahead, period)
        simulator, station, integration = at_rest(self.plant or self.robot, config, told, note)
        integration.advance(simulator, stop)
        watch = WristWatch(station)
        watch.begin(simulator)
        integration.advance(simulator, stop + RINGING)
        if progress:
            progress(1.0)
        return watch, simulator.get_context()


class WristWatch:
    """Notes how the wrist of a station accelerates at every step of the integrator."""

    def __init__(self, station: Station) -> None:
        """Takes the station that is simulated."""
        self._plant = station.plant
        self._wrist = station.plant.GetBodyByName(f"link_{_WRIST}")
        self._times: list[float] = []
        self._accelerations: list[np.ndarray] = []

    def begin(self, simulator: Simulator) -> None:
        """Watches from now on."""
        self._record(simulator.get_context())
        simulator.set_monitor(self._record)

    @property
    def found(self) -> tuple[np.ndarray, np.ndarray]:
        """Times in s, shape (n,), and accelerations in m/s^2, shape (n, 3)."""
        return np.array(self._times), np.array(self._accelerations)

    def _record(self, root_context: Context) -> EventStatus:
        own = self._plant.GetMyContextFromRoot(root_context)
        self._times.append(root_context.get_time())
        acceleration = self._plant.EvalBodySpatialAccelerationInWorld(own, self._wrist)
        self._accelerations.append(acceleration.translational())
        return EventStatus.DidNothing()


def at_rest(
    robot: RobotModel, config: StationConfig, told: np.ndarray, note: Note | None = None
) -> tuple[Simulator, Station, Integration]:
    """A station that will be told commands (n, 3, 6), one row a tick, at rest where they begin.

    A note adds systems that log the station, before the diagram is built.
    """
    builder = DiagramBuilder()
    station = Station(builder, robot, config, "cascade", takes_torque=True)
    player = builder.AddNamedSystem("commands", CommandPlayer(told, config.period))
    for index in range(player.num_output_ports()):
        port = player.get_output_port(index)
        builder.Connect(port, station.inputs[port.get_name()])
    if note:
        note(builder, station)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    station.set_at_rest(context, told[0, 0], seed=0)
    rate = station.fastest_rate(context)
    integration = Integration(IntegratorConfig(max_step=_MAX_STEP), config.period, rate)
    integration.initialize(simulator)
    return simulator, station, integration


class CommandPlayer(LeafSystem):
    """Issues commands from a table, one row a tick; after its end the last row.

    Ports:
        out ``position_command``    vector 6 in rad
        out ``velocity_command``    vector 6 in rad/s
        out ``torque_feedforward``  vector 6 in N m
    """

    def __init__(self, commands: np.ndarray, period: float) -> None:
        """Takes commands, shape (n, 3, 6), and the tick in s."""
        super().__init__()
        self._commands, self._period = commands, period
        for index, name in enumerate(("position_command", "velocity_command", "torque_feedforward")):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(commands[0, index]))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._play)

    def _play(self, context: Context, discrete_state: DiscreteValues) -> None:
        tick = min(round(context.get_time() / self._period), len(self._commands) - 1)
        for index, command in enumerate(self._commands[tick]):
            discrete_state.set_value(index, command)


def references(trial: Trial, times: np.ndarray) -> list[JointReference]:
    """Where the links shall be."""
    s, rate, acceleration = trial.profile.at_times(times - trial.settle)
    direction = np.zeros(NUM_JOINTS)
    direction[:_AXES] = np.sign(trial.angle)
    return [
        JointReference(trial.start + direction * x, direction * v, direction * a)
        for x, v, a in zip(s, rate, acceleration, strict=True)
    ]


def commands(trial: Trial, times: np.ndarray, period: float) -> np.ndarray:
    """What the drives are told: positions, velocities and torques, shape (n, 3, 6)."""
    believed = ControllerModel(trial.robot, trial.payload, period)
    return FEEDFORWARDS[trial.config.kind](believed, trial.config).play(references(trial, times))


def criterion(times: np.ndarray, accelerations: np.ndarray) -> float:
    """C in m/s of accelerations in m/s^2, shape (n, 3), at times in s, Reiner (2010) eq. (6.1)."""
    mean = trapezoid(accelerations, times, axis=0) / (times[-1] - times[0])
    return float(trapezoid(np.abs(accelerations - mean), times, axis=0).sum())
