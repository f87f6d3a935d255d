"""The next command of the self-calibrating law, worked out before the message is there that asks for it."""

from types import SimpleNamespace

import numpy as np

from systems.estimation.memory import Layout
from systems.reference.reference import PathAhead
from systems.servo.self_calibrating_learning import PLAN


def _renewed(memory: SimpleNamespace) -> list[np.ndarray]:
    """What working out a command renews, apart from the command."""
    drives, delay = memory.drives, memory.delay
    return [
        memory.lead.all,
        memory.planner.all,
        memory.columns.ravel(),
        memory.planned,
        drives.started,
        drives.z.ravel(),
        drives.w.ravel(),
        drives.correction,
        delay.delay,
        delay.rate,
        delay.settled,
    ]


class NextCommand:
    """Where the command of a tick lies, and whether it is that of the next one already.

    A command depends on what was learnt and on the path, but not on what the message of its tick says, unless
    the robot does not run. So it can be there when the message comes. If it turns out to be for another time,
    or the path's time has changed, what working it out has renewed is taken back.
    """

    def __init__(self, memory: Layout) -> None:
        """Lays out the memory, a part of the law's, which is given without it."""
        whole = memory.view(np.zeros(memory.size))
        self._ends = np.cumsum([part.size for part in _renewed(whole)])
        self.layout = Layout(
            is_ready=(1,),
            time=(1,),  # of its tick, s
            path_time=(1,),  # of the instant that it is for, s
            begins_path=(1,),  # whether the path begins at this instant
            commands=(3, 6),  # position, velocity, torque
            row=PLAN,
            before=(int(self._ends[-1]),),
        )

    def keep(self, memory: SimpleNamespace) -> None:
        """Remembers how things are before the next command is worked out."""
        np.concatenate(_renewed(memory), out=memory.next.before)

    def is_for(self, memory: SimpleNamespace, time: float, reference: PathAhead) -> bool:
        """Whether the command is there, for a tick at this time in s and the path as it is timed now."""
        coming = memory.next
        if not coming.is_ready[0] or coming.time[0] != time:
            return False
        return reference.path_time(float(memory.planned[0])) == coming.path_time[0]

    def take_back(self, memory: SimpleNamespace) -> None:
        """Forgets the command if there is one."""
        if not memory.next.is_ready[0]:
            return
        memory.next.is_ready[0] = 0.0
        start = 0
        for part, end in zip(_renewed(memory), self._ends, strict=True):
            part[:] = memory.next.before[start:end]
            start = end
