"""A robot that two instruments and a ball bar have seen, made of matrix products."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from robots.calibration.instruments.observations import Observations
from tests.robots.calibration.matrix_robot import MatrixRobot, homogeneous

PLACES = {"a": np.array([0.0, 0.0, 0.1]), "b": np.array([0.08, 0.0, 0.05]), "c": np.array([0.0, -0.07, 0.12])}
ANCHOR = np.array([0.6, 0.4, 0.2])
LOAD = 7.0  # kg
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
