"""Where in their play gears without load may rest, and a cost that is to be small wherever they do."""

from dataclasses import dataclass

import numpy as np

_POWER = 3.0  # of the mean over the cases: near the worst of them, and still smooth
_SEEN = 3e-5  # m: how well a calibrated robot knows where its tip is, camera and all
_UNLIKE = 3e-4  # m, of which a tenth is usual: what springs that are some percent off add to that, and more
_SHOWN = 0.4  # of half of the play, up to which a camera shows a place; 0.58 where nothing is known of it
_PLAY_KNOWN = 0.12  # share, likewise; anywhere within a fifth
_LEAST = 1e-3  # share of the largest reference, so that a case that is right already does not count alone


@dataclass(frozen=True)
class Resting:
    """Where unloaded gears are taken to rest, and how wide their play is taken to be."""

    place: float | tuple[float, ...]  # -1 to 1, from one end of the play to the other, of all or of each of 6
    play: float  # share of the believed one


MIDDLE = Resting(0.0, 1.0)
# How wide the play is decides when the link swings across it, and an identification finds it to a fifth.
ANYWHERE = (Resting(-1.0, 0.8), Resting(-1.0, 1.2), MIDDLE, Resting(1.0, 0.8), Resting(1.0, 1.2))


def seen_places(gap: np.ndarray, J: np.ndarray, half_gaps: np.ndarray) -> tuple[Resting, ...]:
    """Where gears without load may rest if a camera sees the tip at rest.

    A gear that is seen within a standard deviation of an end rests there, however wide its play is: then the
    link swings across it at once. Any other is where it is seen, however wide its play is.

    Args:
        gap: of the tip in m from where it is believed with all of them in the middle of their play, (3,).
        J: d(tip) / d(turns of the gears), (3, 6).
        half_gaps: half of the play of those without load in rad, zero of all others, (6,).

    Returns:
        What is seen, and a standard deviation of place and of play to either side of it; ``ANYWHERE`` if the
        tip hardly moves by the play of one of them.

    Raises:
        ValueError: if the tip is further off than play and a calibration explain.
    """
    own = np.flatnonzero(half_gaps)
    A = J[:, own] * half_gaps[own]
    # A place that is as likely anywhere has a variance of a third.
    covariance = np.linalg.inv(A.T @ A / _SEEN**2 + 3.0 * np.eye(len(own)))
    sigma = np.sqrt(np.diag(covariance))
    if sigma.max() > _SHOWN:
        return ANYWHERE
    seen = np.clip(np.linalg.lstsq(A, gap, rcond=None)[0], -1.0, 1.0)
    left = float(np.linalg.norm(gap - A @ seen))
    if left > _UNLIKE:
        raise ValueError(
            f"feedforward corrected: the tip at rest is {1e3 * left:.1f} mm from where it is believed, "
            "more than play explains: give the controller the calibrated robot, or set "
            "servo.feedforward.resting=anywhere"
        )
    is_at_end = np.abs(seen) > 1.0 - np.hypot(sigma, _PLAY_KNOWN)

    def resting(beside: np.ndarray, play: float) -> Resting:
        place = np.zeros(len(half_gaps))
        place[own] = np.where(is_at_end, np.sign(seen), np.clip((seen + beside) / play, -1.0, 1.0))
        return Resting(tuple(place.tolist()), play)

    still = np.zeros(len(own))
    plays = (resting(still, play) for play in (1.0 - _PLAY_KNOWN, 1.0, 1.0 + _PLAY_KNOWN))
    places = (resting(beside, 1.0) for beside in (-sigma, sigma))
    return tuple(dict.fromkeys((*plays, *places)))


@dataclass(frozen=True)
class WorstOf:
    """A smooth worst case of sums of squares, each as a share of what it was before.

    M = (mean of (c / r)^p)^(1/p) with the references r divided by their mean: a case in which little was left
    may not become worse for the sake of the others. A single case is its own M.
    """

    reference: np.ndarray  # (cases,)

    @classmethod
    def than(cls, before: np.ndarray) -> "WorstOf":
        """Against the sums of squares before, (cases,)."""
        reference = np.maximum(before, max(_LEAST * before.max(), np.finfo(float).tiny))
        return cls(reference / reference.mean())

    def cost(self, squares: np.ndarray) -> float:
        """M of the sums of squares, (cases,)."""
        return float(np.mean((squares / self.reference) ** _POWER) ** (1.0 / _POWER))

    def slopes(self, squares: np.ndarray) -> np.ndarray:
        """d(M) / d(squares), (cases,)."""
        mean = max(self.cost(squares), np.finfo(float).tiny)
        return (squares / self.reference / mean) ** (_POWER - 1.0) / (len(squares) * self.reference)
