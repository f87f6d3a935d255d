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

# What a motion needs; of it what the rotor needs and Coulomb friction; and that of a kilogram
TORQUES = at.W_MISSING, at.W_ROTOR, at.W_COULOMB, at.W_LOADS
_STEPS = np.geomspace(0.4, 2.5, 5)  # factors of the gains of position and of the integral that are believed
_GRID = np.array(list(product(_STEPS, _STEPS)))
# Columns that are the same unknown in all joints, with their spreads: how far motors give way, kilograms of a
# robot that carries 7 kg, a dead time and a time of smoothing in s
_SHARED = {0: 1.0, 3: 3.0, 4: 3e-3, 5: 1e-3}
# Those of each joint: by how much more it gives way, shares of rotor and friction, a constant in rad, and
# what it is behind by at first
_OWN = {0: 0.15, 1: 0.5, 2: 0.7, 6: 1e-3, 7: 3e-3}
_KILOGRAM = 3
_SIGMA = 1e-4  # rad, of a following error
_CLEARER = 0.5  # of the error that the present gains leave; else these stay
_MOST = 3.5  # times stiffer or softer than believed


class Gains(NamedTuple):
    """What drives turn out to be."""

    position: float  # factors of the gains that are believed
    integral: float
    give: np.ndarray  # (6,), times as far as believed motors give way to a torque


class GainSearch:
    """A cascade gives way by e = s / (k_d (s + p) (s + i)) w: p and i of all joints alike, k_d of each.

    With each p and i of a grid e is linear in what else is not known: k_d, friction, inertia of the rotor,
    mass of the payload, dead time. The least squares of all joints are smooth in the logarithms of p and i;
    between the points of the grid a parabola is laid through them. What is found is what describes the
    motors best: p and i may be exchanged, as e depends on their sum and product alone, and both come out
    lower where speed loops are slow, whose own lag the model does not have.
    """

    def __init__(self, gains: DriveGains, p: float, i: float, load_scale: float, period: float) -> None:
        """Takes the gains that are believed, p and i of them in 1/s, and the scale of loads."""
        poles, n, k = _GRID * (p, i), len(_GRID), len(TORQUES)
        kd = np.tile(gains.kd, (n, 1))
        kp, self._ki = kd * poles.sum(axis=1, keepdims=True), kd * poles.prod(axis=1, keepdims=True)
        steps = filter_steps(kp.ravel(), self._ki.ravel(), kd.ravel(), period)
        self._steps = steps.reshape(n, NUM_JOINTS, *steps.shape[1:])
        self._slowest, self._period = poles.min(axis=1), period
        shared = [spread * (load_scale if k == _KILOGRAM else 1.0) for k, spread in _SHARED.items()]
        self._spreads = np.array([*shared, *[*_OWN.values()] * 6])
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
        """Goes on by a period to an instant with its torques in N m, (4, 6), as of `TORQUES`."""
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
            best = int(misfit.argmin())
            variances = np.maximum(left[best] / memory.samples[0], _SIGMA**2)
        present = int(np.abs(np.log(_GRID / (position, integral))).max(axis=1).argmin())
        if misfit[best] > _CLEARER**2 * misfit[present]:
            return None
        give = np.log(np.clip(x[:, :1] + x[:, len(_SHARED) :: len(_OWN)], 1.0 / _MOST, _MOST))
        way, give = _between(best, np.log(misfit), give)
        found = _GRID[best] * (_STEPS[1] / _STEPS[0]) ** way
        return Gains(float(found[0]), float(found[1]), np.exp(give))

    def _fit(
        self, memory: SimpleNamespace, A: np.ndarray, variances: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each set of gains the sum of squares (n,), those of joints in rad^2 (n, 6), unknowns (n, u)."""
        prior = self._spreads**-2
        information, right = np.tile(np.diag(prior), (len(A), 1, 1)), np.zeros((len(A), len(prior)))
        right[:, 0] = prior[0]  # about 1
        for j, place in enumerate(_PLACES):
            information += place.T @ (A[:, j] / variances[j]) @ place
            right += memory.b[:, j] @ place / variances[j]
        x = np.linalg.solve(information, right[..., None])[..., 0]
        left = np.empty((len(A), 6))
        for j, place in enumerate(_PLACES):
            own = x @ place.T
            left[:, j] = memory.square[j] - 2.0 * (own * memory.b[:, j]).sum(axis=1)
            left[:, j] += np.einsum("na,nab,nb->n", own, A[:, j], own)
        by_prior = (prior * (x - np.eye(len(prior))[0]) ** 2).sum(axis=1)
        return (left / variances).sum(axis=1) + by_prior, left, x


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


def _places() -> list[np.ndarray]:
    """Of each joint, which unknown is the factor of a column, (columns, unknowns)."""
    places = []
    for j in range(6):
        place = np.zeros((len(TORQUES) + 4, len(_SHARED) + 6 * len(_OWN)))
        place[list(_SHARED), range(len(_SHARED))] = 1.0
        place[list(_OWN), len(_SHARED) + j * len(_OWN) + np.arange(len(_OWN))] = 1.0
        places.append(place)
    return places


_PLACES = _places()
_NEAR = np.array(list(product((-1, 0, 1), (-1, 0, 1))))
_PARABOLA = np.linalg.pinv(_powers(_NEAR.astype(float)))
