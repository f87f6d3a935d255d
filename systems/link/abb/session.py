"""The session of EGM: its messages behind the rules that hold for every guided robot."""

from dataclasses import replace

import numpy as np

from systems.link.abb.messages import Command, Mode, RobotReport, decode_report, encode_command
from systems.link.session import LinkSession

_Asked = tuple[Mode, Command]


class EgmCodec:
    """Fits `systems.link.session.Codec`; a command is a mode and what it carries.

    After a collision no report is one of a robot that follows, whatever the controller says later: nothing
    goes on by itself from where a robot has hit something.
    """

    def __init__(self) -> None:
        self.has_collided = False
        self.overloaded = 0  # reports of a robot that needs more than all of its performance

    def decode(self, data: bytes) -> RobotReport:
        """See `decode_report`."""
        report = decode_report(data)
        self.has_collided |= report.has_collided
        self.overloaded += report.utilization > 1.0
        return replace(report, egm_running=False) if self.has_collided else report

    def encode(self, command: _Asked, report: RobotReport, number: int, now: float) -> bytes:
        """See `encode_command`; EGM does not say which report a command answers."""
        return encode_command(*command, number, now)

    def at(self, report: RobotReport) -> _Asked:
        """To stay at the position of a report, or to run a path uncorrected."""
        at_rest = Command(report.position, np.zeros_like(report.position), path_correction=np.zeros(3))
        return Mode.JOINT_SPEED, at_rest

    def standing(self, safe: _Asked, asked: _Asked) -> _Asked:
        """To hold the position of another command, in the mode that is asked for."""
        _, command = safe
        return asked[0], replace(
            command,
            velocity=None if command.velocity is None else np.zeros_like(command.velocity),
            pose_velocity=None if command.pose_velocity is None else np.zeros_like(command.pose_velocity),
        )


class EgmSession(LinkSession[RobotReport]):
    """Validates every datagram of EGM and decides on every reply. Times are on one monotonic clock, in s."""

    def __init__(
        self,
        largest_speed: np.ndarray,
        break_after: float = 0.1,
        host: str | None = None,
        period: float = 4e-3,
    ) -> None:
        """Prepares for the first message; arguments and errors as of `LinkSession`."""
        self.egm = EgmCodec()
        super().__init__(self.egm, largest_speed, break_after, host, period)

    def reply(self, mode: Mode, command: Command, now: float) -> bytes | None:
        """See `answer`."""
        return self.answer((mode, command), now)

    def stop(self, mode: Mode, command: Command, now: float) -> bytes | None:
        """See `answer_stopping`."""
        return self.answer_stopping((mode, command), now)
