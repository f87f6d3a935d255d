"""Four low-pass filters that could make a path smooth before an inverse; Reiner (2010), figure 3.2.

All have the same order and lose 3 dB at the same frequency. What overshoots in answer to a step does so at
every corner of a path, and the inverse passes it on.
"""

import numpy as np
from scipy import signal

ORDER, HERTZ = 4, 20.0
RIPPLE = 1.0  # dB, of Chebyshev's below its cutoff
STEP_AT, STEP, END = 0.01, 2e-4, 0.16  # s
TIMES = np.arange(0.0, END, STEP)
FREQUENCIES = np.geomspace(1.0, 200.0, 200)  # Hz
NAMES = ("critically damped", "Bessel", "Butterworth", "Chebyshev")  # the first two are prefilters here


def poles(name: str) -> np.ndarray:
    """In 1/s, shape (4,), such that the gain at `HERTZ` is -3 dB; there are no zeros."""
    of = {
        "critically damped": -np.full(ORDER, 1.0 / np.sqrt(2.0 ** (1.0 / ORDER) - 1.0)),
        "Bessel": signal.besselap(ORDER, norm="mag")[1],
        "Butterworth": signal.buttap(ORDER)[1],
        # Chebyshev's cutoff is where the ripple ends; -3 dB comes a little later.
        "Chebyshev": signal.cheb1ap(ORDER, RIPPLE)[1] / _cheb_minus_3_db(),
    }
    return 2.0 * np.pi * HERTZ * of[name]


def step_response(name: str) -> np.ndarray:
    """Answer at `TIMES` to a step from 0 to 1 at `STEP_AT`."""
    denominator = np.poly(poles(name)).real
    step = (TIMES >= STEP_AT).astype(float)
    system = signal.TransferFunction([denominator[-1]], denominator)
    return signal.lsim(system, step, TIMES, interp=False)[1] * _settled(name)


def gain(name: str, hertz: np.ndarray) -> np.ndarray:
    """Amplitude at frequencies in Hz, one at rest but for Chebyshev's, which begins in a valley."""
    denominator = np.poly(poles(name)).real
    s = 2j * np.pi * np.asarray(hertz)
    return np.abs(denominator[-1] / np.polyval(denominator, s)) * _settled(name)


def overshoot(name: str) -> float:
    """By which share of the step its answer goes beyond where it settles."""
    answer = step_response(name)
    return max(0.0, float(answer.max() / _settled(name)) - 1.0)


def _settled(name: str) -> float:
    """Gain at rest: a Chebyshev filter of even order has the ripple's lower edge there."""
    return 10.0 ** (-RIPPLE / 20.0) if name == "Chebyshev" else 1.0


def _cheb_minus_3_db() -> float:
    ripple = np.sqrt(10.0 ** (RIPPLE / 10.0) - 1.0)
    return float(np.cosh(np.arccosh(1.0 / ripple) / ORDER))
