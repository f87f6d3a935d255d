"""Whether tool, camera or joints were displaced, or a load changed: where a robot goes next shows it."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels
from systems.estimation.events import CAMERA_MOVED, JOINTS_SHIFTED, LOAD_CHANGED, TOOL_DISPLACED
from systems.estimation.memory import Layout

_LONGEST = 4000  # samples, after which it stays undecided: the robot has not turned it far enough to tell
_FEWEST = 25  # samples, and between two looks
_NOISE = 1.5  # times the variance of the camera, what a fit may leave
_CLEAR = 25.0  # by which chi squared is smaller for one than for the others: e to the 12 to one
_ALL = TOOL_DISPLACED, CAMERA_MOVED, JOINTS_SHIFTED, LOAD_CHANGED
_PLACES = np.cumsum([0, 6, 6, 6, 4])  # of their columns
_COLUMNS = int(_PLACES[-1])


class Displacement:
    """Four explanations of what is seen after a step, held against each other.

    At one configuration all look the same. A displaced tool is displaced by the same twist in the frame of
    the tool, wherever the robot goes; what a camera sees that was moved is displaced by the same twist about
    the origin of the world; links that have slipped against their encoders turn about their joints; and a
    load goes on to bend the arm as its columns of H say.

    With the columns G of one of them, what samples say beyond the estimate from before the step is
    H dxi + G c and noise, where dxi is what that estimate, of the information A, was wrong by. Least squares
    of dxi, which costs dxi^T A dxi, and c leave the less of chi squared the better the explanation.
    """

    def __init__(self, size: int, load: slice) -> None:
        """Takes the number of unknowns, and which of them are of the load."""
        self._load = load
        nothing = np.zeros((6, 1)), np.zeros(6), np.zeros(6), np.zeros((1, 1)), np.zeros(1)
        kernels.information.gather(*nothing)  # compiled, or read, before a tick needs it
        self.layout = Layout(
            samples=(1,),  # still to be looked at; zero when nothing is open
            is_open=(1,),  # whether it may be any, also after nobody looks any more
            is_event=(1,),  # whether a step was seen; otherwise samples only cease to agree
            P_calm=(2, size, size),  # covariance while samples agreed, the newer first
            xi_calm=(2, size),
            kept=(1,),  # how many of them there are
            A_before=(size, size),
            xi_before=(size,),
            # Sums of H, and of G of each in the order of `_ALL`; of A the lower half
            A=(size + _COLUMNS, size + _COLUMNS),
            b=(size + _COLUMNS,),
            square=(1,),
            fits=(_COLUMNS,),  # twists of tool and camera, angles of joints, load in units of its spread
        )

    def keep(self, memory: SimpleNamespace, P: np.ndarray, xi: np.ndarray) -> None:
        """Takes note of what is known, now and then, while samples agree with it."""
        memory.P_calm[1], memory.xi_calm[1] = memory.P_calm[0], memory.xi_calm[0]
        memory.P_calm[0], memory.xi_calm[0] = P, xi
        memory.kept[0] += 1.0

    def begin(self, memory: SimpleNamespace, is_load: bool = False) -> bool:
        """Samples do not agree any more: what was known well before that is what they are held against.

        Nothing is if nothing was kept, nor while another comparison is going on, which a load ends.

        Args:
            memory: of the layout.
            is_load: whether it looks like a load.

        Returns:
            Whether the tip may be elsewhere than it is seen.
        """
        if memory.samples[0] == 0.0 and memory.kept[0] >= len(memory.P_calm):
            memory.samples[0], memory.kept[0] = _LONGEST, 0.0
            memory.A_before[:], memory.xi_before[:] = np.linalg.inv(memory.P_calm[1]), memory.xi_calm[1]
            memory.A[:], memory.b[:], memory.square[0] = 0.0, 0.0, 0.0
            memory.is_open[0], memory.is_event[0] = not is_load, 0.0
        elif is_load:
            memory.samples[0] = 0.0
        return bool(memory.is_open[0])

    def found(
        self,
        memory: SimpleNamespace,
        r: np.ndarray,
        columns: tuple[np.ndarray, np.ndarray],
        X_WE: np.ndarray,
        weights: np.ndarray,
    ) -> str | None:
        """What it was, as events have it, if that becomes clear now; else None.

        Args:
            memory: of the layout.
            r: what a sample says beyond the estimate from before the step, rotation first, (6,).
            columns: how the tip moves with the unknowns, (6, n), and with the joints, (6, 6).
            X_WE: pose that was seen, (4, 4).
            weights: of the six entries of r, one over their variances.
        """
        memory.samples[0] -= 1.0
        H, J = columns
        each = np.kron(np.eye(2), X_WE[:3, :3]), _seen_at(X_WE[:3, 3]), J, H[:, self._load]
        rows = np.concatenate((H, *each), axis=1)
        kernels.information.gather(rows, r, weights, memory.A, memory.b)
        memory.square[0] += float(weights @ (r * r))
        seen = _LONGEST - float(memory.samples[0])
        if seen % _FEWEST:
            return None
        left = self._left(memory)
        unit = max(1.0, float(left.min()) / (6.0 * seen - 6.0))
        best, second = np.sort(left)[:2]
        if second - best <= _CLEAR * unit:
            return None
        memory.samples[0] = memory.is_open[0] = 0.0
        # A step of one of these leaves no more than noise: what does is something else.
        return _ALL[int(left.argmin())] if unit < _NOISE else None

    @staticmethod
    def _left(memory: SimpleNamespace) -> np.ndarray:
        """What each explanation leaves of chi squared, (4,); writes what it would have to be."""
        n = len(memory.xi_before)
        A, b = np.tril(memory.A) + np.tril(memory.A, -1).T, memory.b
        known = A[:n, :n] + memory.A_before
        solved = np.linalg.solve(known, np.column_stack((A[:n, n:], b[:n])))
        left = np.full(len(_ALL), float(memory.square[0] - b[:n] @ solved[:, -1]))
        for k, (first, end) in enumerate(pairwise(_PLACES)):
            of = slice(n + first, n + end)
            C = A[of, of] - A[of, :n] @ solved[:, first:end]
            # Nothing where nothing shows it, as a load of a robot that is believed not to yield.
            C += 1e-12 * max(np.trace(A[of, of]), 1.0) * np.eye(end - first)
            d = b[of] - A[of, :n] @ solved[:, -1]
            memory.fits[first:end] = np.linalg.solve(C, d)
            left[k] -= d @ memory.fits[first:end]
        return left

    def size(self, memory: SimpleNamespace, what: str, p: np.ndarray) -> float:
        """Of what moves the tip at p (m, (3,)) as it is seen, in m; of joints the largest angle in rad."""
        tool, camera, joints = memory.fits[:18].reshape(3, 6)
        if what == JOINTS_SHIFTED:
            return float(np.abs(joints).max())
        return float(np.linalg.norm((_seen_at(p) @ camera if what == CAMERA_MOVED else tool)[3:]))


def _seen_at(p: np.ndarray) -> np.ndarray:
    """How a pose at p moves with a turn and a shift about the origin, (6, 6)."""
    G = np.eye(6)
    G[3:, :3] = [[0.0, p[2], -p[1]], [-p[2], 0.0, p[0]], [p[1], -p[0], 0.0]]  # turn x p
    return G
