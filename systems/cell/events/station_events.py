"""What happens to a station while it works: loads, knocks, delays and losses, each at its time.

In a scenario each is a tagged entry of ``station.events``, as ``!PayloadChange {at: 8.0, payload: 7.0}``.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from robots.configuration.quantity import numbers, positive, quantity, vector
from robots.description.model import NUM_JOINTS

_Kind = TypeVar("_Kind")
_EPSILON = 1e-9  # s, by which sums of times are not exact


@dataclass
class PayloadChange:
    """A load is picked up or put down; neither drives nor controller are told."""

    at: float = positive(0.0, "s")
    payload: float = quantity(0.0, 0.0, 1000.0, "kg")  # at the flange from then on
    # Three, in the flange frame; empty: as the robot has it
    centre_mm: list[float] = numbers((), (0, 3), unit="mm")


@dataclass
class ToolShift:
    """The tool is knocked out of its place, by which the true tip is another point of the robot."""

    at: float = positive(0.0, "s")
    shift_mm: np.ndarray = vector((0.0, 0.0, 0.0), unit="mm")  # along the axes of the tool
    turn_deg: np.ndarray = vector((0.0, 0.0, 0.0), unit="deg")  # rotation vector in the frame of the tool


@dataclass
class CameraShift:
    """The camera system is moved in the world, so that all that it sees is displaced the other way."""

    at: float = positive(0.0, "s")
    shift_mm: np.ndarray = vector((0.0, 0.0, 0.0), unit="mm")  # along the axes of the world
    turn_deg: np.ndarray = vector(
        (0.0, 0.0, 0.0), unit="deg"
    )  # rotation vector, about the origin of the world


@dataclass
class JointZeroShift:
    """Links slip against the encoders of their joints."""

    at: float = positive(0.0, "s")
    # Six, by which the true angles then exceed the measured ones
    shift_deg: np.ndarray = vector((0.0,) * NUM_JOINTS, unit="deg")


@dataclass
class DeadTimeChange:
    """The interface becomes slower or faster; the dead time changes evenly over a while."""

    at: float = positive(0.0, "s")
    dead_time: float = quantity(0.0, 0.0, 1.0, "s")  # from then on in place of station.drive.dead_time
    over: float = positive(0.1, "s")  # that it takes; longer than the change of the dead time


@dataclass
class CameraLoss:
    """The camera sees nothing for a while."""

    at: float = positive(0.0, "s")
    duration: float = positive(0.5, "s")


StationEvent = PayloadChange | ToolShift | CameraShift | JointZeroShift | DeadTimeChange | CameraLoss


def of_kind(events: Iterable[StationEvent], *kinds: type[_Kind]) -> list[_Kind]:
    """The events of some kinds in the order of their times."""
    return sorted((event for event in events if isinstance(event, kinds)), key=lambda event: event.at)  # type: ignore[attr-defined]


def check_events(events: Sequence[StationEvent], end: float, dead_time: float = 0.0) -> None:
    """Refuses what cannot happen.

    Args:
        events: of a station.
        end: of the run in s.
        dead_time: before the first event, in s.

    Raises:
        ValueError: if an event is not within the run, or a number of it is impossible; one line.
    """
    for number, event in enumerate(events):
        where = f"station.events[{number}] ({type(event).__name__})"
        if not 0.0 < event.at < end:
            raise ValueError(
                f"{where}: at must be after 0 and before the end of the run at {end:.4g} s, got {event.at} s"
            )
        for label, size in (("shift_mm", 3), ("turn_deg", 3), ("shift_deg", NUM_JOINTS)):
            value = np.asarray(getattr(event, label, np.zeros(size)), dtype=float)
            if value.shape != (size,) or not np.isfinite(value).all():
                raise ValueError(f"{where}: {label} must be {size} finite numbers, got {value.tolist()}")
        if isinstance(event, PayloadChange):
            if not 0.0 <= event.payload < np.inf:
                raise ValueError(f"{where}: payload must not be negative, got {event.payload} kg")
            if len(event.centre_mm) not in (0, 3):
                raise ValueError(f"{where}: centre_mm must be three numbers, got {event.centre_mm}")
        if isinstance(event, CameraLoss) and not 0.0 < event.duration < np.inf:
            raise ValueError(f"{where}: duration must be positive, got {event.duration} s")
    ready = 0.0
    for event in of_kind(events, DeadTimeChange):
        if not 0.0 <= event.dead_time <= 1.0:
            raise ValueError(
                f"dead time change: dead_time must be between 0 and 1 s, got {event.dead_time} s"
            )
        if not event.over > abs(event.dead_time - dead_time):
            raise ValueError(
                f"dead time change at {event.at} s: over must be longer than the change of "
                f"{abs(event.dead_time - dead_time):.4g} s, got {event.over} s"
            )
        if event.at < ready:
            raise ValueError(f"dead time change at {event.at} s: the one before ends at {ready:.4g} s")
        dead_time, ready = event.dead_time, event.at + event.over


def camera_losses(events: Iterable[StationEvent]) -> list[list[float]]:
    """Windows [start, end) in s in which the camera sees nothing; an exposure at an end is not in it."""
    losses = of_kind(events, CameraLoss)
    return [[event.at - _EPSILON, event.at + event.duration - _EPSILON] for event in losses]
