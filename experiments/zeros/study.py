"""Zeros of a robot over its workspace, and of the two-joint arm."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.feedforward.two_joint_arm import (
    DAMPING,
    FAR,
    INERTIA,
    LENGTH,
    MASS,
    SHARE,
    STIFFNESS,
    TwoJointArm,
)
from robots.description.model import RobotModel
from robots.dynamics.transmission_zeros import ZeroAnalysis, Zeros, transmission_zeros

_BENT_WRIST = (0.0, 0.7, 0.0)  # rad of axes 4 to 6: with axis 5 at zero the wrist is singular
BEAM_MODES = (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class ZeroStudy:
    """The zeros over a grid of axes 2 and 3, axis 1 at zero."""

    robot: RobotModel
    elasticity: str
    payload: float  # kg
    axis_2: np.ndarray  # (n,) rad
    axis_3: np.ndarray  # (m,) rad
    wrist: np.ndarray  # (3,) rad, axes 4 to 6
    workspace: list[list[Zeros | None]]  # n lists of m; None at singular poses

    @property
    def slowest_rhp(self) -> np.ndarray:
        """The slowest zero in the right half-plane in 1/s, NaN where there is none; shape (n, m)."""
        return np.array(
            [
                [np.nan if z is None or z.slowest_rhp is None else z.slowest_rhp for z in row]
                for row in self.workspace
            ]
        )

    @property
    def regular(self) -> list[Zeros]:
        """The zeros of all poses that are not singular."""
        return [z for row in self.workspace for z in row if z is not None]


def study_zeros(
    robot: RobotModel,
    elasticity: str,
    payload: float,
    grid: int,
    progress: Callable[[float], None] | None = None,
    wrist: np.ndarray | None = None,
) -> ZeroStudy:
    """Finds the zeros at grid x grid positions of axes 2 and 3 within their limits.

    Args:
        robot: whose zeros.
        elasticity: what of it is elastic.
        payload: kg.
        grid: positions of each of the two axes.
        progress: is called with the share that is done.
        wrist: where axes 4 to 6 are, rad, (3,); None for axis 5 bent by 0.7 rad.

    Raises:
        ValueError: if the grid is too small or all of it singular, the wrist is beyond its limits, or
            `ZeroAnalysis` refuses the robot.
    """
    wrist = np.array(_BENT_WRIST) if wrist is None else wrist
    if ((wrist < robot.lower[3:]) | (wrist > robot.upper[3:])).any():
        limits = zip(np.rad2deg(robot.lower[3:]), np.rad2deg(robot.upper[3:]), strict=True)
        ranges = ", ".join(f"{low:g} to {high:g}" for low, high in limits)
        angles = ",".join(f"{angle:g}" for angle in np.rad2deg(wrist))
        raise ValueError(f"--wrist {angles}: axes 4 to 6 of {robot.name} have {ranges} degrees")
    if grid < 2:
        raise ValueError(f"--grid must be at least 2, got {grid}")
    analysis = ZeroAnalysis(robot, elasticity, payload)
    # Of a range of more than a turn, one turn.
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    axis_2, axis_3 = np.linspace(lower[1:3], upper[1:3], grid).T
    workspace = []
    for q2 in axis_2:
        workspace.append([_zeros_at(analysis, np.array([0.0, q2, q3, *wrist])) for q3 in axis_3])
        if progress:
            progress(len(workspace) / grid)
    study = ZeroStudy(robot, elasticity, payload, axis_2, axis_3, wrist, workspace)
    if not study.regular:
        angles = ",".join(f"{angle:.3g}" for angle in np.rad2deg(wrist))
        raise ValueError(
            f"zeros of {robot.name}: the arm is singular at all {grid} x {grid} positions of axes 2 and 3 "
            f"with axes 4 to 6 at {angles} degrees; another --wrist or a larger --grid may have others"
        )
    return study


def _zeros_at(analysis: ZeroAnalysis, theta: np.ndarray) -> Zeros | None:
    try:
        return analysis.at(theta)
    except ValueError:
        return None


def zeros_json(study: ZeroStudy) -> dict[str, Any]:
    """The zeros at the pose with the slowest one in the right half-plane, and the map of these."""
    slowest = study.slowest_rhp
    has_any = bool(np.isfinite(slowest).any())
    worst = study.regular[0]
    if has_any:
        worst = min(
            (z for z in study.regular if z.slowest_rhp is not None), key=lambda z: z.slowest_rhp or 0.0
        )
    return {
        "robot": study.robot.name,
        "elasticity": study.elasticity,
        "payload_kg": study.payload,
        "zeros": _pairs(worst),
        "slowest_rhp": float(np.nanmin(slowest)) if has_any else None,
        "relative_degree": worst.relative_degree,
        "poses": len(study.regular),
        "poses_with_unstable_inverse": sum(not z.is_minimum_phase for z in study.regular),
        "axis_2_deg": np.rad2deg(study.axis_2).tolist(),
        "axis_3_deg": np.rad2deg(study.axis_3).tolist(),
        "wrist_deg": np.rad2deg(study.wrist).tolist(),
        "slowest_rhp_map": [[None if np.isnan(value) else float(value) for value in row] for row in slowest],
    }


def two_joint_arm_zeros(
    x_l: float = 0.5 * SHARE * LENGTH, stiffness: float = STIFFNESS, damping: float = DAMPING
) -> Zeros:
    """From the driven joint to a point x_l (m) beyond the centre of mass; Reiner (2010), section 3.5.3."""
    plant = TwoJointArm().plant
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())
    C = np.array([[LENGTH + x_l, FAR + x_l]])  # of the transverse displacement, at rest
    return transmission_zeros(
        M, np.diag([0.0, damping]), np.diag([0.0, stiffness]), np.array([[1.0], [0.0]]), C
    )


def two_joint_arm_limit() -> float:
    """The x_l beyond which the inverse is unstable, J_z / (m l (1 - xi)), in m."""
    return INERTIA / (MASS * LENGTH * (1.0 - SHARE))


def one_json(zeros: Zeros) -> dict[str, Any]:
    """The numbers of one system."""
    return {
        "zeros": _pairs(zeros),
        "slowest_rhp": zeros.slowest_rhp,
        "relative_degree": zeros.relative_degree,
        "poses": 1,
    }


def _pairs(zeros: Zeros) -> list[list[float]]:
    return [[float(z.real), float(z.imag)] for z in zeros.values]
