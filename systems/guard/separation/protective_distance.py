"""The protective separation distance of ISO/TS 15066:2016, section 5.5.4, with every term by its name.

S_p = S_h + S_r + S_s + C + Z_d + Z_r: the way of the person until the robot has stopped, the way of the robot
until it begins to stop and while it stops, how far a body reaches before it is seen, and how wrong the places
of person and robot may be. The formulas are those for constant speeds.
"""

from dataclasses import dataclass, fields

import numpy as np

from robots.configuration.quantity import quantity


@dataclass
class SeparationConfig:
    """How far from people the robot stays; read from a scenario file."""

    human_speed: float = quantity(1.6, 0.0, 10.0, "m/s")  # v_h of ISO 13855 for walking; more if seen faster
    intrusion: float = quantity(0.12, 0.0, 2.0, "m")  # C, of limbs thinner than is seen; assumed
    person_error: float = quantity(0.1, 0.0, 2.0, "m")  # Z_d, `truetip watch --study` prints the largest
    robot_error: float = quantity(0.01, 0.0, 1.0, "m")  # Z_r, of the tip and of the joints at an exposure
    period: float = quantity(0.02, 1e-3, 1.0, "s")  # between two decisions
    slow_after: float = quantity(0.25, 0.0, 10.0, "s")  # age of the newest trusted images from which it slows
    stop_after: float = quantity(0.6, 0.0, 10.0, "s")  # and at which it stops
    rise: float = quantity(0.5, 0.0, 100.0, "1/s", is_open=True)  # of the share of the speed, at most
    clearance: float = quantity(0.1, 0.0, 2.0, "m")  # beyond the stop distance, before it goes on
    acknowledge: bool = True  # whether somebody has to say that the robot may go on after a stop


@dataclass(frozen=True)
class ReactionTime:
    """The parts of T_r of a chain in s: each is a number of its own in the diagram."""

    images: float  # between two sets of images: who enters just after one waits for the next
    transport: float  # from exposure to arrival
    computation: float  # until people are known
    decision: float  # between two decisions
    command: float  # from a decision until the drives begin to brake

    @property
    def total(self) -> float:
        """T_r in s."""
        return sum(getattr(self, each.name) for each in fields(self))


@dataclass(frozen=True)
class ProtectiveDistance:
    """The terms in m."""

    human: float  # S_h = v_h (T_r + T_s)
    reaction: float  # S_r = v_r T_r
    stopping: float  # S_s = v_r T_s / 2, for the deceleration is as a step that is alike on both sides
    intrusion: float  # C
    person_error: float  # Z_d
    robot_error: float  # Z_r

    @property
    def total(self) -> float:
        """S_p in m."""
        return sum(getattr(self, each.name) for each in fields(self))

    @property
    def at_rest(self) -> float:
        """What remains where the robot hardly moves, in m."""
        return self.total - self.reaction - self.stopping


def protective_distance(
    config: SeparationConfig, reaction: ReactionTime, robot_speed: float, stop_time: float, human_speed: float
) -> ProtectiveDistance:
    """The terms for speeds in m/s and a time from motion to rest in s."""
    return ProtectiveDistance(
        human=human_speed * (reaction.total + stop_time),
        reaction=robot_speed * reaction.total,
        stopping=0.5 * robot_speed * stop_time,
        intrusion=config.intrusion,
        person_error=config.person_error,
        robot_error=config.robot_error,
    )


def stopping_time(planned: float, velocity: np.ndarray, acceleration: np.ndarray) -> float:
    """T_s in s: as planned, or longer where joints cannot brake so hard; (6,) in rad/s and rad/s^2."""
    return max(planned, float((np.abs(velocity) / acceleration).max()))


def largest_share(distance: float, terms: ProtectiveDistance) -> float:
    """The largest share of the speed, 0 to 1, at which a distance in m suffices.

    The terms of ``terms`` that belong to the robot's speed shrink with the share, the others stay: a robot
    that goes slower needs no shorter time to stop.
    """
    moving = terms.reaction + terms.stopping
    if moving <= 0.0:
        return 1.0 if distance >= terms.at_rest else 0.0
    return float(np.clip((distance - terms.at_rest) / moving, 0.0, 1.0))
