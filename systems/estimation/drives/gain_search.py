"""The gains of drives that nobody knows, from how far motors are behind commands while the robot probes."""

from itertools import product
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.estimation import kernels
from systems.estimation.drives.drive_gains import DriveGains, filter_steps
from systems.estimation.kernels import drive_columns as at
from systems.estimation.memory import Layout

# What a motion needs; of it what the rotor needs and Coulomb friction; and that of a kilogram. Then what
# torques that are sent may lack beside these: a kilogram that drives do not hold, what viscous friction
# needs, and the load of a kg m of its first moment along x, y and z.
TORQUES = (
    *(at.W_MISSING, at.W_ROTOR, at.W_COULOMB, at.W_LOADS),
    *(at.W_NOT_HELD, at.W_VISCOUS, at.W_LOADS + 1, at.W_LOADS + 2, at.W_LOADS + 3),
)
_MISSING, _ROTOR, _COULOMB, _LOAD, _NOT_HELD, _VISCOUS, *_MOMENTS = range(len(TORQUES))
_OF_POSITIONS = 4  # how many there are of drives that are sent positions alone
_STEPS = np.geomspace(0.4, 2.5, 5)  # factors of the gains of position and of the integral that are believed
_GRID = np.array(list(product(_STEPS, _STEPS)))
# Spreads of columns that are the same unknown in all joints: how far motors give way, kilograms of a robot
# that carries 7 kg, and where torques are sent kilograms that are not held, and kg m, of the same robot
_SHARED = {_MISSING: 1.0, _LOAD: 3.0}
_SHARED_OF_TORQUES = {**_SHARED, _NOT_HELD: 5.0, **dict.fromkeys(_MOMENTS, 0.15)}
_LOADS = _LOAD, _NOT_HELD, *_MOMENTS
_TIMES = 3e-3, 1e-3  # s, spreads of a dead time and of a time of smoothing
# Those of each joint: by how much more it gives way, shares of rotor and friction, kilograms
_OWN = {_MISSING: 0.15, _ROTOR: 0.5, _COULOMB: 0.7}
_OWN_OF_TORQUES = {**_OWN, _NOT_HELD: 3.0, _VISCOUS: 0.5}
_AT_FIRST = 1e-3, 3e-3  # rad, spreads of a constant, and of what a joint is behind by at first
_SIGMA = 1e-4  # rad, of a following error
# Of the error that the present gains leave, else these stay. Of 36 robots over EGM the best leave about half
# of it or less where the slower pole or both are others by 1.6 times and more, and nearly all where none is.
# Where torques are sent, less of it is due to gains, and only the softest drives show.
_CLEARER = 0.7
_MOST = 3.5  # times stiffer or softer than believed


class Gains(NamedTuple):
    """What drives turn out to be."""

    position: float  # factors of the gains that are believed
    integral: float
    give: np.ndarray  # (6,), times as far as believed motors give way to a torque


class GainSearch:
    """A cascade gives way by e = s / (k_d (s + p) (s + i)) w: p and i of all joints alike, k_d of each.

    Here w is what no torque that is sent makes up for: where drives take none, all that the motion needs;
    elsewhere what it needs unlike belief, and k_d stays what it was.

    With each p and i of a grid e is linear in what else is not known: k_d, friction, inertia of the rotor,
    mass of the payload, dead time. The least squares of all joints are smooth in the logarithms of p and i;
    between the points of the grid a parabola is laid through them. What is found is what describes the
    motors best: p and i may be exchanged, as e depends on their sum and product alone, and both come out
    lower where speed loops are slow, whose own lag the model does not have.

    Where torques are sent, only drives softer than believed are looked for. Stiffer ones leave motors nearer
    to their plan than anything else that is learnt needs, and friction that turns over otherwise than
    believed looks like them.
    """

    def __init__(
        self, gains: DriveGains, p: float, i: float, load_scale: float, period: float, takes_torque: bool
    ) -> None:
        """Builds the filters of the grid.

        Args:
            gains: that are believed.
            p, i: of them, 1/s.
            load_scale: of loads, 1 of a robot that carries 7 kg.
            period: s.
            takes_torque: whether the drives are sent torques.
        """
        self._takes_torque = takes_torque
        self._count = k = len(TORQUES) if takes_torque else _OF_POSITIONS
        poles, n = _GRID * (p, i), len(_GRID)
        kd = np.tile(gains.kd, (n, 1))
        kp, self._ki = kd * poles.sum(axis=1, keepdims=True), kd * poles.prod(axis=1, keepdims=True)
        steps = filter_steps(kp.ravel(), self._ki.ravel(), kd.ravel(), period)
        self._steps = steps.reshape(n, NUM_JOINTS, *steps.shape[1:])
        self._slowest, self._period = poles.min(axis=1), period
        self._candidates = np.flatnonzero(_GRID.prod(axis=1) < 1.0 + 1e-9) if takes_torque else np.arange(n)
        shared, own = (
            {column: spread * (load_scale if column in _LOADS else 1.0) for column, spread in spreads.items()}
            for spreads in ((_SHARED_OF_TORQUES, _OWN_OF_TORQUES) if takes_torque else (_SHARED, _OWN))
        )
        # After the torques come the columns of two times, of a constant, and of what is left of the first.
        shared |= dict(zip((k, k + 1), _TIMES, strict=True))
        own |= dict(zip((k + 2, k + 3), _AT_FIRST, strict=True))
        self._shared, self._own = list(shared), list(own)
        self._of_shared, self._of_own = (np.array([*each.values()]) ** -2 for each in (shared, own))
        self.layout = Layout(
            samples=(1,),
            started=(1,),
            last=(k, 6),
            z=(n, k, 6, 2),
            A=(n, 6, k + 4, k + 4),
            b=(n, 6, k + 4),
            square=(6,),
        )

    def follow(self, memory: SimpleNamespace, torques: np.ndarray) -> None:
        """Goes on by a period to an instant with its torques in N m, (9, 6), as of `TORQUES`."""
        torques = torques[: self._count]
        if not memory.started[0]:
            memory.started[0], memory.last[:] = 1.0, torques
            memory.z[..., 0], memory.z[..., 1] = torques / self._ki[:, None], 0.0
            return
        kernels.gain_search.follow(self._steps, torques, memory.last, memory.z)

    def add(self, memory: SimpleNamespace, late: np.ndarray, behind: np.ndarray) -> None:
        """Takes how far motors were behind their commands, rad, (6,), and what times shift, rad/s, (2, 6)."""
        left = np.exp(-self._period * memory.samples[0] * self._slowest)
        memory.samples[0] += 1.0
        kernels.gain_search.add(memory.z, late, left, behind, memory.A, memory.b, memory.square)

    def rehearse(self, memory: SimpleNamespace) -> None:
        """Has everything compiled that ticks need, on memory that nobody uses."""
        nothing = np.zeros((len(TORQUES), 6))
        for _ in range(2):
            self.follow(memory, nothing)
        self.add(memory, nothing[:2], nothing[0])

    def find(self, memory: SimpleNamespace, position: float, integral: float) -> Gains | None:
        """The gains, if others fit far better than the present ones, whose factors are given."""
        A = memory.A + np.tril(memory.A, -1).swapaxes(-1, -2)
        variances = np.full(6, _SIGMA**2)
        for _ in range(2):  # a joint counts by what is left of it
            misfit, left, x = self._fit(memory, A, variances)
            best = int(self._candidates[misfit[self._candidates].argmin()])
            variances = np.maximum(left[best] / memory.samples[0], _SIGMA**2)
        present = int(np.abs(np.log(_GRID / (position, integral))).max(axis=1).argmin())
        if misfit[best] > _CLEARER**2 * misfit[present]:
            return None
        give = np.log(np.clip(x[..., _MISSING], 1.0 / _MOST, _MOST))
        if self._takes_torque:
            give[:] = 0.0  # next to nothing shows it where no torque is known that nobody gives
        way, give = _between(best, np.log(misfit), give)
        found = _GRID[best] * (_STEPS[1] / _STEPS[0]) ** way
        return Gains(float(found[0]), float(found[1]), np.exp(give))

    def _fit(
        self, memory: SimpleNamespace, A: np.ndarray, variances: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each set of gains the sum of squares, (n,), those of joints in rad^2, (n, 6), and the factors.

        Factors are those of the columns of each joint, (n, 6, k + 4). What is a joint's own is eliminated
        joint by joint, then what all share is found.
        """
        shared, own = self._shared, self._own
        W, b = A / variances[:, None, None], memory.b / variances[:, None]
        across = W[..., own, :][..., shared]  # (n, 6, own, shared)
        right = np.concatenate((across, b[..., own, None]), axis=-1)
        K = np.linalg.solve(W[..., own, :][..., own] + np.diag(self._of_own), right)
        reduced = across.swapaxes(-1, -2) @ K
        M = (W[..., shared, :][..., shared] - reduced[..., :-1]).sum(axis=1) + np.diag(self._of_shared)
        r = (b[..., shared] - reduced[..., -1]).sum(axis=1)
        r[:, 0] += self._of_shared[0]  # about 1
        x = np.linalg.solve(M, r[..., None])
        of_joints = K[..., -1] - (K[..., :-1] @ x[:, None])[..., 0]
        factors = np.zeros(b.shape)
        factors[..., shared] = x[:, None, :, 0]
        factors[..., own] += of_joints
        left = memory.square - 2.0 * (factors * memory.b).sum(axis=-1)
        left += np.einsum("nja,njab,njb->nj", factors, A, factors)
        off = x[..., 0] - np.eye(len(shared))[0]
        by_prior = off**2 @ self._of_shared + (of_joints**2 @ self._of_own).sum(axis=1)
        return (left / variances).sum(axis=1) + by_prior, left, factors


def _between(best: int, misfit: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many steps from the best point the least of a parabola is, (2,), and values (n, 6) there, (6,)."""
    n = len(_STEPS)
    row, column = np.clip(np.divmod(best, n), 1, n - 2)
    near = [(row + u) * n + column + v for u, v in _NEAR]
    (_, *slope, uu, uv, vv), at = _PARABOLA @ misfit[near], _PARABOLA @ values[near]
    H = np.array([[2.0 * uu, uv], [uv, 2.0 * vv]])
    place = np.array(np.divmod(best, n), dtype=float) - (row, column)
    way = place
    if np.linalg.eigvalsh(H)[0] > 0.0:
        way = np.clip(np.linalg.solve(H, -np.array(slope)), place - 0.5, place + 0.5).clip(-1.0, 1.0)
    return way - place, _powers(way) @ at


def _powers(way: np.ndarray) -> np.ndarray:
    u, v = way[..., 0], way[..., 1]
    return np.stack((np.ones_like(u), u, v, u * u, u * v, v * v), axis=-1)


_NEAR = np.array(list(product((-1, 0, 1), (-1, 0, 1))))
_PARABOLA = np.linalg.pinv(_powers(_NEAR.astype(float)))
