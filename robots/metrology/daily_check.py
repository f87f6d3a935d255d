"""A short check of a robot: a few poses, whose deviations from the first check tell what has changed.

Deviations of the poses are tried against one cause at a time: each joint's zero, and a shift of the tool.
The cause that explains most is named. Six poses cannot tell all causes apart at once, but tell a single one.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.forward import Kinematics
from robots.metrology.change_detection import ewma

POSES = 6
TOOL = "tool"
_CANDIDATES = 300
_ALARM = 5.0  # standard deviations
_WEIGHT = 0.4  # of the newest check


@dataclass(frozen=True)
class CheckNoise:
    """Standard deviations of one measured pose, its repeatability included."""

    position: float  # m
    rotation: float  # rad


@dataclass(frozen=True)
class Drift:
    """The one cause that explains deviations best."""

    what: str  # "joint 3" or "tool"
    size: float  # rad of a joint, m of the tool
    sigma: float  # of the size
    significance: float  # how many standard deviations the size is from zero
    check: int  # the check at which it became significant
    onset: int  # the check since which the deviations of the cause are beyond their noise


def check_poses(
    robot: RobotModel, is_admissible: Callable[[np.ndarray], np.ndarray], seed: int = 0
) -> np.ndarray:
    """Six configurations that tell the zeros of the joints best, in rad, (6, 6).

    Admissible configurations are taken one by one, each the one that makes the determinant of the information
    on the zeros largest.

    Raises:
        ValueError: if too few of the configurations that are tried are admissible.
    """
    rng = np.random.default_rng(seed)
    tried = rng.uniform(0.6 * robot.lower, 0.6 * robot.upper, (_CANDIDATES, NUM_JOINTS))
    tried = tried[is_admissible(tried)]
    if len(tried) < POSES:
        raise ValueError(f"daily check: only {len(tried)} of {_CANDIDATES} configurations are admissible")
    J = np.array([Kinematics(robot).jacobian(q) for q in tried])
    information = np.swapaxes(J, 1, 2) @ J
    total, chosen = 1e-6 * np.eye(NUM_JOINTS), []
    for _ in range(POSES):
        gain = np.linalg.slogdet(total + information)[1]
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        total = total + information[chosen[-1]]
    return tried[chosen]


def find_drift(robot: RobotModel, q: np.ndarray, deviations: np.ndarray, noise: CheckNoise) -> Drift | None:
    """What has changed since the first check, by an exponential average over the checks.

    Args:
        robot: whose kinematics are believed.
        q: the configurations in rad, (n, 6).
        deviations: of every check's poses from those of the first check, itself first, (checks, n, 6),
            rotation vectors in rad first, then positions in m, in world axes.
        noise: of a pose.

    Returns:
        The most significant cause at the first check at which one is; None if there is none.
    """
    scale = 1.0 / np.r_[np.full(3, noise.rotation), np.full(3, noise.position)]
    causes = _causes(robot, q, scale)
    scaled = (deviations * scale).reshape(len(deviations), -1)
    means, variances = ewma(scaled[1:], _WEIGHT)
    for check, (mean, variance) in enumerate(zip(means, variances, strict=True), 1):
        # The first check is subtracted from all, so that its noise does not average out: it is in the mean
        # with all weights together, which are one only after many checks.
        sigma = np.sqrt(variance + (1.0 - (1.0 - _WEIGHT) ** check) ** 2)
        found = max((_explained(A, mean, sigma, name) for name, A in causes.items()), key=lambda x: x[1])
        if found[1] > _ALARM:
            name, significance = found
            return _sized(name, causes[name], scaled, check, significance)
    return None


def sizes_alone(
    robot: RobotModel, q: np.ndarray, deviations: np.ndarray, noise: CheckNoise
) -> dict[str, np.ndarray]:
    """How large each cause would be if it were the only one: rad or m, (checks,) each."""
    scale = 1.0 / np.r_[np.full(3, noise.rotation), np.full(3, noise.position)]
    scaled = (deviations * scale).reshape(len(deviations), -1)
    found = {name: scaled @ np.linalg.pinv(A).T for name, A in _causes(robot, q, scale).items()}
    return {name: x[:, 0] if x.shape[1] == 1 else np.linalg.norm(x, axis=1) for name, x in found.items()}


def _causes(robot: RobotModel, q: np.ndarray, scale: np.ndarray) -> dict[str, np.ndarray]:
    """How deviations depend on each cause, (6 n, number of its parameters), scaled."""
    kinematics = Kinematics(robot)
    J = np.array([kinematics.jacobian(each) for each in q])
    R = kinematics.forward(q)[:, :3, :3]
    shift = np.concatenate([np.zeros((len(q), 3, 3)), R], axis=1)
    causes = {f"joint {i + 1}": J[:, :, i : i + 1] for i in range(NUM_JOINTS)} | {TOOL: shift}
    return {name: (A * scale[:, None]).reshape(-1, A.shape[2]) for name, A in causes.items()}


def _explained(A: np.ndarray, mean: np.ndarray, sigma: float, name: str) -> tuple[str, float]:
    """The name of a cause, and how many standard deviations its size is from zero.

    Of a cause with k parameters it is the normal deviate with the same chance, by Wilson and Hilferty.
    """
    x = np.linalg.lstsq(A, mean, rcond=None)[0]
    square, k = float(np.square(A @ x).sum()) / sigma**2, A.shape[1]
    if k == 1:
        return name, np.sqrt(square)
    return name, ((square / k) ** (1 / 3) - (1 - 2 / (9 * k))) / np.sqrt(2 / (9 * k))


def _sized(name: str, A: np.ndarray, scaled: np.ndarray, check: int, significance: float) -> Drift:
    """Onset and size of a cause, from the checks one by one."""
    sizes = scaled[: check + 1] @ np.linalg.pinv(A).T  # (checks, parameters)
    sigma = float(np.sqrt(2.0 * np.linalg.inv(A.T @ A).diagonal().max()))  # of a difference of two checks
    length = np.linalg.norm(sizes, axis=1)
    beyond = length > 3.0 * sigma
    onset = check
    while onset > 0 and beyond[onset - 1]:
        onset -= 1
    mean = sizes[onset:].mean(axis=0)
    size = float(mean[0]) if A.shape[1] == 1 else float(np.linalg.norm(mean))
    return Drift(name, size, sigma, significance, check, onset)
