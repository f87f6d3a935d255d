"""What of the unknowns is not of the robot but of a camera that was moved, and how well the two are told."""

from types import SimpleNamespace

import numpy as np

from systems.estimation.memory import Layout


class CameraMoves:
    """A move of the camera and one of the robot's base look the same; the prior tells them apart.

    The unknowns follow what is seen, x = x_robot + B c with the columns B of a move. With the covariance P of
    the unknowns from before, and a move of a standard deviation of one,

        E(c | x) = G (x - x_before)    G = B^T (P + B B^T)^-1    cov(c | x) = S = (1 + B^T P^-1 B)^-1

    so that the robot's covariance is K P_x K^T + B S B^T, with K = 1 - B G and the covariance P_x of the
    unknowns as they are seen. After another move x is first what was seen before it, and that is the robot:
    of all moves together c = g x - s, with the covariance S if x were known, and

        g <- g + (1 - g B) G    s <- s + (1 - g B) G x_before    S <- S + (1 - g B) S_last (1 - g B)^T
    """

    def __init__(self, directions: np.ndarray) -> None:
        """Takes the columns of a move in units of the spreads, (n, 6)."""
        self._B = directions
        self.layout = Layout(
            moves=(1,),  # how many there were
            gain=(6, len(directions)),  # g, from the unknowns to all moves together
            shift=(6,),  # s
            spread=(6, 6),  # S
        )

    def begin(self, memory: SimpleNamespace, A: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """The camera was moved; returns the information on the unknowns as it sees them now, (n, n).

        Args:
            memory: of the layout.
            A: information before the move, (n, n).
            xi: the unknowns then, (n,).
        """
        B, P = self._B, np.linalg.inv(A)
        left = np.eye(6) - memory.gain @ B
        memory.spread += left @ np.linalg.inv(np.eye(6) + B.T @ A @ B) @ left.T
        A = np.linalg.inv(P + B @ B.T)
        A = 0.5 * (A + A.T)
        gain = left @ (B.T @ A)
        memory.moves[0] += 1.0
        memory.shift += gain @ xi
        memory.gain += gain
        return A

    def robot(self, memory: SimpleNamespace, xi: np.ndarray) -> np.ndarray:
        """Of unknowns (n,) what is of the robot."""
        if not memory.moves[0]:
            return xi
        return xi - self._B @ (memory.gain @ xi - memory.shift)

    def covariance(self, memory: SimpleNamespace, P: np.ndarray) -> np.ndarray:
        """The robot's from that of the unknowns as they are seen, (n, n)."""
        if not memory.moves[0]:
            return P
        B = self._B
        K = np.eye(len(P)) - B @ memory.gain
        return K @ P @ K.T + B @ memory.spread @ B.T
