"""The system that finds people in whole images: background, hull and tracks from sample to sample."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem, State

from systems.samples import ImageSample, JointSample, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.people_detector import PeopleDetector
from systems.vision.people.person_tracks import Track, TrackConfig, followed

_KEPT = 64  # joint samples, for the one at an exposure


@dataclass(frozen=True)
class _Mind:
    """What the watcher remembers."""

    memory: Memory
    joints: tuple[JointSample, ...] = ()  # the newest last
    tracks: tuple[Track, ...] = ()
    next_number: int = 1
    sample: PersonSample = field(default_factory=PersonSample)

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Mind":
        """Itself, for nothing in it changes."""
        return self


class PeopleWatcher(LeafSystem):
    """Finds people in sets of images. An aid, not a safety function.

    Ports:
        in  ``image_sample``   ImageSample
        in  ``joint_sample``   JointSample
        out ``person_sample``  PersonSample, of the newest images, from when they have been worked on

    Images without joints near their exposure are not used: what the robot is could not be told.
    """

    def __init__(
        self,
        detector: PeopleDetector,
        memory: Memory,
        edge: float,
        period: float,
        latency: float,
        joint_period: float,
        tracks: TrackConfig | None = None,
    ) -> None:
        """Makes the system.

        Args:
            detector: what finds bodies.
            memory: of the empty cell.
            edge: of the cubes of the detector in m.
            period: between two sets of images in s.
            latency: from exposure to result in s: transport and computation.
            joint_period: between two joint samples in s.
            tracks: how people are followed.

        Raises:
            ValueError: if a time is not positive.
        """
        super().__init__()
        for name, value in (("period", period), ("latency", latency), ("joint_period", joint_period)):
            if not 0.0 < value < np.inf:
                raise ValueError(f"people watcher: {name} must be positive, got {value} s")
        self._detector, self._edge = detector, edge
        self._tracks, self._joint_period = tracks or TrackConfig(), joint_period
        self._images = self.DeclareAbstractInputPort("image_sample", Value[object](ImageSample()))
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._state = self.DeclareAbstractState(Value[object](_Mind(memory)))
        self.DeclareAbstractOutputPort(
            "person_sample",
            lambda: Value[object](PersonSample()),
            lambda context, output: output.set_value(self._mind(context).sample),
            {self.abstract_state_ticket(self._state)},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(joint_period, 0.0, self._keep_joints)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, latency, self._work)

    def _mind(self, context: Context) -> _Mind:
        return context.get_abstract_state(int(self._state)).get_value()

    def _keep_joints(self, context: Context, state: State) -> None:
        mind, sample = self._mind(context), self._joints.Eval(context)
        if not mind.joints or sample.time > mind.joints[-1].time:
            state.get_mutable_abstract_state(int(self._state)).set_value(
                _Mind(
                    mind.memory, (*mind.joints, sample)[-_KEPT:], mind.tracks, mind.next_number, mind.sample
                )
            )

    def _work(self, context: Context, state: State) -> None:
        mind, images = self._mind(context), self._images.Eval(context)
        if not images.time > mind.sample.time or not mind.joints:
            return
        nearest = min(mind.joints, key=lambda each: abs(each.time - images.time))
        if abs(nearest.time - images.time) > 1.5 * self._joint_period:
            return
        seen, memory = self._detector.detect(mind.memory, images.images, nearest.position)
        tracks, people, number = followed(
            mind.tracks, mind.next_number, images.time, seen.bodies, self._edge, self._tracks
        )
        sample = PersonSample(images.time, seen.trusted, people)
        state.get_mutable_abstract_state(int(self._state)).set_value(
            _Mind(memory, mind.joints, tracks, number, sample)
        )
