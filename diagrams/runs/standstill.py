"""A robot that its guard holds at rest: since when, and why."""

from pydrake.systems.framework import Context

from diagrams.servo import Servo
from systems.guard.guard import KINDS

_STOPPED, _NO_COMMAND = KINDS.index("stopped"), KINDS.index("no_command")


class Standstill:
    """Looks at a servo's guard after every tick."""

    def __init__(self, servo: Servo) -> None:
        """Has seen no tick."""
        self._servo = servo
        self._stopped = 0.0  # ticks of the guard, until the last tick
        self._seen = 0.0  # s of the path, what the camera had shown by then
        self.since: float | None = None  # s, if the guard holds the robot at rest

    def lasts(self, root_context: Context, time: float, last_exposure: float) -> float:
        """How long it has lasted.

        Args:
            root_context: of the servo's diagram, after a tick.
            time: of the tick, s.
            last_exposure: of what the camera has shown last, s of the path.
        """
        stopped = float(self._status(root_context)[_STOPPED])
        if stopped == self._stopped:
            self.since = None
            return 0.0
        self._stopped = stopped
        if self.since is None:
            self.since, self._seen = time, max(last_exposure, 0.0)
        return time - self.since

    def reason(self, root_context: Context) -> str:
        """In words, when it began and why."""
        is_blind = self._servo.traits.uses_camera and not self._status(root_context)[_NO_COMMAND]
        why = (
            f"the camera has shown nothing usable since {self._seen:.1f} s"
            if is_blind
            else "the law had no command"
        )
        return f"stopped by the guard at {self.since or 0.0:.1f} s: {why}"

    def _status(self, root_context: Context):
        context = self._servo.GetMyContextFromRoot(root_context)
        return self._servo.GetOutputPort("guard_status").Eval(context)
