"""A short check of a robot: a few poses, whose deviations from the first check tell what has changed.

Deviations of the poses are tried against one cause at a time: each joint's zero, and a shift of the tool.
The cause that explains most is named. Six poses cannot tell all causes apart at once, but tell a single one;
of two that look much alike, such as the zeros of joints 2 and 3, only where it is large. Else both are named.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.forward import Kinematics
from robots.metrology.change_detection import ewma

POSES = 6
TOOL = "tool"
_CANDIDATES = 300
_ALARM = 5.0  # standard deviations
_WEIGHT = 0.4  # of the newest check
# Squares of standard deviations by which another cause must explain less to be ruled out. The true cause
# falls behind one that resembles it by so much with a chance below that of three of them, 0.13 %.
_APART = 9.0


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
    perhaps: tuple[str, ...] = ()  # causes that explain the deviations about as well, the best first


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
        squares = {name: _explained(A, mean, sigma) for name, A in causes.items()}
        significance = {name: _deviate(square, causes[name].shape[1]) for name, square in squares.items()}
        name = max(significance, key=significance.__getitem__)
        if significance[name] > _ALARM:
            found = _sized(name, causes[name], scaled, check, significance[name])
            return replace(found, perhaps=_like(name, squares, causes))
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


def _explained(A: np.ndarray, mean: np.ndarray, sigma: float) -> float:
    """By how much a cause lowers the sum of squares of a mean of deviations, in units of their variance."""
    return float(np.square(A @ np.linalg.lstsq(A, mean, rcond=None)[0]).sum()) / sigma**2


def _deviate(square: float, k: int) -> float:
    """How many standard deviations a cause with k parameters is from zero.

    For more than one it is the normal deviate with the same chance, by Wilson and Hilferty.
    """
    if k == 1:
        return np.sqrt(square)
    return ((square / k) ** (1 / 3) - (1 - 2 / (9 * k))) / np.sqrt(2 / (9 * k))


def _like(name: str, squares: Mapping[str, float], causes: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """The causes that are not ruled out beside one, the best first; each parameter explains one by chance."""
    net = {each: square - causes[each].shape[1] for each, square in squares.items()}
    others = [each for each in net if each != name and net[name] - net[each] < _APART]
    return tuple(sorted(others, key=net.__getitem__, reverse=True))


def _sized(name: str, A: np.ndarray, scaled: np.ndarray, check: int, significance: float) -> Drift:
    """Onset and size of a cause, from the checks one by one."""
    sizes = scaled[: check + 1] @ np.linalg.pinv(A).T  # (checks, parameters)
    of_one = float(np.sqrt(np.linalg.inv(A.T @ A).diagonal().max()))
    length = np.linalg.norm(sizes, axis=1)
    beyond = length > 3.0 * np.sqrt(2.0) * of_one  # of a difference of two checks
    onset = check
    while onset > 0 and beyond[onset - 1]:
        onset -= 1
    mean = sizes[onset:].mean(axis=0)
    size = float(mean[0]) if A.shape[1] == 1 else float(np.linalg.norm(mean))
    sigma = of_one * float(np.sqrt(1.0 + 1.0 / (check + 1 - onset)))  # of a mean less the first check
    return Drift(name, size, sigma, significance, check, onset)
