"""The modes of an elastic robot, stretched and over its workspace, and their numbers as JSON."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robots.description.model import RobotModel
from robots.dynamics.modes import ModalAnalysis, Modes, stretched

SHOWN_MODES = 6
# How a tool swings, for an arm whose axis 1 stands at zero: along x, y and z of the base, or about itself.
TIP_MOTIONS = ("in/out", "sideways", "up/down", "turning")


@dataclass(frozen=True)
class ModalStudy:
    """The modes of one robot, stretched and over a grid of its axes 2 and 3; all other axes at zero."""

    robot: RobotModel
    elasticity: str
    payload: float  # kg
    theta: np.ndarray  # (6,) rad, the stretched position
    stretched: Modes
    axis_2: np.ndarray  # (n,) rad
    axis_3: np.ndarray  # (m,) rad
    workspace: list[list[Modes]]  # n lists of m

    @property
    def frequency_hz(self) -> np.ndarray:
        """Frequencies over the workspace in Hz, shape (n, m, shown modes)."""
        return np.array([[modes.frequency_hz[:SHOWN_MODES] for modes in row] for row in self.workspace])

    @property
    def damping_ratio(self) -> np.ndarray:
        """Damping over the workspace, shape (n, m, shown modes)."""
        return np.array([[modes.damping_ratio[:SHOWN_MODES] for modes in row] for row in self.workspace])

    def energy_share(self, mode: int, everywhere: bool) -> dict[str, float]:
        """The share of each joint in the strain energy of a mode, the largest first.

        Args:
            mode: from 0.
            everywhere: the mean over the workspace, or else stretched.
        """
        shares = np.mean([modes.energy_share[:, mode] for modes in self._modes(everywhere)], axis=0)
        return {self.stretched.joints[i]: float(shares[i]) for i in np.argsort(shares)[::-1]}

    def tip_motion(self, mode: int, everywhere: bool) -> dict[str, float]:
        """How much the tool swings in each of `TIP_MOTIONS`, shares of its squared motion, the largest first.

        A turn counts by what it moves a tip as far from the wrist as the tool is. Arguments as of
        `energy_share`.
        """
        hand = self.robot.joints[5].placement.translation, self.robot.tool.translation
        length = sum(float(np.linalg.norm(part)) for part in hand)
        tip = np.array([modes.tip[:, mode] for modes in self._modes(everywhere)])
        in_base = tip[:, 3:] @ self.robot.base.pose().rotation().matrix()
        squared = np.hstack([tip[:, :3], in_base]) ** 2
        motion = np.column_stack([squared[:, 3:], length**2 * squared[:, :3].sum(1)])
        shares = np.mean(motion / motion.sum(1, keepdims=True), axis=0)
        return {TIP_MOTIONS[i]: float(shares[i]) for i in np.argsort(shares)[::-1]}

    def _modes(self, everywhere: bool) -> Sequence[Modes]:
        return [modes for row in self.workspace for modes in row] if everywhere else [self.stretched]


def study_modes(
    robot: RobotModel,
    elasticity: str,
    payload: float,
    grid: int,
    progress: Callable[[float], None] | None = None,
) -> ModalStudy:
    """Finds the modes at grid x grid positions of axes 2 and 3 within their limits.

    Raises:
        ValueError: if the grid is too small, or `ModalAnalysis` refuses the robot.
    """
    if grid < 2:
        raise ValueError(f"--grid must be at least 2, got {grid}")
    analysis = ModalAnalysis(robot, elasticity, payload)
    theta = stretched(robot)
    # Of a range of more than a turn, one turn.
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    axis_2, axis_3 = np.linspace(lower[1:3], upper[1:3], grid).T
    workspace = []
    for q2 in axis_2:
        workspace.append([analysis.at(np.array([0.0, q2, q3, 0.0, 0.0, 0.0])) for q3 in axis_3])
        if progress:
            progress(len(workspace) / grid)
    return ModalStudy(robot, elasticity, payload, theta, analysis.at(theta), axis_2, axis_3, workspace)


def spread(values: np.ndarray) -> dict[str, float]:
    """The smallest, the median and the largest of many values."""
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}


def modes_json(study: ModalStudy) -> dict[str, Any]:
    """The numbers, with the units in their names; a shape is the deflections of the joints, the largest 1."""
    shown, modes = range(SHOWN_MODES), study.stretched
    frequency, damping = study.frequency_hz, study.damping_ratio
    return {
        "robot": study.robot.name,
        "elasticity": study.elasticity,
        "payload_kg": study.payload,
        "stretched": {
            "position_deg": np.rad2deg(study.theta).tolist(),
            "frequency_hz": modes.frequency_hz[:SHOWN_MODES].tolist(),
            "damping_ratio": modes.damping_ratio[:SHOWN_MODES].tolist(),
            "shape": [_normed(modes, k) for k in shown],
            "energy_share": [study.energy_share(k, everywhere=False) for k in shown],
            "tip_motion": [study.tip_motion(k, everywhere=False) for k in shown],
        },
        "workspace": {
            "axis_2_deg": np.rad2deg(study.axis_2).tolist(),
            "axis_3_deg": np.rad2deg(study.axis_3).tolist(),
            "lowest_frequency_hz": frequency[..., 0].tolist(),
            "frequency_hz": [spread(frequency[..., k]) for k in shown],
            "damping_ratio": [spread(damping[..., k]) for k in shown],
            "energy_share": [study.energy_share(k, everywhere=True) for k in shown],
            "tip_motion": [study.tip_motion(k, everywhere=True) for k in shown],
        },
    }


def _normed(modes: Modes, mode: int) -> dict[str, float]:
    shape = modes.shape[:, mode]
    largest = shape[np.argmax(np.abs(shape))]
    return dict(zip(modes.joints, (shape / largest).tolist(), strict=True))
