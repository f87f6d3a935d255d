"""A robot whose controller says that it follows commands, and whose joints stand while these move."""

import math

import numpy as np

from robots.description.model import NUM_JOINTS

_STILL = math.radians(0.02)  # a joint that has been told anything moves by more, noise of an encoder by less
_SENT = math.radians(0.5)  # far beyond what friction or soft drives keep from a joint
_PATIENCE = 0.5  # s, far longer than a command is on its way


class Following:
    """Compares the joints with what they are told, each for itself.

    Only changes count: where a robot sags or lags, or stands where it was not sent, it still moves along.
    """

    def __init__(self, is_speed_only: bool) -> None:
        """``is_speed_only`` says that speeds are sent without positions."""
        self._is_speed_only = is_speed_only
        self.restart()

    def restart(self) -> None:
        """Forgets everything: commands begin anew from where the robot is."""
        self.problem = ""  # that the robot does not follow, in words
        self._told = np.zeros(NUM_JOINTS)  # rad, the newest
        self._measured = np.full(NUM_JOINTS, np.nan)  # rad, where each joint has stood since it last moved
        self._told_there = np.zeros(NUM_JOINTS)  # rad, what it was told then
        self._for = np.zeros(NUM_JOINTS)  # s that it has been told to be elsewhere

    def note(self, measured: np.ndarray, position: np.ndarray, velocity: np.ndarray, passed: float) -> None:
        """Takes a report of the joints in rad and the answer to it in rad and rad/s, all of shape (6,).

        Args:
            measured: of the report.
            position: of the command.
            velocity: of the command.
            passed: s since the report before.
        """
        self._told = self._told + passed * velocity if self._is_speed_only else position
        moves = ~(np.abs(measured - self._measured) <= _STILL)  # or is unknown
        self._measured = np.where(moves, measured, self._measured)
        self._told_there = np.where(moves, self._told, self._told_there)
        sent = np.abs(self._told - self._told_there)
        self._for = np.where(sent > _SENT, self._for + passed, 0.0)
        worst = int(np.argmax(self._for))
        if self._for[worst] > _PATIENCE:
            self.problem = (
                f"the robot does not follow: joint {worst + 1} stands still and is told to be "
                f"{math.degrees(sent[worst]):.1f} degrees further, for {_PATIENCE:g} s now; does the program "
                "of its controller take commands, and is nothing in its way?"
            )
