"""The budget of uncertainty along a path: covariances by cause at many poses, and a simulation against it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.record.read_record import read_record
from diagrams.record.restored import restored
from experiments.cameras.accuracy import Places
from experiments.cameras.study import study_setup
from experiments.cli.prepare import Prepared
from robots.description.model import RobotModel
from robots.kinematics.arm_capsules import ArmCapsules
from robots.kinematics.forward import Kinematics
from systems.reference.paths import make_path
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import DetectionBody
from systems.vision.tracking.marker_images import marker_diameters, touching
from systems.vision.uncertainty.pose_uncertainty import MeasuredPose, Uncertainties, covariances
from systems.vision.uncertainty.simulated_poses import simulated_errors
from systems.vision.visibility import in_window, occluded

_CHECKED = 5  # poses that are simulated
_ANOTHER_ROBOT = 0.15  # m, off the path; no robot errs by so much


@dataclass(frozen=True)
class Budget:
    """Uncertainties of p measured poses, in rad and m."""

    time: np.ndarray  # (p,) s
    speed: np.ndarray  # (p,) m/s
    by_cause: dict[str, np.ndarray]  # covariances (p, 6, 6), NaN where a pose is not seen
    checked: np.ndarray  # the poses that were simulated, (c,)
    simulated: np.ndarray  # (c,) m, root of the summed variances of the three coordinates

    @property
    def position(self) -> np.ndarray:
        """Combined standard uncertainty of the position in m, all three coordinates together, (p,)."""
        return _position(self.by_cause)

    @property
    def rotation(self) -> np.ndarray:
        """The same of the rotation in rad, (p,)."""
        return np.sqrt(sum(np.trace(part[:, :3, :3], axis1=1, axis2=2) for part in self.by_cause.values()))

    def shares(self) -> dict[str, np.ndarray]:
        """The variance of each cause over that of the position, (p,); zero of a position that is exact."""
        total = self.position**2
        total[total == 0.0] = np.inf
        return {
            name: np.trace(part[:, 3:, 3:], axis1=1, axis2=2) / total for name, part in self.by_cause.items()
        }

    def mean_shares(self) -> dict[str, float]:
        """Their means over the poses that are seen and uncertain."""
        counts = self.position > 0.0
        return {name: float(np.mean(share[counts])) for name, share in self.shares().items()}

    def largest_deviation(self) -> float:
        """Of the simulated uncertainties from the budget, relative, where there is any."""
        expected = self.position[self.checked]
        counts = expected > 0.0
        return float(np.abs(self.simulated[counts] / expected[counts] - 1.0).max())

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        seen = np.isfinite(self.position)
        return {
            "poses": len(self.time),
            "seen": int(seen.sum()),
            "position_um": {
                "median": 1e6 * float(np.median(self.position[seen])),
                "largest": 1e6 * float(self.position[seen].max()),
            },
            "rotation_mdeg_median": 1e3 * float(np.rad2deg(np.median(self.rotation[seen]))),
            "shares": self.mean_shares(),
            "simulated_deviation": self.largest_deviation(),
        }


def _position(by_cause: dict[str, np.ndarray]) -> np.ndarray:
    return np.sqrt(sum(np.trace(part[:, 3:, 3:], axis1=1, axis2=2) for part in by_cause.values()))


@dataclass(frozen=True)
class Motion:
    """Where the tool is measured, and how fast it moves there."""

    time: np.ndarray  # (p,) s
    places: Places
    V_WE: np.ndarray  # (p, 6) rad/s and m/s


def motion_on_path(prepared: Prepared, places: Places) -> Motion:
    """Places that are evenly in time along the path of a scenario."""
    path = make_path(prepared.scenario.reference)
    time = np.linspace(path.path_start, path.dwell_start, len(places.X_WE))
    return Motion(time, places, path.sample(time)[1])


def motion_of_record(name: str | Path, count: int, robot: RobotModel) -> Motion:
    """Places of the record of a run, evenly in time from its start to the dwell.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no record of a whole run, or one of another robot.
    """
    log = restored(read_record(name), str(name))
    inside = np.flatnonzero((log.time >= log.path_start) & (log.time <= log.dwell_start))[1:-1]
    if len(inside) < count:
        raise ValueError(f"record {name}: {len(inside)} samples on the path, at least {count} are needed")
    chosen = inside[np.linspace(0, len(inside) - 1, count).astype(int)]
    away = Kinematics(robot).forward(log.joint_position[chosen])[:, :3, 3] - log.X_WE_desired[chosen, :3, 3]
    if (off := float(np.median(np.linalg.norm(away, axis=1)))) > _ANOTHER_ROBOT:
        raise ValueError(
            f"record {name}: its joints put the tool of {robot.name} {1e3 * off:.0f} mm off the path: it is "
            "of another robot; --set robot=NAME"
        )
    X, step = log.X_WE_desired, log.time[chosen + 1] - log.time[chosen - 1]
    turn = Rotation.from_matrix(X[chosen + 1, :3, :3]) * Rotation.from_matrix(X[chosen - 1, :3, :3]).inv()
    moved = np.hstack([turn.as_rotvec(), X[chosen + 1, :3, 3] - X[chosen - 1, :3, 3]])
    return Motion(log.time[chosen], Places(X[chosen], log.joint_position[chosen]), moved / step[:, None])


def budget(
    prepared: Prepared,
    given: Uncertainties,
    record: str | None,
    draws: int,
    progress: Callable[[float], None],
) -> Budget:
    """The budget along the path of a scenario, or of a record.

    Args:
        prepared: scenario with cameras that see markers.
        given: standard uncertainties.
        record: MCAP file of a run; None for the path.
        draws: of the simulation, at each of five poses.
        progress: is called with the share that is done.

    Raises:
        OSError: if the record cannot be read.
        ValueError: if something is wrong with it or the scenario, or nothing is seen.
    """
    setup = study_setup(prepared)
    cameras = setup.cell.camera_model(setup.robot.base.pose())
    anchor_W = setup.robot.base.pose().translation()
    motion = (
        motion_of_record(record, len(setup.path.q), setup.robot)
        if record
        else motion_on_path(prepared, setup.path)
    )
    seen = lone_markers(cameras, setup.cell.windows, setup.body, motion.places, setup.robot)
    poses = [MeasuredPose(*each) for each in zip(motion.places.X_WE, motion.V_WE, seen, strict=True)]
    parts = [covariances(cameras, setup.body.p_E, anchor_W, pose, given) for pose in poses]
    by_cause = {name: np.array([part[name] for part in parts]) for name in parts[0]}
    visible = np.flatnonzero(np.isfinite(by_cause[next(iter(by_cause))][:, 0, 0]))
    if not len(visible):
        raise ValueError("budget: the cameras see the tool nowhere on the path")
    worst = int(np.nanargmax(_position(by_cause)))
    if _position(by_cause)[worst] == 0.0:
        raise ValueError(
            "budget: nothing is uncertain that moves a position; let one of the causes be positive"
        )
    even = visible[np.linspace(0, len(visible) - 1, _CHECKED - 1).astype(int)]
    checked = np.unique([*even, worst])
    rng, simulated = np.random.default_rng(prepared.scenario.seed), []
    for number, k in enumerate(checked, 1):
        errors = simulated_errors(cameras, setup.body.p_E, anchor_W, poses[k], given, draws, rng)
        simulated.append(np.sqrt(np.mean(np.sum(errors[:, 3:] ** 2, axis=1))))
        progress(number / len(checked))
    speed = np.linalg.norm(motion.V_WE[:, 3:], axis=1)
    return Budget(motion.time, speed, by_cause, checked, np.array(simulated))


def lone_markers(
    cameras: Cameras, windows: np.ndarray, body: DetectionBody, places: Places, robot: RobotModel
) -> np.ndarray:
    """Markers that stand alone in the window of a camera and not behind the arm, (p, n, m)."""
    arm, found = ArmCapsules(robot), []
    for X, q in zip(places.X_WE, places.q, strict=True):
        p_W = body.p_E @ X[:3, :3].T + X[:3, 3]
        pixels = cameras.project(p_W)
        seen = in_window(pixels, windows) & ~occluded(cameras.p_WC, p_W, arm.at(q))
        close = touching(pixels, marker_diameters(cameras, body, p_W)) & seen[:, None]
        found.append(seen & ~close.any(axis=2))
    return np.array(found)
