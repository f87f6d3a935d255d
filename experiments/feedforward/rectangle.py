"""A rectangle in space under a feedforward, and how far the tip is from it; as Reiner (2010), table 6.1."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import trapezoid

from diagrams.runs.simulation import run
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.cli.workers import Progress
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.arm_structure import AXES, seen_from_base
from robots.kinematics.forward import Kinematics
from robots.kinematics.workspace import working_positions
from robots.pose import zyx_from_rotation
from systems.feedforward import FeedforwardConfig
from systems.feedforward.arm_correction import reach
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Rectangle, Waypoint

LAW = "open_loop"  # no camera: the feedforward has to do it alone
PACE = 8.0  # 1/s^2, k_a: an edge takes 1.2 s, with sin^2 timing a second
FAST_PACE, FAST_SIZE = 500.0, 0.25  # of the one that excites: as fast as joints can, a quarter as large
_FASTEST = 0.95  # share of the largest joint speeds: a robot that is too slow for the pace takes longer
_RISE = 0.1  # s, the least from rest to the largest speed of a joint
_SAMPLES = 400  # of the path, for that
DEPTH, WIDTH = 0.2, 0.4  # of the reach, the edges away from the robot and across
_SIZES = (1.0, 0.8, 0.6, 0.45, 0.3)  # of that, where an arm has not as much room with the tool down
SETTLE, DWELL = 1.0, 0.5  # s at rest: the arm is first wound up, at the end it rings
_ALONG = 0.9  # cosine of an axis that points nearly along a direction
_LEANING = np.deg2rad(30.0)  # of the upper arm from the vertical


@dataclass(frozen=True)
class RectangleTrial:
    """A rectangle with the tool pointing down, driven with one feedforward."""

    robot: RobotModel
    payload: float  # kg
    config: FeedforwardConfig
    plant: RobotModel | None = None  # in the station, if it is another one than the model's
    timing: str = "polynomial"  # of `systems.reference.timing.TIMINGS`
    is_fast: bool = False  # small, with edges as fast as the joints can go, in place of wide and calm

    def run(self, progress: Progress | None = None) -> "Deviation":
        """Simulates it with an elastic structure.

        Raises:
            ValueError: if the robot cannot follow the rectangle.
        """
        log = run(rectangle_scenario(self), LAW, self.robot, progress=progress, plant=self.plant)
        on_path = log.time >= log.path_start
        gap = log.X_WE_true[:, :3, 3] - log.X_WE_desired[:, :3, 3]
        return Deviation(log.time[on_path] - log.path_start, gap[on_path])


@dataclass(frozen=True)
class Deviation:
    """Deviation of the tip from its desired position."""

    time: np.ndarray  # (n,) s, from the start of the path
    gap: np.ndarray  # (n, 3) m

    @property
    def distance(self) -> np.ndarray:
        """In m, shape (n,)."""
        return np.linalg.norm(self.gap, axis=1)

    @property
    def sag(self) -> float:
        """The distance in m at rest, before the path begins."""
        return float(self.distance[0])

    @property
    def dynamic(self) -> float:
        """How far the gap goes at most in m from what it was at rest."""
        return float(np.linalg.norm(self.gap - self.gap[0], axis=1).max())

    @property
    def integral(self) -> float:
        """Over the time, in m s."""
        return float(trapezoid(self.distance, self.time))

    @property
    def max(self) -> float:
        """The largest one in m."""
        return float(self.distance.max())


def rectangle_scenario(trial: RectangleTrial) -> Scenario:
    """The scenario of a trial."""
    scenario = load_scenario(
        "nominal",
        [
            "initial_error_mm=[0, 0, 0]",
            f"station.payload={trial.payload}",
            "station.elasticity=structure",
            f"servo.laws.{LAW}.drive=cascade",
        ],
    )
    home = working_position(trial.robot)
    drive = scenario.station.drive
    size = reached_size(trial.robot, home) * (FAST_SIZE if trial.is_fast else 1.0)
    reference = ReferenceConfig(
        Rectangle(rectangle(trial.robot, home, size)),
        acceleration=FAST_PACE if trial.is_fast else PACE,
        timing=trial.timing,
        settle=SETTLE,
        dwell=DWELL,
        preview=drive.command_delay + drive.dead_time,
    )
    reference = replace(reference, acceleration=feasible_pace(trial.robot, home, reference))
    servo = replace(scenario.servo, feedforward=trial.config)
    return replace(scenario, home_deg=np.rad2deg(home), reference=reference, servo=servo)


def feasible_pace(robot: RobotModel, home: np.ndarray, reference: ReferenceConfig) -> float:
    """The acceleration along a path, in 1/s^2, lowered where a joint would be too slow or too sudden for it.

    Args:
        robot: which follows it.
        home: near where it begins, rad, shape (6,).
        reference: the path; one out of reach is left as it is, for the simulation to refuse.
    """
    path = make_path(reference)
    times = np.linspace(path.path_start, path.dwell_start, _SAMPLES)
    try:
        q = inverse_kinematics(robot).along(path.sample(times)[0], home)
    except ValueError:
        return reference.acceleration
    step = times[1] - times[0]
    speed = float((np.abs(np.diff(q, axis=0)) / step / robot.speed).max())
    acceleration = float((np.abs(np.diff(q, 2, axis=0)) / step**2 / (robot.speed / _RISE)).max())
    return reference.acceleration * min(1.0, (_FASTEST / speed) ** 2, 1.0 / acceleration)


def reached_size(robot: RobotModel, home: np.ndarray) -> float:
    """The largest size of a `rectangle` around a configuration (rad, (6,)) that the robot can follow.

    Returns:
        One of a few shares; 1 too if it reaches none of them, for the simulation to refuse.
    """
    inverse = inverse_kinematics(robot)
    for size in _SIZES:
        path = make_path(ReferenceConfig(Rectangle(rectangle(robot, home, size)), acceleration=PACE))
        times = np.linspace(path.path_start, path.dwell_start, _SAMPLES)
        try:
            inverse.along(path.sample(times)[0], home)
        except ValueError:
            continue
        return size
    return 1.0


def working_position(robot: RobotModel) -> np.ndarray:
    """Upper arm leaning forward, forearm level, tool down; rad, shape (6,).

    Of an arm whose axes do not point along z, y, y, x, y, x at zero it is where it moves most freely.
    """
    axes, offsets, _ = seen_from_base(robot)
    along = [axis["xyz".index(letter)] for axis, letter in zip(axes, AXES, strict=True)]
    if np.abs(along).min() < _ALONG:
        return np.deg2rad(robot.home_deg) if robot.home_deg else working_positions(robot, 1)[0]
    upper_arm = np.arctan2(offsets[2, 0], offsets[2, 2])  # from z towards x, at zero joint angles
    wrist = offsets[3] + offsets[4]
    forearm = np.arctan2(wrist[0], wrist[2])
    sign_2, sign_3, sign_5 = np.sign(axes[[1, 2, 4], 1])
    q = np.zeros(NUM_JOINTS)
    q[1] = sign_2 * (_LEANING - upper_arm)
    q[2] = sign_3 * (0.5 * np.pi - forearm - (_LEANING - upper_arm))
    q[4] = sign_5 * forearm  # the tool points along the forearm at zero
    return np.clip(q, robot.lower, robot.upper)


def rectangle_edges(robot: RobotModel) -> tuple[float, float]:
    """How long the edges away from the robot and across are in m, of the rectangle that is not small."""
    length = reached_size(robot, working_position(robot)) * reach(robot)
    return DEPTH * length, WIDTH * length


def rectangle(robot: RobotModel, home: np.ndarray, size: float = 1.0) -> list[Waypoint]:
    """A level rectangle around the tip's place at a configuration (rad, shape (6,)), closed."""
    X_WE = Kinematics(robot).forward(home)
    zyx_deg = np.rad2deg(zyx_from_rotation(X_WE[:3, :3]))
    half = 0.5e3 * size * reach(robot) * np.array([DEPTH, WIDTH, 0.0])
    signs = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    return [Waypoint(1e3 * X_WE[:3, 3] + half * np.array([x, y, 0.0]), zyx_deg) for x, y in signs]
