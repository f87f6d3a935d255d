"""A robot whose springs, friction and backlash are by known factors others than those in its file."""

from dataclasses import dataclass, field, replace

import numpy as np

from robots.description.beam import Beam
from robots.description.drive_parts import Backlash
from robots.description.model import NUM_JOINTS, DriveTrain, Joint, RobotModel, Tilting


@dataclass(frozen=True)
class Factors:
    """By what the parameters of a robot are multiplied; all are positive.

    A spring keeps its damping ratio: its damper is multiplied by the same factor.
    """

    gears: np.ndarray = field(default_factory=lambda: np.ones(NUM_JOINTS))  # stiffness, shape (6,)
    bearings: np.ndarray = field(default_factory=lambda: np.ones((NUM_JOINTS, 2)))  # of `Tilting`, (6, 2)
    beams: np.ndarray = field(default_factory=lambda: np.ones((NUM_JOINTS, 3)))  # about x, y, z, (6, 3)
    friction: np.ndarray = field(default_factory=lambda: np.ones(NUM_JOINTS))  # viscous and Coulomb, (6,)

    def __post_init__(self) -> None:
        for label in ("gears", "bearings", "beams", "friction"):
            values = np.asarray(getattr(self, label))
            if not (np.isfinite(values).all() and values.min() > 0.0):
                raise ValueError(f"factors of {label} must be positive and finite, got {values.tolist()}")


def varied(robot: RobotModel, factors: Factors) -> RobotModel:
    """A robot with other springs and friction; geometry and masses are the same."""
    joints = [
        _varied_joint(joint, float(gear), bearing, float(friction))
        for joint, gear, bearing, friction in zip(
            robot.joints, factors.gears, factors.bearings, factors.friction, strict=True
        )
    ]
    links = [
        link if link.beam is None else replace(link, beam=_varied_beam(link.beam, factor))
        for link, factor in zip(robot.links, factors.beams, strict=True)
    ]
    return replace(robot, joints=joints, links=links)


def with_backlash(robot: RobotModel, factor: float) -> RobotModel:
    """A robot whose gaps between teeth are multiplied by a factor; what damps within them is the same."""

    def with_gap(train: DriveTrain) -> DriveTrain:
        play = train.backlash
        if not isinstance(play, Backlash):
            return train
        return replace(train, backlash=replace(play, arc_minutes=factor * play.arc_minutes))

    joints = [replace(joint, drive_train=with_gap(joint.drive_train)) for joint in robot.joints]
    return replace(robot, joints=joints)


def _varied_joint(joint: Joint, gear: float, bearing: np.ndarray, friction: float) -> Joint:
    tilting = joint.tilting
    if tilting is not None:
        stiffness, damping = (
            [float(factor * value) for factor, value in zip(bearing, values, strict=True)]
            for values in (tilting.stiffness, tilting.damping)
        )
        a, b = (
            each.scaled(float(factor)) if each else None
            for each, factor in zip((tilting.stiffening_a, tilting.stiffening_b), bearing, strict=True)
        )
        tilting = Tilting(stiffness, damping, a, b, tilting.source)
    return replace(joint, drive_train=_varied_drive_train(joint.drive_train, gear, friction), tilting=tilting)


def _varied_drive_train(train: DriveTrain, gear: float, friction: float) -> DriveTrain:
    return replace(
        train,
        stiffness=gear * train.stiffness,
        stiffening=train.stiffening.scaled(gear) if train.stiffening else None,
        damping=gear * train.damping,
        viscous_friction=friction * train.viscous_friction,
        coulomb_friction=friction * train.coulomb_friction,
        friction=train.friction.scaled(friction) if train.friction else None,
    )


def _varied_beam(beam: Beam, factor: np.ndarray) -> Beam:
    x, y, z = (
        each.scaled(float(share)) if each else None
        for each, share in zip(beam.stiffening, factor, strict=True)
    )
    return replace(beam, stiffness=factor * beam.stiffness, stiffening_x=x, stiffening_y=y, stiffening_z=z)
