"""Whether the tool or the camera was displaced: where the robot goes next, they look different."""

from types import SimpleNamespace

import numpy as np

from systems.estimation.events import CAMERA_MOVED, TOOL_DISPLACED
from systems.estimation.memory import Layout

_LONGEST = 1000  # samples, after which it stays undecided: the robot has not turned it far enough to tell
_FEWEST = 25  # samples
_NOISE = 1.5  # times the variance of the camera, what a fit may leave
_CLEAR = 40.0  # by which chi squared is smaller for one of both: e to the 20 to one


class CameraOrTool:
    """Two explanations of what is seen after a step, held against each other.

    At one configuration both look the same. A displaced tool is displaced by the same twist in the frame of
    the tool, wherever the robot goes; what a camera sees that was moved is displaced by the same twist about
    the origin of the world. Both are fitted by least squares to what samples say beyond the estimate from
    before the step. What this estimate is wrong by is in both fits: chi squared is taken in units of what
    the better one leaves.
    """

    def __init__(self, variances: np.ndarray, size: int) -> None:
        """Takes the variances of the six entries of a sample's error and the number of unknowns."""
        self._weights = 1.0 / variances
        self.layout = Layout(
            samples=(1,),  # still to be looked at; zero when nothing is open
            is_open=(1,),  # whether it may be either, also after nobody looks any more
            is_event=(1,),  # whether a step was seen; otherwise samples only cease to agree
            A_calm=(2, size, size),  # what was known while samples agreed, the newer first
            xi_calm=(2, size),
            kept=(1,),  # how many of them there are
            A_before=(size, size),
            xi_before=(size,),
            A=(2, 6, 6),  # sums of the two fits, tool first
            b=(2, 6),
            square=(1,),
        )

    def keep(self, memory: SimpleNamespace, A: np.ndarray, xi: np.ndarray) -> None:
        """Takes note of what is known, now and then, while samples agree with it."""
        memory.A_calm[1], memory.xi_calm[1] = memory.A_calm[0], memory.xi_calm[0]
        memory.A_calm[0], memory.xi_calm[0] = A, xi
        memory.kept[0] += 1.0

    def begin(self, memory: SimpleNamespace, may_be_camera: bool = True) -> None:
        """Samples do not agree any more: what was known well before that is what they are held against.

        Nothing happens if nothing was kept, or another comparison is still open.

        Args:
            memory: of the layout.
            may_be_camera: whether it looks like one of the two.
        """
        if memory.samples[0] > 0.0 or memory.kept[0] < len(memory.A_calm):
            return
        memory.samples[0], memory.kept[0] = _LONGEST, 0.0
        memory.A_before[:], memory.xi_before[:] = memory.A_calm[1], memory.xi_calm[1]
        memory.A[:], memory.b[:], memory.square[0] = 0.0, 0.0, 0.0
        memory.is_open[0], memory.is_event[0] = may_be_camera, 0.0

    def found(self, memory: SimpleNamespace, r: np.ndarray, X_WE: np.ndarray) -> str | None:
        """What it was, as events have it, if that becomes clear now; else None.

        Args:
            memory: of the layout.
            r: what a sample says beyond the estimate from before the step, rotation first, (6,).
            X_WE: pose that was seen, (4, 4).
        """
        memory.samples[0] -= 1.0
        for k, G in enumerate((np.kron(np.eye(2), X_WE[:3, :3]), _seen_at(X_WE[:3, 3]))):
            weighted = self._weights[:, None] * G
            memory.A[k] += G.T @ weighted
            memory.b[k] += weighted.T @ r
        memory.square[0] += float(self._weights @ (r * r))
        seen = _LONGEST - float(memory.samples[0])
        if seen < _FEWEST:
            return None
        left = memory.square[0] - (memory.b * self._twists(memory)).sum(axis=1)
        unit = max(1.0, float(left.min()) / (6.0 * seen - 6.0))
        clearer = float(left[0] - left[1]) / unit
        if abs(clearer) <= _CLEAR:
            return None
        memory.samples[0] = memory.is_open[0] = 0.0
        # A step of either leaves no more than noise: what does is something else.
        if unit >= _NOISE:
            return None
        return CAMERA_MOVED if clearer > 0.0 else TOOL_DISPLACED

    def size(self, memory: SimpleNamespace, what: str, p: np.ndarray) -> float:
        """Size in m of what moves the tip at p (m, (3,)) as it is seen: CAMERA_MOVED or TOOL_DISPLACED."""
        tool, camera = self._twists(memory)
        return float(np.linalg.norm((_seen_at(p) @ camera if what == CAMERA_MOVED else tool)[3:]))

    @staticmethod
    def _twists(memory: SimpleNamespace) -> np.ndarray:
        """Of tool and camera, (2, 6)."""
        return np.linalg.solve(memory.A, memory.b[..., None])[..., 0]


def _seen_at(p: np.ndarray) -> np.ndarray:
    """How a pose at p moves with a turn and a shift about the origin, (6, 6)."""
    G = np.eye(6)
    G[3:, :3] = [[0.0, p[2], -p[1]], [-p[2], 0.0, p[0]], [p[1], -p[0], 0.0]]  # turn x p
    return G
