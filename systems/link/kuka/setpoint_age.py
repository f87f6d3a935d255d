"""How old the set-points of telegrams are, and whether they contain corrections at all, found from them."""

import numpy as np

_MOST = 10  # replies before a telegram that a set-point may not contain
_KEPT = 0.9  # of what is known, from one telegram to the next: ten of them count
_CLEARLY = 4.0  # times the smallest sum of squares: another age explains the set-points much worse
_SEEN = np.deg2rad(2e-3)  # difference between two ages, above what telegrams resolve
_ENOUGH = np.deg2rad(0.3)  # of corrections of an axis, of which a set-point must have followed some
_FOLLOWED = 0.1  # of them


class SetpointAge:
    """Compares what set-points change by with what was answered before.

    A correction is worked out from a set-point and from what it does not contain yet. With one reply too many
    or too few in that sum the corrections swing from telegram to telegram, ever wider; so the number that is
    configured is a first guess only. Even steps say nothing of it, but such a swing shows it at once.
    """

    def __init__(self, behind: int) -> None:
        """Begins with ``behind`` replies that a set-point does not contain, 0 to 10."""
        self.behind = behind
        self.is_followed = True  # whether set-points have changed with what was answered
        self._squares = np.zeros(_MOST + 1)  # rad^2, of what each age leaves
        self._setpoint: np.ndarray | None = None
        self._last = (0, 0)  # number and count of late replies of the telegram before
        self._asked = self._moved = 0.0  # rad, sums over all telegrams

    def note(self, number: int, setpoint: np.ndarray, sent: dict[int, np.ndarray], late: int) -> None:
        """Takes the set-point of a telegram, before it is answered.

        Args:
            number: of the telegram.
            setpoint: (6,) rad.
            sent: steps (6,) in rad by the number of the telegram that they answered.
            late: as the controller counts replies that came too late, which it does not follow.
        """
        before, self._setpoint = self._setpoint, setpoint
        last, self._last = self._last, (number, late)
        if before is None or last != (number - 1, late):
            return
        change, none = setpoint - before, np.zeros_like(setpoint)
        steps = np.array([sent.get(number - 1 - age, none) for age in range(_MOST + 1)])
        left = steps - change
        self._squares = _KEPT * self._squares + np.einsum("ij,ij->i", left, left)
        best = int(self._squares.argmin())
        here, there = self._squares[self.behind], self._squares[best]
        if here > _CLEARLY * there + _SEEN**2:
            self.behind = best
        self._asked += float(np.abs(steps[self.behind]).max())
        self._moved += float(np.abs(change).max())
        if self._asked > _ENOUGH:
            self.is_followed = self.is_followed and self._moved > _FOLLOWED * self._asked
