"""Moves a station through configurations and records camera poses and joint positions at rest."""

import gc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from diagrams.integration import Integration
from diagrams.scenario.scenario import Scenario
from diagrams.station import Station
from robots.calibration.measurements import Measurements
from robots.description.model import RobotModel, load_robot
from systems.reference.joint_mover import JointMover
from systems.samples import JointSample, PoseSample


@dataclass(frozen=True)
class MeasurementProcedure:
    """How a configuration is measured."""

    speed_share: float = 0.5  # of the robot's largest joint speeds
    settle: float = 0.4  # s, least time of rest before the measurement
    window: float = 0.2  # s, over which samples are averaged; longer if the camera is slow
    fewest_exposures: int = 3  # in a window, at least 2: with fewer there is no telling whether it is at rest
    # Oscillation in the window that counts as rest, beside the camera's noise.
    stillness: float = 2e-6  # m
    rotation_stillness: float = 4e-6  # rad
    # s, after which a measurement is made in spite of an oscillation, and left out if too little was seen.
    longest_wait: float = 5.0


@dataclass(frozen=True)
class MeasurementRecord:
    """Measured and true tool poses at the configurations, row for row."""

    measured: Measurements
    truth: Measurements  # the true poses at the same measured joint positions


class MeasurementRun:
    """A station whose robot visits configurations and rests at each until it is measured."""

    def __init__(
        self,
        scenario: Scenario,
        procedure: MeasurementProcedure | None = None,
        plant: RobotModel | None = None,
    ) -> None:
        """Builds the diagram.

        Args:
            scenario: its station is measured.
            procedure: how.
            plant: the robot in the station, if it is another one than the scenario's.

        Raises:
            ValueError: if a part refuses its configuration.
        """
        self._procedure = procedure or MeasurementProcedure()
        # Events have their times in runs along a path.
        self._config = replace(scenario.station, events=[])
        # Between its first and its last tick a window must see one exposure more than is needed, because the
        # one that is the newest at its first tick may be from before it.
        needed = self._procedure.fewest_exposures * scenario.station.camera.period
        self._window = max(self._ticks(self._procedure.window), self._tick_at(needed) + 1)
        robot = plant or load_robot(scenario.robot)
        builder = DiagramBuilder()
        self._station = Station(builder, robot, self._config, "cascade")
        mover = JointMover(self._procedure.speed_share * robot.speed)
        self._mover = builder.AddNamedSystem("mover", mover)
        for name in ("position_command", "velocity_command"):
            builder.Connect(self._mover.GetOutputPort(name), self._station.inputs[name])
        self._diagram = builder.Build()
        self._start(np.zeros(len(robot.lower)), scenario.seed)
        rate = self._station.fastest_rate(self._context)
        self._integration = Integration(scenario.integrator, scenario.station.period, rate)

    def measure(
        self, q: np.ndarray, seed: int = 0, progress: Callable[[float], None] | None = None
    ) -> MeasurementRecord:
        """Visits configurations in their order, beginning at rest in the first.

        Args:
            q: motor positions in rad, shape (n, 6).
            seed: of the camera's noise.
            progress: is called after each configuration with the share that is done.

        Returns:
            A row for each configuration at which the camera saw the tool often enough; their numbers begin
            with one.

        Raises:
            ValueError: if the camera saw the tool nowhere.
        """
        self._start(q[0], seed)
        self._integration.initialize(self._simulator)
        rows: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]] = []
        truth: list[np.ndarray] = []
        # No cycles of objects arise, and a full search for them takes 40 ms with Drake loaded.
        collecting = gc.isenabled()
        gc.disable()
        try:
            for number, goal in enumerate(q, 1):
                row = self._measure_at(goal)
                if row is not None:
                    rows.append((number, *row))
                    truth.append(self._true_pose())
                if progress:
                    progress(number / len(q))
        finally:
            if collecting:
                gc.enable()
        if not rows:
            raise ValueError(f"measurement run: the camera saw the tool at none of {len(q)} configurations")
        numbers, positions, translations, rotations = (np.array(part) for part in zip(*rows, strict=True))
        payload, X_WE = np.full(len(rows), self._config.payload), np.array(truth)
        return MeasurementRecord(
            Measurements(positions, translations, rotations, payload, numbers),
            Measurements(positions, X_WE[:, :3, 3], X_WE[:, :3, :3], payload, numbers),
        )

    def _true_pose(self) -> np.ndarray:
        return self._station.read(self._context, "truth.X_WE").GetAsMatrix4()

    def _start(self, theta: np.ndarray, seed: int) -> None:
        # A simulator of its own for each run: an integrator remembers the steps that it has made.
        self._simulator = Simulator(self._diagram)
        self._context = self._simulator.get_mutable_context()
        self._station.set_at_rest(self._context, theta, seed)
        self._mover.set_at_rest(self._mover.GetMyMutableContextFromRoot(self._context), theta)

    def _measure_at(self, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Mean joint and tool positions and rotation at one configuration, None if too little was seen."""
        arrival = self._mover.go(self._mover.GetMyMutableContextFromRoot(self._context), goal)
        delays = self._config.drive.command_delay + self._config.drive.dead_time + self._config.camera.delay
        rest = self._tick_at(arrival + delays)
        begin = rest + self._ticks(self._procedure.settle)
        while True:
            joints, poses = self._samples(begin)
            is_last = (begin - rest) * self._config.period > self._procedure.longest_wait
            is_enough = len(poses) >= self._procedure.fewest_exposures
            if not poses or (is_last and not is_enough):
                return None
            if is_enough and (is_last or self._is_at_rest(poses)):
                theta = np.mean([joint.position for joint in joints], axis=0)
                position = np.mean([pose.X_WE.translation() for pose in poses], axis=0)
                return theta, position, _rotations(poses).mean().as_matrix()
            begin += self._window

    def _is_at_rest(self, poses: list[PoseSample]) -> bool:
        rotations = _rotations(poses)
        swings = (rotations * rotations[0].inv()).as_rotvec()
        positions = np.array([pose.X_WE.translation() for pose in poses])
        return _is_still(positions, self._procedure.stillness) and _is_still(
            swings, self._procedure.rotation_stillness
        )

    def _samples(self, begin: int) -> tuple[list[JointSample], list[PoseSample]]:
        """What the station says from one tick to the end of a window.

        An exposure counts once, and only if it was made after the window's begin: at the first tick, the
        newest one of a slow camera may show the robot as it still moved.
        """
        joints: list[JointSample] = []
        poses: dict[float, PoseSample] = {}
        earliest = begin * self._config.period - self._config.camera.delay - 1e-9
        for tick in range(begin, begin + self._window):
            self._integration.advance(self._simulator, tick * self._config.period)
            joints.append(self._station.read(self._context, "joint_sample"))
            pose: PoseSample = self._station.read(self._context, "pose_sample")
            if pose.valid and pose.time >= earliest:
                poses[pose.time] = pose
        return joints, list(poses.values())

    def _tick_at(self, time: float) -> int:
        return int(np.ceil(time / self._config.period - 1e-9))

    def _ticks(self, duration: float) -> int:
        return max(1, round(duration / self._config.period))


def _rotations(poses: list[PoseSample]) -> Rotation:
    return Rotation.from_matrix([pose.X_WE.rotation().matrix() for pose in poses])


def _is_still(samples: np.ndarray, oscillation: float) -> bool:
    """Whether samples (n >= 2, 3) spread by noise alone, which shows in the steps from one to the next."""
    spread = float(samples.var(axis=0, ddof=1).max())
    noise = 0.5 * float(np.square(np.diff(samples, axis=0)).mean(axis=0).max())
    return spread <= 1.6 * noise + oscillation**2
