"""The system that finds people in whole images: background, hull and tracks from sample to sample."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, State

from robots.description.model import NUM_JOINTS
from systems.sampled_system import SampledSystem
from systems.samples import ImageSample, JointSample, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.lasting_changes import LastingChange
from systems.vision.people.people_detector import PeopleDetector
from systems.vision.people.people_follower import Mind, PeopleFollower
from systems.vision.people.person_tracks import TrackConfig

_KEPT = 64  # joint samples, the newest first, for the one at an exposure
_WIDTH = 1 + NUM_JOINTS  # time and positions


class PeopleWatcher(SampledSystem):
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
        period: float,
        latency: float,
        joint_period: float,
        tracks: TrackConfig | None = None,
        lasting: float = np.inf,
    ) -> None:
        """Makes the system.

        Args:
            detector: what finds bodies.
            memory: of the empty cell.
            period: between two sets of images in s.
            latency: from exposure to result in s: transport and computation.
            joint_period: between two joint samples in s.
            tracks: how people are followed.
            lasting: s at one place, after which a body is a change of the cell.

        Raises:
            ValueError: if a time is not positive.
        """
        super().__init__()
        for name, value in (("period", period), ("latency", latency), ("joint_period", joint_period)):
            if not 0.0 < value < np.inf:
                raise ValueError(f"people watcher: {name} must be positive, got {value} s")
        self._follower = PeopleFollower(detector, tracks or TrackConfig(), lasting)
        self._joint_period = joint_period
        self._images = self.DeclareAbstractInputPort("image_sample", Value[object](ImageSample()))
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._kept = self.DeclareDiscreteState(np.tile([-np.inf, *np.zeros(NUM_JOINTS)], _KEPT))
        self._state = self.DeclareAbstractState(Value[object](Mind(memory)))
        self.DeclareAbstractOutputPort(
            "person_sample",
            lambda: Value[object](PersonSample()),
            lambda context, output: output.set_value(self._mind(context).sample),
            {self.abstract_state_ticket(self._state)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(joint_period, 0.0, self._keep_joints)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, latency, self._work)

    def changes(self, context: Context) -> tuple[LastingChange, ...]:
        """What is new in the cell and has stayed, as of the newest images."""
        return self._mind(context).changes

    def _mind(self, context: Context) -> Mind:
        return context.get_abstract_state(int(self._state)).get_value()

    def _keep_joints(self, context: Context, discrete_state: DiscreteValues) -> None:
        kept, sample = discrete_state.get_mutable_value(self._kept), self._joints.Eval(context)
        if sample.time > kept[0]:
            kept[_WIDTH:] = kept[:-_WIDTH].copy()
            kept[:_WIDTH] = sample.time, *sample.position

    def _work(self, context: Context, state: State) -> None:
        mind, images = self._mind(context), self._images.Eval(context)
        joints = context.get_discrete_state(self._kept).value().reshape(-1, _WIDTH)
        nearest = joints[np.argmin(np.abs(joints[:, 0] - images.time))]
        is_known = abs(nearest[0] - images.time) <= 1.5 * self._joint_period
        if not (images.time > mind.sample.time and is_known):
            return
        after = self._follower.after(mind, images, nearest[1:])
        state.get_mutable_abstract_state(int(self._state)).set_value(after)
