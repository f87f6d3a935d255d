"""What of the unknowns is not of the robot but of a camera that was moved, and how well the two are told."""

from types import SimpleNamespace

import numpy as np

from systems.estimation.memory import Layout


class CameraMoves:
    """A move of the camera and one of the robot's base look the same; the prior tells them apart.

    The unknowns follow what is seen, x = x_robot + B c with the columns B of a move. With the covariance P of
    the robot from before, and a move of a standard deviation of one,

        E(c | x) = G (x - x_before)    G = B^T (P + B B^T)^-1    cov(c | x) = S = (1 + B^T P^-1 B)^-1

    so that the robot's covariance is K P_x K^T + B S B^T, with K = 1 - B G and the covariance P_x of the
    unknowns as they are seen.
    """

    def __init__(self, directions: np.ndarray) -> None:
        """Takes the columns of a move in units of the spreads, (n, 6)."""
        self._B = directions
        n = len(directions)
        self.layout = Layout(
            moves=(1,),  # how many there were
            xi=(n,),  # of all moves but the last
            xi_before=(n,),  # the unknowns before the last move
            gain=(6, n),  # from what they have changed by since then to the move
            spread=(6, 6),  # covariance of the moves, were the unknowns known
        )

    def begin(self, memory: SimpleNamespace, A: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """The camera was moved; returns the information on the unknowns as it sees them now, (n, n).

        Args:
            memory: of the layout.
            A: information before the move, (n, n).
            xi: the unknowns then, (n,).
        """
        B, P = self._B, np.linalg.inv(A)
        memory.moves[0] += 1.0
        memory.xi += self._of_last(memory, xi)
        # What moves before it are off by stays as it is from now on.
        memory.spread += memory.gain @ P @ memory.gain.T + np.linalg.inv(np.eye(6) + B.T @ A @ B)
        A = np.linalg.inv(P + B @ B.T)
        A = 0.5 * (A + A.T)
        memory.gain[:], memory.xi_before[:] = B.T @ A, xi
        return A

    def robot(self, memory: SimpleNamespace, xi: np.ndarray) -> np.ndarray:
        """Of unknowns (n,) what is of the robot."""
        if not memory.moves[0]:
            return xi
        return xi - memory.xi - self._of_last(memory, xi)

    def covariance(self, memory: SimpleNamespace, P: np.ndarray) -> np.ndarray:
        """The robot's from that of the unknowns as they are seen, (n, n)."""
        if not memory.moves[0]:
            return P
        B = self._B
        K = np.eye(len(P)) - B @ memory.gain
        return K @ P @ K.T + B @ memory.spread @ B.T

    def _of_last(self, memory: SimpleNamespace, xi: np.ndarray) -> np.ndarray:
        return self._B @ (memory.gain @ (xi - memory.xi_before))
