"""The numbers of an inverse model that may be tuned on a robot: springs, dampers, friction, lag, by name."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from robots.description.beam import Beam
from robots.description.drive_parts import Backlash
from robots.description.model import NUM_JOINTS, Joint, Link, RobotModel
from robots.description.variation import Factors, varied
from robots.identification.elastic_parameters import DIRECTIONS
from robots.identification.identified_robot import FoundParameter

DAMPERS = ("gears", "bearings", "beams")  # whose dampers change together
LAG, FRICTION, DAMPING, STIFFNESS = "motor_lag", "friction", "damping", "stiffness"


def tunable(robot: RobotModel) -> list[str]:
    """Names of what an inverse model of a robot uses, such as stiffness_gear_2, damping_beams, friction_3.

    Dampers of gears, of bearings and of beams change together, and so do viscous and Coulomb friction of a
    joint and the lags of all motors.
    """
    names = [*_springs(robot), *(f"{DAMPING}_{part}" for part in DAMPERS)]
    names += [f"{FRICTION}_{joint + 1}" for joint in range(NUM_JOINTS)]
    if any(joint.drive_train.motor_lag for joint in robot.joints):
        names.append(LAG)
    return names


def believed_sigma(name: str, found: Sequence[FoundParameter], unsure: float) -> float:
    """The relative standard deviation of a number that identification has left.

    Args:
        name: of `tunable`.
        found: by identification; the robot has what of it is identifiable.
        unsure: of what is not, and the largest of all.
    """
    one = name.removesuffix("s") if name.startswith(DAMPING) else name
    if name.startswith(DAMPING):  # gears have a number each
        rows = [row for row in found if row.name.startswith(one)]
    else:
        rows = [row for row in found if row.name == one or row.name.endswith(f"_{one}")]
    if not rows or not all(row.identifiable and row.value for row in rows):
        return unsure
    return min(max(row.sigma / abs(row.value) for row in rows), unsure)


def tuned_robot(robot: RobotModel, factors: Mapping[str, float]) -> RobotModel:
    """The robot with some numbers by known factors others; their sources say so.

    Args:
        robot: as it was.
        factors: by the names of `tunable`.
    """
    gears, bearings = np.ones(NUM_JOINTS), np.ones((NUM_JOINTS, 2))
    beams, friction = np.ones((NUM_JOINTS, 3)), np.ones(NUM_JOINTS)
    of_part = {"gear": gears[:, None], "bearing": bearings, "beam": beams}
    for name, factor in factors.items():
        kind, *rest = name.split("_")
        if kind == STIFFNESS:
            part, joint, *direction = rest
            of_part[part][int(joint) - 1, DIRECTIONS[part].index("".join(direction))] = factor
        elif kind == FRICTION:
            friction[int(rest[0]) - 1] = factor
    changed = varied(robot, Factors(gears, bearings, beams, friction))
    times = {part: factors.get(f"{DAMPING}_{part}", 1.0) for part in DAMPERS}
    said = [[_said(factors, f"{part}_{i + 1}") for i in range(NUM_JOINTS)] for part in DIRECTIONS]
    lag = factors.get(LAG, 1.0)
    joints = [
        _joint(joint, of_gear, of_bearing, times, lag)
        for joint, of_gear, of_bearing in zip(changed.joints, *said[:2], strict=True)
    ]
    links = [_link(*each, times["beams"]) for each in zip(changed.links, said[2], strict=True)]
    return replace(changed, joints=joints, links=links)


def true_factor(name: str, robot: RobotModel, plant: RobotModel) -> float | None:
    """How many times what is believed a number of a known plant is; None but for springs and lag."""
    kind, *rest = name.split("_")
    if name == LAG:
        lags = [np.mean([joint.drive_train.motor_lag for joint in each.joints]) for each in (plant, robot)]
        return float(lags[0] / lags[1])
    if kind != STIFFNESS:
        return None
    part, joint, *direction = rest
    place = int(joint) - 1, DIRECTIONS[part].index("".join(direction))
    return _stiffness(plant, part, *place) / _stiffness(robot, part, *place)


def _stiffness(robot: RobotModel, part: str, joint: int, direction: int) -> float:
    if part == "gear":
        return float(robot.joints[joint].drive_train.stiffness)
    sprung = robot.joints[joint].tilting if part == "bearing" else robot.links[joint].beam
    assert sprung is not None
    return float(sprung.stiffness[direction])


def _springs(robot: RobotModel) -> list[str]:
    """Names of all springs that a robot has."""
    parts = [("gear", i) for i, joint in enumerate(robot.joints) if joint.drive_train.stiffness > 0.0]
    parts += [("bearing", i) for i, joint in enumerate(robot.joints) if joint.tilting is not None]
    parts += [("beam", i) for i, link in enumerate(robot.links) if link.beam is not None]
    return [
        "_".join(filter(None, (STIFFNESS, part, str(i + 1), direction)))
        for part, i in parts
        for direction in DIRECTIONS[part]
    ]


def _joint(joint: Joint, of_gear: str, of_bearing: str, times: Mapping[str, float], lag: float) -> Joint:
    train, tilting = joint.drive_train, joint.tilting
    backlash = train.backlash
    if isinstance(backlash, Backlash):
        backlash = replace(backlash, lubricant=times["gears"] * backlash.lubricant)
    train = replace(
        train,
        damping=times["gears"] * train.damping,
        backlash=backlash,
        motor_lag=lag * train.motor_lag,
        source=train.source + of_gear,
    )
    if tilting is not None:
        damping = [times["bearings"] * value for value in tilting.damping]
        tilting = replace(tilting, damping=damping, source=tilting.source + of_bearing)
    return replace(joint, drive_train=train, tilting=tilting)


def _link(link: Link, said: str, time: float) -> Link:
    if link.beam is None:
        return link
    beam: Beam = link.beam
    return replace(
        link, beam=replace(beam, retardation_time=time * beam.retardation_time, source=beam.source + said)
    )


def _said(factors: Mapping[str, float], part: str) -> str:
    """What the source of a part says beyond what it said: by how much its springs were tuned."""
    changes = {
        name.removeprefix(f"{STIFFNESS}_{part}").strip("_"): factor
        for name, factor in factors.items()
        if name == f"{STIFFNESS}_{part}" or name.startswith(f"{STIFFNESS}_{part}_")
    }
    told = ", ".join(f"{f'about {d} ' if d else ''}{factor - 1.0:+.1%}" for d, factor in changes.items())
    return f"; stiffness fine tuned on the robot, {told}" if told else ""
