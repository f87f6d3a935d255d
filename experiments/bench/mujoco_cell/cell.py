"""A robot cell on MuJoCo: its drives, encoders and camera are written anew, to the contract of the ports.

Nothing of `systems.cell` or `robots.dynamics` is in it. What differs from the simulated station on purpose:
physics by another engine, Coulomb friction that sticks, drives that are sampled, know their speed from steps
of their encoders and have current loops that lag, set-points on cubics, a camera that exposes between ticks.
"""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

import math
from dataclasses import dataclass, field

import mujoco
import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, LeafSystem, State
from scipy.spatial.transform import Rotation

from experiments.bench.mujoco_cell.arm import STEP, Arm
from experiments.bench.mujoco_cell.gears import WornGears
from systems.samples import JointSample, PoseSample

_BEFORE = 1e-6  # s before a tick, when all until the tick has happened


@dataclass(frozen=True)
class Drives:
    """Position controllers around PI speed controllers around current loops, one a joint."""

    position: float = 25.0  # 1/s
    speed: float = 100.0  # 1/s, torque per error and inertia
    integral: float = 10.0  # 1/s
    delay: float = 7e-3  # s, from a command to the instant at which the drive is there
    lag: float = 4e-4  # s, of a current loop
    speed_filter: float = 1e-3  # s, over which steps of the encoder are a speed
    step: float = 2.0 * math.pi / 2**24  # rad, of the encoders as they know them
    reported_step: float = 2.0 * math.pi / 2**19  # rad, of the angles that the controller reports
    planner: float = (
        0.0  # 1/s, with which a controller before them follows references; they take torques if 0
    )
    planner_lag: float = 2e-3  # s, with which it changes its speed, and so behind what it is told


@dataclass(frozen=True)
class Camera:
    """Poses at regular instants, late and noisy."""

    period: float = 4e-3  # s
    phase: float = 1.5e-3  # s after a tick, when it exposes
    delay: float = 4e-3  # s, until a sample is there
    clock: float = -3e-3  # s, by which its stamps are ahead
    position: float = 5e-5  # m, standard deviation along each axis
    turn: float = math.radians(0.01)  # rad, about each axis


@dataclass
class _Now:
    """What there is at a time."""

    data: mujoco.MjData
    ticks: int = 0
    integral: np.ndarray = field(default_factory=lambda: np.zeros(6))  # rad, of the drives' speed errors
    speed: np.ndarray = field(default_factory=lambda: np.zeros(6))  # rad/s, as the drives know it
    torque: np.ndarray = field(default_factory=lambda: np.zeros(6))  # N m, of the motors
    seen: np.ndarray = field(default_factory=lambda: np.zeros(6))  # rad, as encoders say
    commands: list[np.ndarray] = field(default_factory=list)  # the last ones, (18,) each, newest last
    coming: list[tuple[float, PoseSample]] = field(default_factory=list)  # when samples will be there
    pose: PoseSample = field(default_factory=PoseSample)

    def __deepcopy__(self, memo: dict) -> "_Now":
        """Itself: Drake copies states before updates, and nothing here goes back in time."""
        return self


class MujocoCell(LeafSystem):
    """Ports as of `diagrams.station.SimulatedStation`, and ``truth.X_WE``, (16,).

    Torques are not among them if a controller is before the drives, which plans its own motion.
    """

    def __init__(
        self,
        true: Arm,
        drawn: Arm,
        drives: Drives,
        camera: Camera,
        period: float,
        theta: np.ndarray,
        seed: int,
        gears: WornGears | None = None,
    ) -> None:
        """Puts the robot at rest.

        Args:
            true: the robot that stands there.
            drawn: the robot that the drives' compensation of gravity knows.
            drives, camera: what they are like.
            period: between commands in s, whole steps of the physics.
            theta: where the motors are in the beginning, rad, (6,).
            seed: of the camera's noise.
            gears: of the true robot, if they are more than springs and dampers.
        """
        super().__init__()
        self._gears = gears
        self._true, self._drawn, self._drives, self._camera = true, drawn, drives, camera
        self._period, self._steps = period, round(period / STEP)
        self._weight = mujoco.MjData(drawn.model)
        mujoco.mj_forward(drawn.model, self._weight)
        M = np.zeros((drawn.model.nv, drawn.model.nv))
        mujoco.mj_fullM(drawn.model, self._weight, M)
        self._inertia = np.diag(M)[drawn.motors]
        self._rng = np.random.default_rng(seed)
        begin = _Now(true.data_at_rest(theta), seen=self._read(theta))
        if gears is not None:
            gears.rest(begin.data)
        begin.commands = [np.concatenate([theta, np.zeros(12)])] * (math.ceil(drives.delay / period) + 2)
        begin.torque = self._gravity(begin.seen)
        self._inputs = [
            self.DeclareVectorInputPort(name, 6)
            for name in ("position_command", "velocity_command", "torque_feedforward")[: self.taken]
        ]
        state = self.DeclareAbstractState(Value[object](begin))
        state_ticket = {self.abstract_state_ticket(state), self.time_ticket()}
        self._state = state
        self.DeclareAbstractOutputPort(
            "joint_sample", lambda: Value(JointSample()), self._joint_sample, state_ticket
        )
        self.DeclareAbstractOutputPort(
            "pose_sample", lambda: Value(PoseSample()), self._pose_sample, state_ticket
        )
        self.DeclareVectorOutputPort("truth.X_WE", 16, self._truth, state_ticket)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, period - _BEFORE, self._advance)

    @property
    def taken(self) -> int:
        """How many of the three commands it takes."""
        return 2 if self._drives.planner else 3

    def _now(self, context: Context) -> _Now:
        return context.get_abstract_state(int(self._state)).get_value()

    def _joint_sample(self, context: Context, output) -> None:
        now = self._now(context)
        step = self._drives.reported_step
        angles = np.round(now.data.qpos[self._true.motors] / step) * step
        output.set_value(JointSample(context.get_time(), angles, now.speed.copy(), now.torque.copy(), True))

    def _pose_sample(self, context: Context, output) -> None:
        output.set_value(self._now(context).pose)

    def _truth(self, context: Context, output) -> None:
        output.SetFromVector(self._true.tip(self._now(context).data).ravel())

    def _read(self, theta: np.ndarray) -> np.ndarray:
        return np.round(theta / self._drives.step) * self._drives.step

    def _gravity(self, theta: np.ndarray) -> np.ndarray:
        """What holds the robot of the drawing at theta, N m, (6,)."""
        return self._drawn.holding(self._weight, theta)

    def _advance(self, context: Context, state: State) -> None:
        """From the last tick to the next one."""
        now = self._now(context)
        told = [port.Eval(context) for port in self._inputs]
        command = np.concatenate(told) if len(told) == 3 else self._planned(now.commands[-1], *told)
        now.commands = [*now.commands[1:], command]
        start = now.ticks * self._period
        gravity = self._gravity(now.seen)
        first = round(self._camera.phase / STEP)
        every = round(self._camera.period / STEP)
        for step in range(self._steps):
            if (now.ticks * self._steps + step - first) % every == 0:
                self._expose(now, start + step * STEP)
            self._drive(now, start + step * STEP, gravity)
            now.data.qfrc_applied[self._true.motors] = now.torque
            if self._gears is not None:
                self._gears.step(now.data)
            mujoco.mj_step(self._true.model, now.data)
        now.ticks += 1
        mujoco.mj_kinematics(self._true.model, now.data)
        due = [sample for at, sample in now.coming if at <= now.ticks * self._period + 1e-9]
        if due:
            now.pose, now.coming = due[-1], now.coming[len(due) :]
        state.get_mutable_abstract_state(int(self._state)).set_value(now)

    def _planned(self, last: np.ndarray, position: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """What a controller makes of a reference and its speed: a motion of its own, and no torque, (18,)."""
        drives, T = self._drives, self._period
        wanted = speed + drives.planner * (position - (last[:6] + T * last[6:12]))
        now = last[6:12] + (1.0 - math.exp(-T / drives.planner_lag)) * (wanted - last[6:12])
        return np.concatenate([last[:6] + 0.5 * T * (last[6:12] + now), now, np.zeros(6)])

    def _expose(self, now: _Now, time: float) -> None:
        camera = self._camera
        mujoco.mj_kinematics(self._true.model, now.data)  # a step leaves frames where they were before it
        X = self._true.tip(now.data)
        turn = Rotation.from_rotvec(camera.turn * self._rng.normal(size=3)).as_matrix()
        place = X[:3, 3] + camera.position * self._rng.normal(size=3)
        pose = RigidTransform(RotationMatrix.ProjectToRotationMatrix(turn @ X[:3, :3]), place)
        now.coming.append((time + camera.delay, PoseSample(time + camera.clock, pose, True)))

    def _drive(self, now: _Now, time: float, gravity: np.ndarray) -> None:
        """The torques of the motors from a time on."""
        drives = self._drives
        wanted, speed, forward = self._setpoint(now, time)
        theta = self._read(now.data.qpos[self._true.motors])
        now.speed = now.speed + (STEP / drives.speed_filter) * ((theta - now.seen) / STEP - now.speed)
        now.seen = theta
        error = speed + drives.position * (wanted - theta) - now.speed
        now.integral = now.integral + STEP * error
        torque = self._inertia * drives.speed * (error + drives.integral * now.integral)
        torque += gravity + forward
        now.torque = now.torque + (1.0 - math.exp(-STEP / drives.lag)) * (torque - now.torque)

    def _setpoint(self, now: _Now, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, speed and torque that were wanted a delay ago: on the cubic between two commands."""
        # The newest command is that of the tick at which this period began.
        age = (now.ticks * self._period - (time - self._drives.delay)) / self._period
        k = math.ceil(age - 1e-9)
        a, b = now.commands[-1 - k], now.commands[-k]
        s, T = k - age, self._period
        p, q, v, w = a[:6], b[:6], T * a[6:12], T * b[6:12]
        c, d = 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w
        return p + s * (v + s * (c + s * d)), (v + s * (2.0 * c + 3.0 * s * d)) / T, a[12:]
