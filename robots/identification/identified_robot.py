"""What a fit of an elastic arm says of the robot: parameters with their uncertainty, and a robot file."""

import math
from dataclasses import dataclass, replace

import numpy as np

from robots.description import drive_parts
from robots.description.beam import Beam
from robots.description.drive_train import ARC_MINUTE
from robots.description.model import Joint, Link, RobotModel
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_fit import ArmFit
from robots.identification.elastic_parameters import (
    PLAY,
    RIPPLES_PER_TURN,
    ArmNumbers,
    ElasticParameters,
    Spring,
)

# Identifiable is what is known to 3 %, dampers to 25 %, with 95 % probability: relative standard deviations.
STIFFNESS_KNOWN, DAMPING_KNOWN = 0.015, 0.125
# A spring that is found to this goes into the file, though not as known: data sheets rarely have it as well.
_STIFFNESS_WRITTEN = 0.1
_PART_KNOWN = 0.3  # play and hysteresis: these matter less
_RIPPLE_KNOWN = 3.0  # standard deviations that a ripple has to be large


@dataclass(frozen=True)
class FoundParameter:
    """One parameter in the unit of the robot file."""

    name: str
    unit: str
    value: float
    sigma: float
    identifiable: bool
    true: float | None = None  # of a simulated robot


def found_parameters(robot: RobotModel, fit: ArmFit, plant: RobotModel | None = None) -> list[FoundParameter]:
    """Springs, retardation times, play and hysteresis with their standard deviations.

    The retardation time of gears with play is that of damper and lubricant together, which act side by side
    while the teeth touch.

    Args:
        robot: which the fit began with.
        fit: of its unknowns.
        plant: what truly moved, where that is known.
    """
    parameters = fit.parameters
    true = None if plant is None else _True(plant)
    rows = []
    for column, spring in enumerate(parameters.springs):
        start = spring_value(robot, spring)
        relative = float(fit.sigma[column])
        value = start * float(np.exp(fit.values[column]))
        rows.append(
            FoundParameter(
                spring.name,
                "Nm^2" if spring.part == "beam" else "Nm/rad",
                value,
                value * relative,
                relative < STIFFNESS_KNOWN,
                None if plant is None else spring_value(plant, spring),
            )
        )
    rows += _times(fit, true)
    of_springs = gear_spring_sigmas(fit)
    for kind, unit, size in (("play", "rad", PLAY), ("hysteresis", "share", 1.0)):
        for joint, place in enumerate(parameters.of_kind(kind)):
            value, sigma = size * float(fit.values[place]), size * float(fit.sigma[place])
            if kind == "hysteresis":
                # A gear that hardly slips shows spring and hysteresis together, k (1 + h): where that is
                # right, what is wrong with k is made up for by h.
                sigma = math.hypot(sigma, (1.0 + value) * of_springs[joint])
            of_plant = None if true is None else float(getattr(true, kind)[joint])
            name = f"{kind}_gear_{joint + 1}"
            rows.append(FoundParameter(name, unit, value, sigma, sigma < _PART_KNOWN * abs(value), of_plant))
    return rows


def gear_spring_sigmas(fit: ArmFit) -> dict[int, float]:
    """Relative standard deviations of the springs of gears by joint, from 0 on."""
    springs = enumerate(fit.parameters.springs)
    return {spring.joint: float(fit.sigma[k]) for k, spring in springs if spring.part == "gear"}


def _times(fit: ArmFit, true: "_True | None") -> list[FoundParameter]:
    parameters = fit.parameters
    share = parameters.of_kind("lubricant")
    rows = []
    for place in parameters.of_kind("time"):
        group = parameters.names[place].removeprefix("time_")
        with_oil = group.startswith("gear") and len(share) > 0
        gradient = np.zeros(len(parameters))
        gradient[place], factor = 1.0, 1.0
        if with_oil:
            oil = float(np.exp(fit.values[share[0]]))
            factor, gradient[share[0]] = 1.0 + oil, oil / (1.0 + oil)
        value = float(np.exp(fit.values[place])) * factor
        relative = float(np.sqrt(gradient @ fit.covariance @ gradient))
        rows.append(
            FoundParameter(
                f"damping_{group}",
                "s",
                value,
                value * relative,
                relative < DAMPING_KNOWN,
                None if true is None else true.times[group],
            )
        )
    return rows


class _True:
    """What a simulated robot has in place of the unknowns."""

    def __init__(self, plant: RobotModel) -> None:
        parameters = ElasticParameters(ElasticArm(plant, 0.0, []), gear_parts=False)
        trains = [joint.drive_train for joint in plant.joints]
        backlash = [
            part.backlash if isinstance(part.backlash, drive_parts.Backlash) else None for part in trains
        ]
        self.play = np.array([b.arc_minutes * ARC_MINUTE if b else 0.0 for b in backlash])
        self.hysteresis = np.array([sum(t.hysteresis.stiffness) if t.hysteresis else 0.0 for t in trains])
        oil = np.array(
            [b.lubricant / t.stiffness if b else 0.0 for b, t in zip(backlash, trains, strict=True)]
        )
        times = np.exp(parameters.start[parameters.of_kind("time")])
        self.times = {}
        for name, value in zip([parameters.names[i] for i in parameters.of_kind("time")], times, strict=True):
            group = name.removeprefix("time_")
            if group.startswith("gear_"):
                value += oil[int(group.removeprefix("gear_")) - 1]
            self.times[group] = float(value)


def spring_value(robot: RobotModel, spring: Spring) -> float:
    """The stiffness of a robot's file that a spring stands for."""
    if spring.part == "gear":
        return float(robot.joints[spring.joint].drive_train.stiffness)
    if spring.part == "bearing":
        tilting = robot.joints[spring.joint].tilting
        assert tilting is not None
        return float(tilting.stiffness[spring.direction])
    beam = robot.links[spring.joint].beam
    assert beam is not None
    return float(beam.stiffness[spring.direction])


def identified_robot(robot: RobotModel, fit: ArmFit) -> RobotModel:
    """The robot with what was found; springs that the motion hardly shows stay as they were, and say so.

    Raises:
        ValueError: if the parameters make no possible robot.
    """
    parameters, numbers = fit.parameters, fit.parameters.numbers(fit.values)
    factors: dict[str, tuple[float, float]] = {}
    for column, spring in enumerate(parameters.springs):
        relative = float(fit.sigma[column])
        factor = float(np.exp(fit.values[column])) if relative < _STIFFNESS_WRITTEN else 1.0
        factors[spring.name.removeprefix("stiffness_")] = factor, relative
    joints = [_joint(joint, i, factors, numbers, fit) for i, joint in enumerate(robot.joints)]
    links = [_link(link, i, factors, numbers, parameters) for i, link in enumerate(robot.links)]
    return replace(robot, name=f"{robot.name}, identified", joints=joints, links=links)


def _joint(
    joint: Joint, i: int, factors: dict[str, tuple[float, float]], numbers: ArmNumbers, fit: ArmFit
) -> Joint:
    factor, relative = factors[f"gear_{i + 1}"]
    train = joint.drive_train
    stiffness = factor * train.stiffness
    changes: dict = {
        "stiffness": stiffness,
        "damping": float(numbers.time[i]) * stiffness,
        "source": _source("stiffness", relative),
    }
    if fit.parameters.of_kind("play").size:
        lubricant = numbers.lubricant * changes["damping"]
        # Where there is none, a fit that goes on from another may come out a trace below it.
        play, hysteresis = max(0.0, float(numbers.play[i])), max(0.0, float(numbers.hysteresis[i]))
        changes["backlash"] = drive_parts.Backlash(play / ARC_MINUTE, lubricant)
        changes["hysteresis"] = drive_parts.Dahl([hysteresis], [numbers.width])
        changes["ratio_error"] = _ripple(i, numbers, fit) or train.ratio_error
    tilting = joint.tilting
    if tilting is not None:
        time = _group_time(numbers, fit.parameters, f"bearing_{i + 1}_a")
        found = [factors[f"bearing_{i + 1}_{side}"] for side in "ab"]
        springs = [f * value for (f, _), value in zip(found, tilting.stiffness, strict=True)]
        source = "; ".join(
            _source(f"about {side}", sigma) for side, (_, sigma) in zip("ab", found, strict=True)
        )
        damping = [time * value for value in springs]
        tilting = replace(tilting, stiffness=springs, damping=damping, source=source)
    return replace(joint, drive_train=replace(train, **changes), tilting=tilting)


def _ripple(i: int, numbers: ArmNumbers, fit: ArmFit) -> drive_parts.FourierRatio | None:
    if i not in fit.parameters.turning:
        return None
    places = fit.parameters.of_kind("ripple").reshape(2, -1)[:, fit.parameters.turning.index(i)]
    size, sigma = np.linalg.norm(fit.values[places]), fit.sigma[places].max()
    if size < _RIPPLE_KNOWN * sigma:
        return None
    sine, cosine = numbers.ripple[:, i]
    return drive_parts.FourierRatio(
        [float(np.hypot(sine, cosine))], [RIPPLES_PER_TURN], [float(np.rad2deg(np.arctan2(cosine, sine)))]
    )


def _link(
    link: Link,
    i: int,
    factors: dict[str, tuple[float, float]],
    numbers: ArmNumbers,
    parameters: ElasticParameters,
) -> Link:
    if link.beam is None:
        return link
    found = [factors[f"beam_{i + 1}_{axis}"] for axis in "xyz"]
    stiffness = link.beam.stiffness * np.array([factor for factor, _ in found])
    time = _group_time(numbers, parameters, f"beam_{i + 1}_x")
    source = "; ".join(_source(f"about {axis}", sigma) for axis, (_, sigma) in zip("xyz", found, strict=True))
    beam: Beam = replace(link.beam, stiffness=stiffness, retardation_time=time, source=source)
    return replace(link, beam=beam)


def _group_time(numbers: ArmNumbers, parameters: ElasticParameters, spring: str) -> float:
    column = [each.name for each in parameters.springs].index(f"stiffness_{spring}")
    return float(numbers.time[parameters.springs[column].rows[0]])


def _source(what: str, relative: float) -> str:
    if relative < _STIFFNESS_WRITTEN:
        return f"{what} identified from motion, standard deviation {100.0 * relative:.2g} %"
    return f"{what} hardly shown by the motion, as before"
