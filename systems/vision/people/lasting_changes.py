"""What is new in the cell and stays: a box that was left, a fence that was moved, a person who stands still.

A body that fills the same place from set to set, for longer than people usually stand, is a change of the
cell. It is reported with its place and size, and still counts as somebody: its hull does not tell what it is.
"""

from dataclasses import dataclass

import numpy as np

from systems.vision.people.visual_hull import Body

_OVERLAP = 0.5  # of cubes in common to cubes in either, from which it is the same body at the same place


@dataclass(frozen=True)
class Standing:
    """A body and since when it has been where it is."""

    since: float  # s
    body: Body

    @property
    def place(self) -> np.ndarray:
        """Of its middle in the world in m, (3,)."""
        return self.body.points.mean(axis=0)

    def size(self, edge: float) -> np.ndarray:
        """Of the box about its cubes, which have an edge in m, along x, y and z in m, (3,)."""
        return np.ptp(self.body.points, axis=0) + edge


def standing_still(
    before: tuple[Standing, ...], time: float, bodies: list[Body], edge: float
) -> tuple[Standing, ...]:
    """Bodies of a set of images, each with the time since which it has not moved.

    Args:
        before: those of the set before.
        time: of the images in s.
        bodies: in them.
        edge: of their cubes in m.
    """
    known = [(each.since, _cubes(each.body, edge)) for each in before]
    found = []
    for body in bodies:
        cubes = _cubes(body, edge)
        since = [at for at, others in known if _are_the_same(cubes, others)]
        found.append(Standing(min(since, default=time), body))
    return tuple(found)


@dataclass(frozen=True)
class LastingChange:
    """A change of the cell, and the images in which it was known to stay."""

    known: float  # s
    standing: Standing
    images: np.ndarray  # (n, h, w, 3) of uint8


def lasting_changes(
    before: tuple[LastingChange, ...],
    standing: tuple[Standing, ...],
    time: float,
    images: np.ndarray,
    after: float,
    edge: float,
) -> tuple[LastingChange, ...]:
    """Those known before, and bodies that by now have stood still for a time ``after`` in s.

    Args:
        before: known so far; the same body at the same place is not reported twice.
        standing: bodies of a set of images.
        time: of the images in s.
        images: (n, h, w, 3) of uint8.
        after: s.
        edge: of the cubes of the bodies in m.
    """
    places = [_cubes(each.standing.body, edge) for each in before]
    found = list(before)
    for each in standing:
        cubes = _cubes(each.body, edge)
        is_known = any(_are_the_same(cubes, others) for others in places)
        if time - each.since >= after and not is_known:
            found.append(LastingChange(time, each, images))
    return tuple(found)


def _are_the_same(one: set[tuple[int, ...]], other: set[tuple[int, ...]]) -> bool:
    return len(one & other) >= _OVERLAP * len(one | other)


def _cubes(body: Body, edge: float) -> set[tuple[int, ...]]:
    return set(map(tuple, np.floor(body.points / edge).astype(int).tolist()))
