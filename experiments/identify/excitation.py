"""A slow motion that is designed for a robot, as a table for its controller."""

from pathlib import Path
from typing import Any

import numpy as np

from experiments.report.files import write_text
from robots.description.model import NUM_JOINTS, RobotModel
from robots.measurement_design.excitation import Excitation, FourierMotion, design_excitation

_PERIOD = 30.0  # s, of a motion
_REST = 0.2  # s, before and after it
_TABLE = 0.01  # s, between rows


def designed_slow_motion(robot: RobotModel, seed: int) -> Excitation:
    """A slow motion of all joints with the largest payload for load, counterbalance and friction.

    Raises:
        ValueError: if no motion is free of collisions.
    """
    return design_excitation(robot, robot.payload.largest_mass, _PERIOD, seed=seed)


def told_of(excitation: Excitation) -> str:
    """How good a motion is, in a sentence."""
    return (
        f"Slow motion of {excitation.motion.period:g} s with condition number {excitation.condition:.1f}; "
        f"motions drawn at random have {excitation.drawn:.1f} in the median. "
        f"{excitation.evaluations} evaluations."
    )


def excitation_json(excitation: Excitation) -> dict[str, Any]:
    """The numbers."""
    return {
        "period_s": excitation.motion.period,
        "condition": excitation.condition,
        "drawn_condition": excitation.drawn,
        "evaluations": excitation.evaluations,
    }


def write_excitation(path: Path, excitation: Excitation) -> None:
    """Writes a motion as a table: time in s, positions in rad, velocities in rad/s.

    Raises:
        OSError: if it cannot be written.
    """
    times = np.arange(0.0, _PERIOD + 2.0 * _REST, _TABLE)
    q, v, _ = _played(excitation.motion, times)
    joints = range(1, NUM_JOINTS + 1)
    head = ["time", *(f"position_{i}" for i in joints), *(f"speed_{i}" for i in joints)]
    rows = np.column_stack([times, q, v])
    lines = [",".join(head), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    write_text(path, "\n".join(lines) + "\n")


def _played(motion: FourierMotion, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A motion with a rest before and after it."""
    within = np.clip(times - _REST, 0.0, motion.period)
    q, v, a = motion.at(within)
    resting = (times < _REST) | (times > _REST + motion.period)
    v[resting], a[resting] = 0.0, 0.0
    return q, v, a
