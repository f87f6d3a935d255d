"""Which motion before a path shows best what it needs: chosen by how well the tip will be known on it."""

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.estimation.probing.path_needs import PathNeeds, Standing
from systems.estimation.probing.probe import USUAL, Pattern, Probe

_TRIES, _MORE_TRIES = 32, 128  # the latter with a slow camera: where few samples are taken matters more
_FEW = 200.0  # samples a second
_MOST_PERIODS = 4  # in the window
_STEPS = np.array([0.5, 0.7, 1.4, 2.0])  # by which an amplitude changes from try to try
_INSTANTS = 45  # of the window
_QUARTER = 0.5 * np.pi


def designed(
    needs: PathNeeds, probe: Probe, path_start: float, rate: float, sharp: float
) -> tuple[Pattern, Standing]:
    """The pattern after which the tip is known best where it is known worst, and how well that is.

    It begins with the usual pattern, as large as it may be, and goes on from the best one by changing the
    amplitude, the number of periods or the phase of up to three axes. Amplitudes are zero where the tip will
    be known well enough without.

    Args:
        needs: of the path.
        probe: whose limits hold.
        path_start: s, before which the motion ends.
        rate: samples of the camera in a second.
        sharp: m, how well is well enough.
    """
    q, still = needs.q[0], np.zeros((1, NUM_JOINTS))
    at_rest = rate * needs.information(needs.columns(q[None], still, still))
    _, length = probe.window(path_start)
    without = needs.forecast(needs.prior + path_start * at_rest, rate)
    if length == 0.0 or without.sigma < sharp:
        return USUAL._replace(size=np.zeros(NUM_JOINTS)), without
    known = needs.prior + (path_start - length) * at_rest
    J, room = needs.jacobian(q), probe.room(q)
    times = np.linspace(0.0, length, _INSTANTS)

    def shown(pattern: Pattern) -> np.ndarray:
        displacement, velocity, acceleration = pattern.at(times, length)
        H = needs.columns(q + displacement, velocity, acceleration)
        return known + rate * length / _INSTANTS * needs.information(H)

    def judged(pattern: Pattern) -> tuple[float, Pattern]:
        pattern = pattern._replace(size=probe.within_limits(pattern, room, J, length))
        return needs.expected(shown(pattern), rate), pattern

    best = judged(USUAL._replace(size=np.full(NUM_JOINTS, np.inf)))
    rng = np.random.default_rng(0)
    for _ in range(_MORE_TRIES if rate < _FEW else _TRIES):
        candidate = judged(_changed(best[1], rng))
        if candidate[0] < best[0]:
            best = candidate
    return best[1], needs.forecast(shown(best[1]), rate)


def _changed(pattern: Pattern, rng: np.random.Generator) -> Pattern:
    size, periods, phases = (np.array(part) for part in pattern)
    for axis in rng.choice(NUM_JOINTS, rng.integers(1, 4), replace=False):
        what = rng.integers(3)
        if what == 0:
            size[axis] *= rng.choice(_STEPS)
        elif what == 1:
            periods[axis] = rng.integers(1, _MOST_PERIODS + 1)
        else:
            phases[axis] = _QUARTER * rng.integers(4)
    # As large as limits allow: they make it smaller again.
    return Pattern(1.3 * size, periods, phases)
