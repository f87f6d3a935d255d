"""A yielding robot as a rigid one that is right at one pose, for formats that know no compliances."""

from dataclasses import replace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.forward import rotation_about
from robots.pose import rotation_from_zyx, zyx_from_rotation


def with_baked_sag(robot: RobotModel, payload: float, q: np.ndarray) -> RobotModel:
    """The robot with every joint turned by what it yields at one pose, and without compliances.

    Args:
        robot: with the compliances of a calibration.
        payload: mass at the flange in kg.
        q: motor positions in rad, shape (6,); there the result is exact.

    Raises:
        ValueError: if the robot has no compliances or may not carry the payload.
    """
    if not robot.compliance.any():
        raise ValueError(
            f"sag of {robot.name}: it has no compliances to bake in; calibrate with --compliance"
        )
    sag = CompliantKinematics(robot, payload).link_positions(q) - q
    joints = []
    for joint, axis, angle in zip(robot.joints, robot.axes, sag, strict=True):
        R = rotation_from_zyx(np.deg2rad(joint.placement.zyx_deg)) @ rotation_about(axis, angle)
        source = f"with the sag at one pose under {payload:g} kg; {joint.placement.source}"
        placement = replace(joint.placement, zyx_deg=np.rad2deg(zyx_from_rotation(R)), source=source)
        joints.append(replace(joint, placement=placement))
    calibration = replace(robot.calibration, compliance=[0.0] * NUM_JOINTS)
    return replace(robot, joints=joints, calibration=calibration)
