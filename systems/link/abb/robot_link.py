"""A controller under EGM with its test signals, as any robot's link."""

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.link.abb.client import EgmClient
from systems.link.abb.messages import Command, Mode, RobotReport
from systems.link.abb.signal_client import SignalClient
from systems.link.guided import GuidedRobot
from systems.link.session import Link

_COLLISION = "the controller reports a collision"
_SIGNAL_AGE = 0.1  # s, beyond which signals and earlier messages say nothing of the present motion


class AbbRobotLink(GuidedRobot[RobotReport]):
    """Fits `systems.link.protocols.RobotLink`."""

    def __init__(self, client: EgmClient, signals: SignalClient | None = None) -> None:
        """Takes over sockets that are open; signals of None where the controller sends none."""
        super().__init__(client)
        self._client: EgmClient = client
        self._signals = signals
        self._last: RobotReport | None = None
        self.velocity = self.effort = np.zeros(NUM_JOINTS)

    @property
    def ports(self) -> tuple[int, int]:
        """Where reports and test signals come in; 0 for no signals."""
        return self._client.channel.address[1], self._signals.channel.address[1] if self._signals else 0

    @property
    def utilization(self) -> float:
        """How much of its performance the robot needs, by the newest report."""
        return self._last.utilization if self._last is not None else 0.0

    @property
    def trouble(self) -> str:
        """Why the newest messages are refused, or that the robot has hit something; else empty."""
        return _COLLISION if self._client.session.egm.has_collided else super().trouble

    def counters(self) -> dict[str, int]:
        """What has come and gone, by name; `overloaded` reports need more than all of the performance."""
        return {**super().counters(), "overloaded": self._client.session.egm.overloaded}

    def why_not_ready(self) -> str:
        """What keeps the robot from following commands."""
        if self._client.session.link is Link.WAITING:
            return self._unheard("no message of a controller came in")
        if self._client.session.egm.has_collided:
            return _COLLISION
        return "the controller does not run EGM"

    def poll(self, timeout: float = 0.0) -> RobotReport | None:
        """The newest report that has come, waiting for at most ``timeout`` in s."""
        report = self._client.poll(timeout)
        if report is not None:
            last, self._last = self._last, report
            self._note_motion(last, report)
        return report

    def poll_aside(self) -> None:
        """Takes in test signals."""
        if self._signals is not None:
            self._signals.poll()

    def send(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """Answers the newest report with positions (rad) and speeds (rad/s), or speeds alone."""
        return self._client.reply(_mode(is_speed_only), Command(position=position, velocity=velocity))

    def correct(self, shift_P: np.ndarray) -> bool:
        """Answers the newest report with a path correction (3,) in m, in the frame of the path."""
        return self._client.reply(Mode.PATH_CORRECTION, Command(path_correction=shift_P))

    def stop(self, position: np.ndarray, velocity: np.ndarray, is_speed_only: bool = False) -> bool:
        """Answers the newest message on the way to rest, also one that was refused."""
        return self._client.stop(_mode(is_speed_only), Command(position=position, velocity=velocity))

    def _note_motion(self, last: RobotReport | None, report: RobotReport) -> None:
        """Speeds and torques: from test signals if there are new ones, else from the messages themselves."""
        newest = self._signals.newest if self._signals else None
        is_new = newest is not None and not newest.time < report.time - _SIGNAL_AGE
        if newest is not None and is_new and newest.velocity is not None:
            self.velocity = newest.velocity
        elif last is not None and 0.0 < report.time - last.time < _SIGNAL_AGE:
            self.velocity = (report.position - last.position) / (report.time - last.time)
        else:
            self.velocity = np.zeros(NUM_JOINTS)
        if newest is not None and is_new and newest.torque is not None:
            self.effort = newest.torque
        else:
            torques = list(report.message.torqueRef.joints)
            self.effort = np.array(torques) if len(torques) == NUM_JOINTS else np.zeros(NUM_JOINTS)


def _mode(is_speed_only: bool) -> Mode:
    return Mode.JOINT_SPEED_ONLY if is_speed_only else Mode.JOINT_SPEED
