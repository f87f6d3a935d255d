"""The next tick of a servo, done before the message comes that asks for it."""

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.hardware import HardwareStation
from systems.samples import JointSample, PoseSample

Command = tuple[np.ndarray, np.ndarray]  # position and velocity, (6,) each in rad and rad/s


class TickAhead:
    """The next tick, for laws that need not wait for the joints in the next message.

    All that such a law and its guard need of a message at their tick is whether the robot still runs. The
    rest comes from the path, from the camera and from what they remember. So the command can be there when
    the message comes. If that is as it was expected, the tick is done; else it is forgotten, and done again.
    """

    def __init__(self, diagram: Diagram, station: HardwareStation) -> None:
        """Has done nothing. ``station`` is the one in the diagram."""
        self._diagram, self._station = diagram, station
        self._after = diagram.CreateDefaultContext()
        self._command: Command | None = None
        self._time, self._sample = 0.0, PoseSample()

    def rehearse(self, context: Context) -> Command:
        """Does the next tick with the samples of the last one, and forgets it; returns its command.

        What it needs is then in the caches of the processor, and what depends on time alone in those of the
        context.

        Args:
            context: of the diagram, which stands before the tick.
        """
        self._command = None
        self._after.SetTime(context.get_time())
        self._after.SetDiscreteState(self._diagram.EvalUniquePeriodicDiscreteUpdate(context))
        return self._station.command(self._after)

    def work_out(self, context: Context, joints: JointSample, sample: PoseSample) -> None:
        """Does the next tick.

        Args:
            context: of the diagram, which stands before the tick and gets these samples.
            joints: of the tick before, at which the robot ran.
            sample: of the camera, if it shows nothing new until the message comes.
        """
        for of in (context, self._after):
            self._station.receive(of, joints, sample)
        self._command, self._time, self._sample = self.rehearse(context), context.get_time(), sample

    def command(self, time: float, sample: PoseSample) -> Command | None:
        """What to command at a tick; None if what has been done is another one.

        Args:
            time: of the tick, s.
            sample: the newest of the camera, at this tick.
        """
        return self._command if time == self._time and sample is self._sample else None

    def take_over(self, before: Context) -> Context:
        """The context after the tick, in exchange for the one before it."""
        after, self._after, self._command = self._after, before, None
        return after
