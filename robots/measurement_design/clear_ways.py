"""Ways from configuration to configuration that keep clear of floor, obstacles and the arm itself.

A straight way in joint space is sampled so densely that no point of the arm moves by more than twice the
clearance from one sample to the next: where all samples keep the clearance, nothing is touched between them.
Where the straight way is blocked, two trees of random configurations grow towards each other (RRT-Connect,
Kuffner and LaValle 2000), and what they find is shortened.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel

Admissible = Callable[[np.ndarray], np.ndarray]

_STEP = 0.35  # rad, by which a tree grows
_TRIES = 600  # random configurations for one way
_SHORTCUTS = 40


class ClearWays:
    """Finds ways of one robot among what stands around it."""

    def __init__(
        self,
        robot: RobotModel,
        admissible: Admissible,
        clearance: float,
        tool_reach: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Takes the checks.

        Args:
            robot: that moves.
            admissible: which configurations (n, 6) keep the clearance, (n,) bool, and nothing else.
            clearance: that it checks, in m.
            tool_reach: of what the flange carries beyond the tool's origin in m.
            seed: of the random configurations.

        Raises:
            ValueError: if the clearance is not positive.
        """
        if not clearance > 0.0:
            raise ValueError(f"ways: the clearance must be positive, got {clearance} m")
        self._robot, self._admissible, self._seed = robot, admissible, seed
        lengths = [float(np.linalg.norm(joint.placement.translation)) for joint in robot.joints[1:]]
        lengths.append(float(np.linalg.norm(robot.tool.translation)) + tool_reach)
        thick = max(link.radius for link in robot.links)
        # How far a point of the arm can be from each axis.
        self._reach = np.cumsum(lengths[::-1])[::-1] + thick
        self._spacing = 2.0 * clearance

    def is_clear(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Whether the straight way between two configurations (6,) in rad is clear."""
        moved = float(np.abs(end - start) @ self._reach)  # no point moves further
        share = np.linspace(0.0, 1.0, max(2, int(np.ceil(moved / self._spacing)) + 1))
        # From coarse to fine: a way that is blocked is mostly seen in its middle.
        share = share[np.argsort(np.arange(len(share)) % 8, kind="stable")]
        for part in np.array_split(share, max(1, len(share) // 16)):
            if not self._admissible(start + part[:, None] * (end - start)).all():
                return False
        return True

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The via points of a clear way between two configurations in rad, (k, 6); none if it is straight.

        Raises:
            ValueError: if one end is not admissible, or no way is found.
        """
        if self.is_clear(start, end):
            return np.zeros((0, NUM_JOINTS))
        for place, is_admissible in zip((start, end), self._admissible(np.stack([start, end])), strict=True):
            if not is_admissible:
                raise ValueError(
                    f"ways: {_degrees(place)} degrees is beyond a limit of a joint, or the arm is too near "
                    "the floor, an obstacle or itself there"
                )
        way = self._connected(start, end)
        if way is None:
            raise ValueError(f"ways: none was found from {_degrees(start)} to {_degrees(end)} degrees")
        return np.array(self._shortened(way)[1:-1]).reshape(-1, NUM_JOINTS)

    def through(self, q: np.ndarray) -> list[np.ndarray]:
        """The via points before each configuration (n, 6) but the first: n - 1 arrays (k, 6) in rad."""
        return [self.between(start, end) for start, end in pairwise(q)]

    def _connected(self, start: np.ndarray, end: np.ndarray) -> list[np.ndarray] | None:
        rng = np.random.default_rng(self._seed)
        low, high = np.minimum(start, end) - 1.0, np.maximum(start, end) + 1.0
        low, high = np.maximum(low, self._robot.lower), np.minimum(high, self._robot.upper)
        trees: list[list[tuple[np.ndarray, int]]] = [[(start, -1)], [(end, -1)]]
        for number in range(_TRIES):
            mine, other = trees[number % 2], trees[1 - number % 2]
            grown = self._grown(mine, rng.uniform(low, high))
            if grown is None:
                continue
            goal = mine[grown][0]
            while True:  # the other tree grows towards the new place as far as it can
                met = self._grown(other, goal)
                if met is None:
                    break
                if np.array_equal(other[met][0], goal):
                    first, second = (grown, met) if number % 2 == 0 else (met, grown)
                    back = _branch(trees[0], first)[::-1]
                    return [*back, *_branch(trees[1], second)[1:]]
        return None

    def _grown(self, tree: list[tuple[np.ndarray, int]], goal: np.ndarray) -> int | None:
        """The index of a new place on the way from the nearest one to a goal; None if that is blocked."""
        places = np.array([place for place, _ in tree])
        nearest = int(np.linalg.norm(places - goal, axis=1).argmin())
        way = goal - places[nearest]
        distance = float(np.linalg.norm(way))
        new = goal if distance <= _STEP else places[nearest] + _STEP / distance * way
        if not self.is_clear(places[nearest], new):
            return None
        tree.append((new, nearest))
        return len(tree) - 1

    def _shortened(self, way: list[np.ndarray]) -> list[np.ndarray]:
        rng = np.random.default_rng(self._seed + 1)
        for _ in range(_SHORTCUTS):
            if len(way) < 3:
                break
            i, j = sorted(rng.choice(len(way), 2, replace=False))
            if j - i > 1 and self.is_clear(way[i], way[j]):
                way = [*way[: i + 1], *way[j:]]
        return way


def _branch(tree: list[tuple[np.ndarray, int]], index: int) -> list[np.ndarray]:
    """The places from one of a tree to its root."""
    found = []
    while index >= 0:
        place, index = tree[index]
        found.append(place)
    return found


def _degrees(q: np.ndarray) -> str:
    return ", ".join(f"{value:.1f}" for value in np.rad2deg(q))
