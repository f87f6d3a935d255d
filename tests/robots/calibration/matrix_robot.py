"""A robot as a product of matrices, written for the tests alone: it shares no code with the kinematics.

The pose of the tool is the product of its placements and of turns about its axes; every placement may be
displaced by a small motion of its own.
"""

import warnings
import xml.etree.ElementTree as ElementTree
from importlib.resources import files
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

_WIDEST = 2.97  # rad: beyond it a joint shows nothing new


def homogeneous(rotation: Rotation, translation: np.ndarray) -> np.ndarray:
    X = np.tile(np.eye(4), (*np.shape(translation)[:-1], 1, 1))
    X[..., :3, :3], X[..., :3, 3] = rotation.as_matrix(), translation
    return X


class MatrixRobot:
    """Placements (8, 4, 4), unit axes (6, 3) and ranges in rad (6, 2), of a shipped robot or a URDF."""

    def __init__(self, name: str) -> None:
        self.scales = np.ones(6)
        if name.endswith(".urdf"):
            self._read_urdf(Path(name))
            return
        # Numbers as text, whatever the tags of the other parts mean.
        data = yaml.load((files("robots") / "data" / f"{name}.yaml").read_text(), Loader=yaml.BaseLoader)
        placements = [data["base"], *(joint["placement"] for joint in data["joints"]), data["tool"]]
        turns = Rotation.from_euler(
            "ZYX", np.array([part["zyx_deg"] for part in placements], float), degrees=True
        )
        self.placements = homogeneous(turns, np.array([part["translation"] for part in placements], float))
        axes = np.array([joint["axis"] for joint in data["joints"]], float)
        self.axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        limits = [[joint["limits"][f"{side}_deg"] for side in ("lower", "upper")] for joint in data["joints"]]
        self.ranges = np.clip(np.deg2rad(np.array(limits, float)), -_WIDEST, _WIDEST)

    def _read_urdf(self, path: Path, tip: str = "tool0") -> None:
        """Follows the parents from the tip to the root; fixed joints belong to the placement behind them."""
        joints = {
            child.get("link"): joint
            for joint in ElementTree.parse(path).iter("joint")
            for child in joint.iter("child")
        }
        chain, link = [], tip
        while link in joints:
            chain.insert(0, joints[link])
            link = next(joints[link].iter("parent")).get("link")

        def numbers(joint: ElementTree.Element, tag: str, key: str, default: str) -> np.ndarray:
            found = joint.find(tag)
            return np.array((default if found is None else found.get(key, default)).split(), float)

        placements, axes, ranges = [np.eye(4)], [], []
        for joint in chain:
            turn = Rotation.from_euler("xyz", numbers(joint, "origin", "rpy", "0 0 0"))
            X = homogeneous(turn, numbers(joint, "origin", "xyz", "0 0 0"))
            placements[-1] = placements[-1] @ X
            if joint.get("type") != "fixed":
                placements.append(np.eye(4))
                axes.append(numbers(joint, "axis", "xyz", "1 0 0"))
                ranges.append([numbers(joint, "limit", side, "0")[0] for side in ("lower", "upper")])
        self.placements = np.array([np.eye(4), *placements])
        self.axes = np.array(axes)
        self.ranges = np.clip(np.array(ranges), -_WIDEST, _WIDEST)

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Tool poses (n, 4, 4) at joint positions (n, 6)."""
        X = np.tile(self.placements[0], (len(q), 1, 1))
        for i, axis in enumerate(self.axes):
            turn = homogeneous(
                Rotation.from_rotvec(np.outer(self.scales[i] * q[:, i], axis)), np.zeros((len(q), 3))
            )
            X = X @ self.placements[i + 1] @ turn
        return X @ self.placements[7]

    def displaced(self, rng: np.random.Generator, size: float = 6e-3, angle: float = 0.0157) -> "MatrixRobot":
        """The robot with every placement moved and every joint turned by small random motions."""
        other = MatrixRobot.__new__(MatrixRobot)
        other.axes, other.ranges, other.scales = self.axes, self.ranges, self.scales.copy()
        moves = homogeneous(
            Rotation.from_rotvec(angle * rng.normal(size=(8, 3))), size * rng.normal(size=(8, 3))
        )
        other.placements = self.placements @ moves
        zeros = homogeneous(
            Rotation.from_rotvec(angle * rng.normal(size=(6, 1)) * self.axes), np.zeros((6, 3))
        )
        other.placements[1:7] = other.placements[1:7] @ zeros
        return other

    def seen_from(self, frame: np.ndarray) -> "MatrixRobot":
        """The robot in the frame of an instrument, (4, 4)."""
        other = MatrixRobot.__new__(MatrixRobot)
        other.axes, other.ranges, other.scales = self.axes, self.ranges, self.scales
        other.placements = self.placements.copy()
        other.placements[0] = frame @ other.placements[0]
        return other

    def with_tool(self, translation: np.ndarray) -> "MatrixRobot":
        """The robot with its tool elsewhere in the flange, not turned."""
        other = self.seen_from(np.eye(4))
        other.placements[7] = np.eye(4)
        other.placements[7, :3, 3] = translation
        return other

    def reframed(self, rng: np.random.Generator) -> "MatrixRobot":
        """The same motions, written with other frames: turned about and moved along each axis, and anyhow.

        A frame may sit anywhere on its axis and be turned about it; the directions of all its coordinates
        may be chosen afresh.
        """
        other = self.seen_from(np.eye(4))
        other.axes = other.axes.copy()
        for i in range(6):
            along = homogeneous(
                Rotation.from_rotvec(rng.uniform(-3.0, 3.0) * self.axes[i]),
                rng.uniform(-0.2, 0.2) * self.axes[i],
            )
            turn = homogeneous(Rotation.random(rng=rng), np.zeros(3))
            # T(axis) commutes with the joint's rotation; a change of coordinates turns the axis along.
            change = along @ turn
            other.placements[i + 1] = other.placements[i + 1] @ change
            other.placements[i + 2] = np.linalg.inv(change) @ other.placements[i + 2]
            other.axes[i] = turn[:3, :3].T @ self.axes[i]
        return other

    def configurations(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Joint positions all over the ranges, (count, 6)."""
        return rng.uniform(self.ranges[:, 0], self.ranges[:, 1], (count, 6))

    def apply_to(self, robot) -> None:
        """Gives a `RobotModel` these placements and axes, so that both describe one machine."""
        parts = [robot.base, *(joint.placement for joint in robot.joints), robot.tool]
        for part, X in zip(parts, self.placements, strict=True):
            part.translation = X[:3, 3].copy()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of angles that are not unique: any will do
                part.zyx_deg = Rotation.from_matrix(X[:3, :3]).as_euler("ZYX", degrees=True)
        for joint, axis in zip(robot.joints, self.axes, strict=True):
            joint.axis = axis.copy()
