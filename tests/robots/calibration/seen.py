"""What instruments have seen: a robot made of matrix products, and one that bends."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from robots.calibration.instruments.observations import Observations
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.description.calibration import Calibration
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import load_robot
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous

PLACES = {"a": np.array([0.0, 0.0, 0.1]), "b": np.array([0.08, 0.0, 0.05]), "c": np.array([0.0, -0.07, 0.12])}
ANCHOR = np.array([0.6, 0.4, 0.2])
LOAD = 7.0  # kg
CORNER_NOISE = MeasurementNoise(0.0, 7e-6, 2.5e-5)
FACTORS = {"tracker": 1.0, "camera": 5.0, "bar": 0.1}  # of their noise


def observed(
    name: str = "irb1200",
    count: int = 60,
    seed: int = 0,
    noise: float = 0.0,
    joint: float = 0.0,
    instruments: tuple[str, ...] = ("tracker", "camera", "bar"),
    loaded: Callable[[MatrixRobot, np.ndarray, float], np.ndarray] | None = None,
) -> tuple[MatrixRobot, Observations]:
    """Every third configuration is seen by the camera if there is one; every second has a distance, too.

    In every seventh configuration one coordinate of each target is missing. ``loaded`` gives the poses of the
    robot with a mass at its flange, 7 kg in every second configuration; None for a stiff robot without one.
    """
    rng = np.random.default_rng(seed)
    true = MatrixRobot(name).displaced(rng)
    frames = {
        "tracker": homogeneous(Rotation.random(rng=rng), np.array([3.0, -2.0, 1.5])),
        "camera": homogeneous(Rotation.random(rng=rng), np.array([-1.0, 2.0, 0.5])),
    }
    q = true.configurations(count, rng)
    theta, payload = q + joint * rng.normal(size=q.shape), np.where(np.arange(count) % 2, LOAD, 0.0)
    X = true.forward(theta)
    if loaded:
        X = np.array([loaded(true, each[None], mass)[0] for each, mass in zip(theta, payload, strict=True)])
    lines = []  # configuration, target, instrument, coordinates, distance
    for i in range(count):
        by = "camera" if "camera" in instruments and i % 3 == 0 else "tracker"
        for t, place in enumerate(PLACES.values()):
            p = frames[by][:3, :3] @ (X[i, :3, :3] @ place + X[i, :3, 3]) + frames[by][:3, 3]
            p = p + FACTORS[by] * noise * rng.normal(size=3)
            if i % 7 == 0:
                p[rng.integers(3)] = np.nan
            lines.append((i, t, instruments.index(by), p, np.nan))
        if "bar" in instruments and i % 2:
            away = X[i, :3, :3] @ PLACES["a"] + X[i, :3, 3] - ANCHOR
            distance = np.linalg.norm(away) + FACTORS["bar"] * noise * rng.normal()
            lines.append((i, 0, instruments.index("bar"), np.full(3, np.nan), distance))
    row, target, instrument, position, distance = map(np.array, zip(*lines, strict=True))
    unknown, numbers = np.full(len(lines), np.nan), np.arange(2, len(lines) + 2)
    return true, Observations(
        q, row, target, instrument, position, distance, unknown, numbers, tuple(PLACES), instruments,
        payload if loaded else None,
    )  # fmt: skip


def corner_table(seed: int) -> Measurements:
    """Thirty poses of an IRB 1200 at corners of its ranges, where designs like to measure, by a quiet camera.

    Its joints are as soft as its file says and bend under 2.5 kg.
    """
    robot, rng = load_robot("irb1200"), np.random.default_rng(seed)
    lower, upper, tilting = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), [1, 2, 4]
    q = rng.uniform(lower, upper, (30, 6))
    q[:, tilting] = np.where(rng.random((30, 3)) < 0.5, 0.9 * lower[tilting], 0.9 * upper[tilting])
    errors = GeometricErrors(np.arange(1.0, 4.0, 0.5), np.full(3, 10.0)).vector(robot)
    true = ErrorKinematics(robot).robot_with_errors(errors)
    soft = replace(true, calibration=Calibration(compliance=(1.0 / robot.joint_stiffness).tolist()))
    X_WE = CompliantKinematics(soft, 2.5).forward(q)
    table = Measurements(q, X_WE[:, :3, 3], X_WE[:, :3, :3], np.full(30, 2.5))
    return table.noisy(CORNER_NOISE, rng)
