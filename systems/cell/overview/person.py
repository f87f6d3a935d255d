"""A person who walks a way through the cell: a jointed figure of capsules in clothes.

The proportions are those of an adult of 1.75 m, assumed. Thighs and upper arms swing against each other like
pendulums, once in two steps; knees bend while a leg comes forward. Where the way rests, the figure stands.
"""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from robots.configuration.quantity import file_name, quantity, vector
from robots.kinematics.arm_capsules import Capsules

_SKIN, _SHIRT, _TROUSERS, _SHOES = (0.85, 0.65, 0.52), (0.2, 0.35, 0.6), (0.15, 0.15, 0.2), (0.1, 0.08, 0.08)
COLORS = (_SKIN, _SHIRT, _SHIRT, *(_TROUSERS, _TROUSERS, _SHOES, _SHIRT, _SKIN) * 2)  # of each capsule
_ALONG = np.linspace(0.0, 1.0, 50)[:, None]  # the axis of a limb
_STRIDE = 1.4  # m, two steps
_SWING, _KNEE, _ELBOW = 0.42, 0.7, 0.35  # rad, largest angles of hip and shoulder, knee and elbow
_HIP, _KNEE_LENGTH, _SHANK = 0.92, 0.43, 0.42  # m, height and lengths
_TRUNK, _SHOULDERS = 1, 2  # of the capsules
_NECK, _ARM, _FOREARM = np.array([0.0, 0.0, 1.39]), 0.29, 0.33


@dataclass
class WayPoint:
    """A point of a way, and how long the person stands there."""

    place: np.ndarray = vector((0.0, 0.0), unit="m")  # x and y in the world
    rest: float = quantity(0.0, 0.0, unit="s")  # standing there before going on


@dataclass
class PersonConfig:
    """Where a person walks; read from a scenario file."""

    way: list[WayPoint] = field(default_factory=list)  # a single point is where the person stands
    speed: float = quantity(1.2, 0.0, 5.0, "m/s", is_open=True)  # of walking from point to point
    start: float = quantity(0.0, 0.0, unit="s")  # when it enters the cell at the first point
    facing_deg: float = quantity(0.0, unit="deg")  # where it looks at a single point
    # A file (.obj, .gltf, .glb; m, z upwards, looking along x, feet about the origin) that is drawn in its
    # place; the figure's distance still counts, and a virtual cell in real time draws the figure
    mesh: str = file_name()


class WalkingPerson:
    """Where a person is at any time. Before its start and after the end of its way it is not in the cell."""

    def __init__(self, config: PersonConfig, floor: float) -> None:
        """Plans the way. Raises ValueError if it has no point."""
        if not config.way:
            raise ValueError("person: a way needs at least one point, got none")
        self._config, self._floor = config, floor
        self._points = np.array([point.place for point in config.way])
        self._legs = np.linalg.norm(np.diff(self._points, axis=0), axis=1)
        self._begin, time = [], config.start  # when each leg begins
        for point, leg in zip(config.way, [*self._legs, 0.0], strict=True):
            time += point.rest
            self._begin.append(time)
            time += leg / config.speed
        self._is_still = len(self._points) == 1
        self.end = np.inf if self._is_still else time

    @property
    def figure(self) -> Capsules:
        """The figure where it stands at first, for its sizes."""
        return figure(self._points[0], 0.0, self._floor)

    def at(self, time: float) -> Capsules | None:
        """The figure at a time in s; None if the person is not in the cell."""
        if not self._config.start <= time < self.end:
            return None
        if self._is_still:
            return figure(self._points[0], np.deg2rad(self._config.facing_deg), self._floor)
        leg = min(max(int(np.searchsorted(self._begin, time, side="right")) - 1, 0), len(self._legs) - 1)
        walked = min(max(0.0, (time - self._begin[leg]) * self._config.speed), float(self._legs[leg]))
        way = self._points[leg + 1] - self._points[leg]
        ahead = way / max(float(self._legs[leg]), 1e-9)
        phase = 2.0 * np.pi * (self._legs[:leg].sum() + walked) / _STRIDE
        is_walking = 0.0 < walked < self._legs[leg]
        yaw = float(np.arctan2(ahead[1], ahead[0]))
        return figure(self._points[leg] + walked * ahead, yaw, self._floor, phase, float(is_walking))


def standing(person: Capsules, floor: float) -> RigidTransform:
    """The frame of a figure: on the floor below its trunk, x where it looks."""
    across = person.end[_SHOULDERS] - person.start[_SHOULDERS]
    yaw = float(np.arctan2(-across[0], across[1]))
    return RigidTransform(RotationMatrix.MakeZRotation(yaw), [*person.start[_TRUNK, :2], floor])


def figure(place: np.ndarray, yaw: float, floor: float, phase: float = 0.0, swing: float = 0.0) -> Capsules:
    """The capsules of a person.

    Args:
        place: x and y of the middle of the body in m, (2,).
        yaw: direction in which it looks in rad.
        floor: its height in m.
        phase: of its gait in rad, 2 pi for two steps.
        swing: 0 standing, 1 walking.
    """
    across = np.array([0.0, 0.15, 0.0])
    parts: list[tuple[np.ndarray, np.ndarray, float]] = [
        (np.array([0.0, 0.0, 1.64]), np.array([0.02, 0.0, 1.66]), 0.105),  # head
        (np.array([0.0, 0.0, 1.05]), np.array([0.0, 0.0, 1.38]), 0.14),  # trunk
        (_NECK - across, _NECK + across, 0.075),  # shoulders
    ]
    for side, offset in ((1.0, 0.0), (-1.0, np.pi)):
        hip = swing * _SWING * np.sin(phase + offset)
        knee = hip - swing * _KNEE * max(0.0, np.cos(phase + offset))
        shoulder = -0.8 * hip
        elbow = shoulder + _ELBOW * (0.4 + 0.6 * swing)
        top = np.array([0.0, side * 0.1, _HIP])
        middle = top + _KNEE_LENGTH * _down(hip)
        ankle = middle + _SHANK * _down(knee)
        hang = _NECK + side * np.array([0.0, 0.22, 0.0])
        joint = hang + _ARM * _down(shoulder)
        parts += [
            (top, middle, 0.078),
            (middle, ankle, 0.055),
            (ankle, ankle + np.array([0.13, 0.0, -0.02]), 0.04),
            (hang, joint, 0.05),
            (joint, joint + _FOREARM * _down(elbow), 0.042),
        ]
    start, end, radius = (np.array(column) for column in zip(*parts, strict=True))
    lowest = float((np.minimum(start[:, 2], end[:, 2]) - radius).min())
    c, s = np.cos(yaw), np.sin(yaw)
    R, p = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.append(place, floor - lowest)
    return Capsules(start @ R.T + p, end @ R.T + p, radius)


def gap(person: Capsules, arm: Capsules) -> float:
    """The distance in m of a person from the arm, from points along the axes of the limbs."""
    return min(
        float(arm.distances(start + _ALONG * (end - start)).min() - radius)
        for start, end, radius in zip(person.start, person.end, person.radius, strict=True)
    )


def _down(angle: float) -> np.ndarray:
    """The direction of a limb that hangs down and is swung forward by an angle in rad."""
    return np.array([np.sin(angle), 0.0, -np.cos(angle)])
