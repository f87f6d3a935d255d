"""What tests of systems share: signals as functions of time, cameras, hand-cranked laws and guards."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import RandomSource

from robots.description.model import RobotModel
from robots.kinematics.forward import Kinematics
from systems.cell.pose_camera import BLOCK, ExposureConfig
from systems.controller_model import ControllerModel
from systems.guard.guard import KINDS, CommandGuard, GuardConfig
from systems.reference.reference import PathMoment
from systems.samples import JointSample, PoseSample
from systems.servo import LAWS, LawConfig

PERIOD = 4e-3  # s


def pose(X: np.ndarray) -> RigidTransform:
    """A homogeneous matrix as a Drake transform."""
    return RigidTransform(RotationMatrix(X[:3, :3]), X[:3, 3])


class VectorSignal(LeafSystem):
    """One vector output, a function of time."""

    def __init__(self, signal: Callable[[float], np.ndarray]) -> None:
        super().__init__()
        size = np.size(signal(0.0))
        self.DeclareVectorOutputPort(
            "signal",
            size,
            lambda context, output: output.set_value(signal(context.get_time())),
            {self.time_ticket()},
        )


class ValueSignal(LeafSystem):
    """One abstract output, a function of time."""

    def __init__(self, signal: Callable[[float], Any]) -> None:
        super().__init__()
        self.DeclareAbstractOutputPort(
            "signal",
            lambda: Value(signal(0.0)),
            lambda context, output: output.set_value(signal(context.get_time())),
            {self.time_ticket()},
        )


def camera_samples(
    camera: LeafSystem,
    config: ExposureConfig,
    times: np.ndarray,
    tip: Callable[[float], RigidTransform],
    q: np.ndarray | None = None,
    seed: int = 0,
) -> list[PoseSample]:
    """What a camera reports at the given times, wired as in a station; ``q`` are the joints in rad."""
    builder = DiagramBuilder()
    builder.AddSystem(camera)
    builder.Connect(builder.AddSystem(ValueSignal(tip)).get_output_port(), camera.GetInputPort("X_WE"))
    noise = camera.GetInputPort("noise")
    source = RandomSource(RandomDistribution.kGaussian, noise.size(), BLOCK * config.period)
    builder.Connect(builder.AddSystem(source).get_output_port(), noise)
    if q is not None:
        state = builder.AddSystem(VectorSignal(lambda time: np.concatenate([q, np.zeros(6)])))
        builder.Connect(state.get_output_port(), camera.GetInputPort("motor_state"))
    builder.ExportOutput(camera.GetOutputPort("pose_sample"), "pose_sample")
    diagram: Diagram = builder.Build()
    simulator = Simulator(diagram)
    context: Context = simulator.get_mutable_context()
    diagram.SetRandomContext(context, RandomGenerator(seed))
    found = []
    for time in times:
        simulator.AdvanceTo(time)
        found.append(diagram.GetOutputPort("pose_sample").Eval(context))
    return found


def arrivals(config: ExposureConfig, count: int) -> np.ndarray:
    """Times in s at which the first samples of a camera have arrived, one from each exposure, (count,)."""
    return config.delay + config.period * (np.arange(count) + 0.5)


class GuardRig:
    """A guard, ticked by hand as the simulator would: first its output is read, then it remembers."""

    def __init__(self, robot: RobotModel, config: GuardConfig | None = None, start=None, **options) -> None:
        limits: dict[str, Any] = {"correction_limit": 0.1, "correction_limit_deg": 20.0}
        self.guard = CommandGuard(robot, config or GuardConfig(), PERIOD, **(limits | options))
        self.context = self.guard.CreateDefaultContext()
        self.start = np.zeros(6) if start is None else start
        self.ticks, self.running = 0, True

    @property
    def time(self) -> float:
        """The time of the next tick in s."""
        return self.ticks * PERIOD

    def hear(self, joints: np.ndarray) -> None:
        """Where the joints are, in rad, shape (6,)."""
        sample = JointSample(self.time, joints, np.zeros(6), np.zeros(6), self.running)
        self.guard.GetInputPort("joint_sample").FixValue(self.context, Value(sample))

    def issued(self) -> tuple[np.ndarray, np.ndarray]:
        """Position (rad) and velocity (rad/s) that are issued now, (6,) each."""
        decision = self.guard.GetOutputPort("decision").Eval(self.context)
        return decision[:6].copy(), decision[6:12].copy()

    def tick(self, position, velocity=None, seen: float = np.inf, refused: int = 0, correction=None):
        """Issues one command; ``seen`` is the time of the last sample in s, by default the present.

        Returns:
            Position (rad), velocity (rad/s) and the counts by kind.
        """
        self.context.SetTime(self.time)
        values = {
            "position_command": position,
            "velocity_command": np.zeros(6) if velocity is None else velocity,
            "correction": np.zeros(6) if correction is None else correction,
            "measurement": np.array([min(seen, self.time), refused, min(seen, self.time)]),
        }
        for name, value in values.items():
            self.guard.GetInputPort(name).FixValue(self.context, value)
        self.hear(self.start)
        issued, speed = self.issued()
        self.context.SetDiscreteState(self.guard.EvalUniquePeriodicDiscreteUpdate(self.context))
        counts = self.guard.GetOutputPort("guard_status").Eval(self.context)
        self.ticks += 1
        return issued, speed, dict(zip(KINDS, counts.astype(int).tolist(), strict=True))


@dataclass(frozen=True)
class _Wanted:
    """What a law asks of a `PathAhead`, from a function of time."""

    path: Callable[[float], tuple[np.ndarray, np.ndarray]]

    def moment(self, t: float) -> PathMoment:
        X_WD, V_WD = self.path(t)
        return PathMoment(X_WD[:3], V_WD, np.zeros(6))

    def path_time(self, t: float) -> float:
        return t


def assert_within_limits(robot: RobotModel, positions: np.ndarray, velocities: np.ndarray) -> None:
    """Speed and acceleration of every joint from each command to the next; (n, 6) in rad and rad/s."""
    slack, steps = 1.0 + 1e-8, np.diff(positions, axis=0)
    assert (np.abs(velocities) <= robot.speed * slack).all()
    assert (np.abs(steps) <= robot.speed * PERIOD * slack + 1e-12).all()
    assert (np.abs(np.diff(velocities, axis=0)) <= robot.acceleration * PERIOD * slack).all()
    assert (np.abs(np.diff(steps, axis=0)) <= robot.acceleration * PERIOD**2 * slack + 1e-12).all()


class LawRig:
    """A law on a perfect robot: what it commands at a tick is where the joints are at the next.

    The camera sees the tip of the *true* robot, which may differ from the nominal one of the law, a given
    number of ticks late.
    """

    def __init__(
        self,
        law: str,
        nominal: RobotModel,
        path: Callable[[float], tuple[np.ndarray, np.ndarray]],
        q: np.ndarray,
        true: RobotModel | None = None,
        config: LawConfig | None = None,
        delay: int = 1,
        preview: float = 0.0,
    ) -> None:
        model = ControllerModel(
            nominal, period=PERIOD, preview=preview, camera_delay=0.2, command_delay=preview
        )
        config = LAWS[law].Config(**vars(config or LawConfig()))
        self.law = LAWS[law](model, config, GuardConfig())
        self.context = self.law.CreateDefaultContext()
        self.law.GetInputPort("reference").FixValue(self.context, Value[object](_Wanted(path)))
        self.true = Kinematics(true or nominal)
        self.delay = delay
        self.q = q
        self.tips: list[np.ndarray] = []  # X_WE at the ticks so far
        self.ticks, self.running = 0, True

    def output(self, name: str) -> np.ndarray:
        """What an output port of the law says now."""
        return self.law.GetOutputPort(name).Eval(self.context).copy()

    def tick(self, sample: PoseSample | None = None) -> np.ndarray:
        """One tick; a sample that is given replaces the camera's. Returns the position command in rad."""
        time = self.ticks * PERIOD
        self.tips.append(self.true.forward(self.q))
        if sample is None:
            exposed = self.ticks - self.delay
            sample = PoseSample()
            if exposed >= 0:
                sample = PoseSample(exposed * PERIOD, pose(self.tips[exposed]), True)
        self.context.SetTime(time)
        joints = JointSample(time, self.q, np.zeros(6), np.zeros(6), True)
        self.law.GetInputPort("joint_sample").FixValue(self.context, Value(joints))
        self.law.GetInputPort("pose_sample").FixValue(self.context, Value(sample))
        self.context.SetDiscreteState(self.law.EvalUniquePeriodicDiscreteUpdate(self.context))
        command = self.output("position_command")
        if np.isfinite(command).all():
            self.q = command
        self.ticks += 1
        return command

    def run(self, duration: float) -> np.ndarray:
        """Ticks for so many seconds. Returns the true tips X_WE at all ticks so far, shape (n, 4, 4)."""
        for _ in range(round(duration / PERIOD)):
            self.tick()
        return np.array(self.tips)
