"""A motor, an elastic gear and a beam that bends, controlled at the motor, before it three inverse models.

As the comparison of Reiner (2010), section 3.7, figure 3.20: with gear and beam in the model, with the gear
alone, with neither. Linear about rest and solved in the frequency domain, so that nothing depends on an
integrator.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import Polynomial

from robots.dynamics.modal.modal_beam import ModalBeam

STEP, PERIOD, START, DURATION = 1e-3, 16.384, 1.0, 0.5  # s; all has died away when the period begins again
TIMES = STEP * np.arange(round(PERIOD / STEP))
DISTANCE = 0.3  # m
MODELS = ("gear and beam", "gear alone", "rigid")
_RISE = Polynomial([0, 0, 0, 0, 0, 0, 462, -1980, 3465, -3080, 1386, -252])  # five derivatives continuous
_HIGHEST = 200.0  # Hz; the path has nothing beyond
_BACK = 8.0  # s after the start of the first motion, the way back


@dataclass(frozen=True)
class DrivenBeam:
    """The plant: motor and gear on the link side, and the beam with its load."""

    beam: ModalBeam = field(default_factory=lambda: ModalBeam(1.2, 12.0, 4e4, 5.4, 3))
    motor: float = 10.0  # kg m^2
    gear: tuple[float, float] = (3e4, 30.0)  # N m / rad, N m s / rad
    control: tuple[float, float] = (4e4, 1.2e3)  # N m / rad, N m s / rad, of the motor's position
    damping: float = 0.02  # of the modes, relative to the critical one


def wanted_path() -> np.ndarray:
    """The end of the beam in m at `TIMES`: there, and back late enough."""
    there, back = (np.clip((TIMES - start) / DURATION, 0.0, 1.0) for start in (START, START + _BACK))
    return DISTANCE * (_RISE(there) - _RISE(back))


def deviation(plant: DrivenBeam, model: str, inverse_damping: float = 0.1) -> np.ndarray:
    """How far the end of the beam is from its path in m at `TIMES`.

    Args:
        plant: with all its modes.
        model: of `MODELS`. That of the beam has one mode and leaves out what the turning joint does to it by
            the beam's own mass, as (3.73); so it is stable.
        inverse_damping: of that mode in the model, larger than the plant's, as there.
    """
    path = wanted_path()
    asked = np.fft.rfft(path)
    s = 2j * np.pi * np.fft.rfftfreq(len(path), STEP)[: round(_HIGHEST * PERIOD)]
    reached = np.zeros_like(asked)
    reached[: len(s)] = _reached(plant, model, inverse_damping, s)
    return np.fft.irfft(reached * asked, len(path)) - path


def _reached(plant: DrivenBeam, model: str, inverse_damping: float, s: np.ndarray) -> np.ndarray:
    """From the path to the end of the beam at frequencies s, shape (k,)."""
    motor, torque = _feedforward(plant, model, inverse_damping, s)
    link = _dynamic_stiffness(plant.beam, plant.damping, s)
    size = link.shape[-1]
    gear, control = (first + s * second for first, second in (plant.gear, plant.control))
    system = np.zeros((len(s), 1 + size, 1 + size), dtype=complex)
    system[:, 1:, 1:] = link
    system[:, :2, :2] += gear[:, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    system[:, 0, 0] += plant.motor * s**2 + control
    driven = np.zeros((len(s), 1 + size, 1), dtype=complex)
    driven[:, 0, 0] = torque + control * motor
    return np.linalg.solve(system, driven)[:, 1:, 0] @ plant.beam.displacement(1.0)


def _feedforward(
    plant: DrivenBeam, model: str, damping: float, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angle and torque of the motor for a unit of the path, shape (k,) each."""
    beam = replace(plant.beam, num_modes=1)
    link = _dynamic_stiffness(beam, damping, s)
    if model == MODELS[0]:
        end = beam.displacement(1.0)
        simplified = link.copy()
        simplified[:, 1:, 0] = s[:, None] ** 2 * beam.load * end[1:] * end[0]
        simplified[:, 0] = end  # in place of the torque of the joint, where the end shall be
        moved = np.linalg.solve(simplified, np.broadcast_to(np.eye(len(end))[:, :1], (*link.shape[:2], 1)))[
            ..., 0
        ]
        load, angle = (link[:, 0] * moved).sum(axis=1), moved[:, 0]
    else:
        angle = np.full(len(s), 1.0 / beam.length, dtype=complex)
        load = link[:, 0, 0] * angle
    turned = 0.0 if model == MODELS[2] else load / (plant.gear[0] + s * plant.gear[1])
    motor = angle + turned
    return motor, plant.motor * s**2 * motor + load


def _dynamic_stiffness(beam: ModalBeam, damping: float, s: np.ndarray) -> np.ndarray:
    """M s^2 + D s + K of (angle, modes), (k, 1 + n, 1 + n); modes damped by a share of the critical."""
    M, K = beam.mass_matrix(), beam.stiffness_matrix()
    D = np.diag(2.0 * damping * np.sqrt(np.diag(K) * np.diag(M)))
    at = s[:, None, None]
    return at**2 * M + at * D + K
