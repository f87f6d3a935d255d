"""``--urdf``, ``--urdf-payload``, ``--urdf-pose``: a yielding robot in a format that knows rigid ones."""

from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.description.urdf import not_in_urdf
from robots.dynamics.baked_sag import with_baked_sag
from robots.dynamics.compliant_kinematics import controller_kinematics
from robots.kinematics.forward import Kinematics


@dataclass(frozen=True)
class Sag:
    """What is baked in."""

    payload: float  # kg
    q: np.ndarray  # (6,) rad


def urdf_sag(file: str | None, payload: float | None, pose: str | None, compliance: bool) -> Sag | None:
    """What the options ask for; None for a robot without sag.

    Raises:
        ValueError: if an option is given without what it needs, or is not what it should be.
    """
    if payload is None:
        if pose is not None:
            raise ValueError("--urdf-pose needs --urdf-payload: without it no sag is baked in")
        return None
    if file is None:
        raise ValueError("--urdf-payload needs --urdf FILE.urdf")
    if not compliance:
        raise ValueError("--urdf-payload needs --compliance: without it nothing is known of how joints yield")
    try:
        q = np.deg2rad([float(part) for part in (pose or "0,0,0,0,0,0").split(",")])
    except ValueError:
        q = np.zeros(0)
    if q.shape != (NUM_JOINTS,) or not np.isfinite(q).all():
        raise ValueError(f"--urdf-pose must be six angles in degrees such as 0,20,10,0,40,0, got '{pose}'")
    return Sag(payload, q)


def urdf_robot(
    robot: RobotModel, sag: Sag | None, q: np.ndarray, payload: np.ndarray
) -> tuple[RobotModel, str]:
    """The robot to write as URDF, and what its reader should know.

    Args:
        robot: the calibrated one.
        sag: what is baked in; None for nothing.
        q: measured configurations in rad, (n, 6).
        payload: their loads in kg, (n,).

    Raises:
        ValueError: if the sag cannot be baked in; the message has the reason.
    """
    drawn = robot if sag is None else with_baked_sag(robot, sag.payload, sag.q)
    note = not_in_urdf(robot)
    if robot.compliance.any():
        rigid, payloads = Kinematics(drawn).forward(q), np.unique(payload)
        worst = 0.0
        for load in [float(each) for each in payloads] if sag is None else [sag.payload]:
            true = controller_kinematics(robot, load).forward(q)
            worst = max(worst, float(np.linalg.norm((true - rigid)[:, :3, 3], axis=1).max()))
        loads = "the measured loads" if sag is None else f"{sag.payload:g} kg"
        note += f". Under {loads} its tool is up to {1e3 * worst:.2f} mm off at the measured configurations"
        note += ", at the pose that was baked in exact." if sag else "; --urdf-payload bakes in one pose."
    return drawn, note
