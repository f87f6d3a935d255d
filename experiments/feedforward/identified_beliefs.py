"""What an identification leaves unknown of a robot: beliefs that are off by as much as its figures say."""

from dataclasses import replace

import numpy as np

from robots.description.drive_parts import Backlash
from robots.description.model import NUM_JOINTS, DriveTrain, Link, RobotModel, Tilting
from robots.description.variation import Factors, varied

# Shares, either way, see docs/identification.md; play, hysteresis and ripple are known worst of all.
SPRINGS, DAMPERS, PARTS, FRICTION = 0.03, 0.25, 0.2, 0.2
PHASE_DEG = 15.0  # of the ripple, either way
TIP = 3e-5  # m, standard deviation of where a calibration has the tip, along each axis


def believed(true: RobotModel, draw: int) -> RobotModel:
    """The robot as an identification may find it.

    Args:
        true: the robot as it is.
        draw: a seed.
    """
    rng = np.random.default_rng([18, draw])

    def off(share: float, *size: int) -> np.ndarray:
        return 1.0 + share * rng.uniform(-1.0, 1.0, size)

    n = NUM_JOINTS
    robot = varied(true, Factors(off(SPRINGS, n), off(SPRINGS, n, 2), off(SPRINGS, n, 3), off(FRICTION, n)))
    gears, play, hysteresis, bearings, ripple = (
        off(share, n).tolist() for share in (DAMPERS, PARTS, PARTS, DAMPERS, PARTS)
    )
    phases = (PHASE_DEG * rng.uniform(-1.0, 1.0, n)).tolist()
    joints = [
        replace(
            joint,
            drive_train=_with_parts(
                joint.drive_train, gears[i], play[i], hysteresis[i], ripple[i], phases[i]
            ),
            tilting=_damped(joint.tilting, bearings[i]),
        )
        for i, joint in enumerate(robot.joints)
    ]
    beams = off(DAMPERS, n).tolist()
    links = [_with_beam(link, share) for link, share in zip(robot.links, beams, strict=True)]
    tool = replace(robot.tool, translation=robot.tool.translation + TIP * rng.standard_normal(3))
    return replace(robot, joints=joints, links=links, tool=tool)


def _with_parts(
    train: DriveTrain, damper: float, play: float, hysteresis: float, ripple: float, phase: float
) -> DriveTrain:
    """Parts that a gear has, by these factors; the ripple ahead by a phase in degrees."""
    train = replace(train, damping=damper * train.damping)
    gap, held, wave = train.backlash, train.hysteresis, train.ratio_error
    if isinstance(gap, Backlash):
        arc = play * gap.arc_minutes
        train = replace(train, backlash=replace(gap, arc_minutes=arc, lubricant=damper * gap.lubricant))
    if held is not None:
        train = replace(train, hysteresis=replace(held, stiffness=[hysteresis * c for c in held.stiffness]))
    if wave is not None:
        amplitudes = [ripple * amplitude for amplitude in wave.amplitudes]
        phases = [phase + own for own in wave.phases_deg]
        train = replace(train, ratio_error=replace(wave, amplitudes=amplitudes, phases_deg=phases))
    return train


def _damped(tilting: Tilting | None, share: float) -> Tilting | None:
    if tilting is None:
        return None
    return replace(tilting, damping=[share * each for each in tilting.damping])


def _with_beam(link: Link, share: float) -> Link:
    if link.beam is None:
        return link
    return replace(link, beam=replace(link.beam, retardation_time=share * link.beam.retardation_time))
