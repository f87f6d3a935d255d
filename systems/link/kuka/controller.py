"""A virtual KUKA controller under RSI without sockets: telegrams, corrections, late replies, limits."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from robots.configuration.quantity import choice, quantity
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics
from robots.pose import rotation_from_zyx, zyx_from_rotation
from systems.link.kuka.telegrams import RobotTelegram, RsiError, SensorTelegram, read_sensor, write_robot

_STANDING = np.full(NUM_JOINTS, math.nan)


@dataclass
class RsiRunConfig:
    """How the signal flow and the KRL program of RSI are set up; read from a scenario file."""

    # Whether a correction adds to what was corrected before, or counts from where the program stands
    correction: str = choice("relative", ("relative", "absolute"))
    late_limit: int = quantity(10, 1, 1000)  # replies in a row that miss their cycle, after which RSI ends
    # Of each axis and, for the pose, each angle; a correction beyond it ends RSI
    largest_correction_deg: float = quantity(90.0, 1e-3, 360.0, "deg")
    largest_correction_mm: float = quantity(500.0, 1e-3, 10_000.0, "mm")  # of the pose, along each axis
    restart_after: float = 0.5  # s after its end until RSI is run again; negative: never


class _State(Enum):
    RUNNING = "running"
    PAUSED = "paused"  # RSI has ended and will be run again
    ENDED = "ended"


class RsiController:
    """Emulates a KUKA controller whose program stands still while RSI corrects it."""

    def __init__(self, robot: RobotModel, config: RsiRunConfig) -> None:
        """Starts the program of the nominal robot at its first cycle."""
        self.restarts = self.undecodable = self.late = self.ignored = self.beyond = 0
        self._config = config
        self._kinematics, self._inverse = Kinematics(robot), inverse_kinematics(robot)
        self._state = _State.RUNNING
        self._ended = -math.inf
        self._ipoc = self._asked = 0  # of the telegram that is prepared, and of the one that is out
        self._base: np.ndarray | None = None  # (6,) rad, where the program stands
        self._axes, self._pose = np.zeros(NUM_JOINTS), np.zeros(6)  # sums of corrections, rad; m and rad
        self._reference = _STANDING
        self._answered = True  # the telegram of this cycle
        self._has_answer = False  # ever, in this run
        self._in_a_row = 0

    @property
    def references(self) -> tuple[np.ndarray, np.ndarray]:
        """Reference (6,) in rad and speed (6,) in rad/s; NaN for what is not given, both to stand still."""
        return self._reference, _STANDING if math.isnan(self._reference[0]) else np.zeros(NUM_JOINTS)

    def stop(self, time: float, for_good: bool = False) -> None:
        """Ends RSI, for example because somebody stops the program."""
        if self._state is _State.RUNNING:
            self._ended = time
        self._state = _State.ENDED if for_good else _State.PAUSED
        self._reference = _STANDING

    def receive(self, data: bytes, time: float, position: np.ndarray) -> bool:
        """Takes a datagram of a sensor; what it cannot follow is counted and ignored.

        Args:
            data: the datagram.
            time: now.
            position: planned joint positions (6,) in rad.

        Returns:
            Whether it is followed.
        """
        try:
            telegram = read_sensor(data)
        except RsiError:
            self.undecodable += 1
            return False
        if self._state is not _State.RUNNING or self._base is None or telegram.ipoc != self._asked:
            self.ignored += 1
            return False
        if self._answered:
            return True  # the same telegram twice
        self._answered = self._has_answer = True
        self._in_a_row = 0
        return self._correct(telegram, time)

    def cycle(self, time: float, planned: np.ndarray) -> None:
        """Moves the program on by one cycle.

        Args:
            time: now.
            planned: planned joint positions (6,) in rad.
        """
        if self._state is _State.PAUSED and 0.0 <= self._config.restart_after <= time - self._ended:
            self._state = _State.RUNNING
            self.restarts += 1
            self._base, self._has_answer, self._answered, self._in_a_row = None, False, True, 0
        if self._state is not _State.RUNNING:
            return
        if self._base is None:
            self._base = planned.copy()
            self._axes, self._pose = np.zeros(NUM_JOINTS), np.zeros(6)
        # Counting begins with the first reply: until then the program waits for the sensor.
        if not self._answered and self._has_answer:
            self.late += 1
            self._in_a_row += 1
            if self._in_a_row >= self._config.late_limit:
                self.stop(time)

    def report(
        self, time: float, position: np.ndarray, planned: np.ndarray, torque: np.ndarray
    ) -> bytes | None:
        """The telegram of this cycle; arguments as of `systems.link.protocols.VirtualController`.

        It is prepared a cycle ahead: what is answered until the next call is the telegram of the call before.
        While RSI does not run a controller sends nothing.
        """
        self._asked, self._ipoc = self._ipoc, round(1e3 * time)
        if self._state is not _State.RUNNING:
            return None
        self._answered = False
        X = self._kinematics.forward(position)
        pose = np.concatenate([X[:3, 3], zyx_from_rotation(X[:3, :3])])
        # What was corrected: the reference, which the motion reaches within a cycle.
        setpoint = planned if math.isnan(self._reference[0]) else self._reference
        base = setpoint if self._base is None else self._base
        return write_robot(
            RobotTelegram(self._ipoc, position, setpoint, pose, self._in_a_row, setpoint - base)
        )

    def signals(self, time: float, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> None:
        """RSI has no test signals."""

    def counters(self) -> dict[str, int]:
        """How often the program began anew, and what became of the datagrams, by name."""
        names = ("restarts", "undecodable", "late", "ignored", "beyond")
        return {name: getattr(self, name) for name in names}

    def _correct(self, telegram: SensorTelegram, time: float) -> bool:
        is_relative = self._config.correction == "relative"
        axes, pose = self._axes, self._pose
        if telegram.axes is not None:
            axes = telegram.axes + (axes if is_relative else 0.0)
        if telegram.pose is not None:
            pose = telegram.pose + (pose if is_relative else 0.0)
        largest = math.radians(self._config.largest_correction_deg)
        angles = max(np.abs(axes).max(), np.abs(pose[3:]).max())
        if angles > largest or 1e3 * np.abs(pose[:3]).max() > self._config.largest_correction_mm:
            self.beyond += 1
            self.stop(time)
            return False
        try:
            reference = self._corrected(pose) + axes
        except (UnreachableError, JointLimitError):
            self.beyond += 1
            self.stop(time)
            return False
        self._axes, self._pose, self._reference = axes, pose, reference
        return True

    def _corrected(self, pose: np.ndarray) -> np.ndarray:
        """Joint positions (6,) with the pose of the program displaced and turned in the base's axes."""
        assert self._base is not None
        if not pose.any():
            return self._base
        X = self._kinematics.forward(self._base)
        X[:3, 3] += pose[:3]
        X[:3, :3] = rotation_from_zyx(pose[3:]) @ X[:3, :3]
        return self._inverse.nearest(X, self._base)
