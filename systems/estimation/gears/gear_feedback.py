"""What a camera shows of teeth that cross otherwise than the model of their gear expects, fed back."""

import math
from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.estimation import kernels
from systems.estimation.gears.gear_errors import USUAL
from systems.estimation.memory import Layout

# All assumed. Teeth that lie free cross in some tenths of a second, and hardly while nothing moves. What is
# fed back faster than links follow their motors through free teeth makes them swing from one side to the
# other. They follow through grease and hysteresis, so that heavy links with soft dampers allow no more than
# a multiple of what grease alone does. Of eight UR10 one swung with 40 rad/s, by 0.08 mm.
_LASTS, _LASTS_AT_REST = 0.1, 30.0  # s, after which a third is left of what a joint is off by
_AT_REST = 1e-3  # rad/s, of the joints; what is fed back moves them by less
_FREQUENCY = 40.0  # rad/s, with which joints are led at most to where it is made up for
_GREASE = 0.3  # of the damping of gears, that teeth move against in their gap
_PER_GREASE = 8.0  # of the rate with which a link follows through grease alone


class GearFeedback:
    """Makes up for the positions of teeth that no model foresees, one angle of each joint.

    When teeth that lie free cross from one side of their gap to the other depends on tenths of a newton
    metre. But while they are elsewhere than expected a camera shows where. What a joint is off by is an
    Ornstein-Uhlenbeck process: it is forgotten within a time, and its variance is a share of that which the
    model of the gear admits, so that next to nothing is fed back of a gear under load. A Kalman filter takes
    the samples. Joints are led aside by what is expected of it at the instant that is planned, on a
    critically damped way of which the plan has the loads, for they push teeth, too.
    """

    def __init__(self, share: float) -> None:
        """Takes how much of the variance that gears admit is believed in; none feeds nothing back."""
        self._share = share
        self.frequency = np.full(NUM_JOINTS, _FREQUENCY)  # rad/s
        self.layout = Layout(
            off=(NUM_JOINTS,),  # rad, at the last exposure
            P=(NUM_JOINTS, NUM_JOINTS),  # rad^2, its covariance
            exposure=(1,),  # s, as the camera has it
            lasts=(1,),  # s, after which a third is left of it
            aside=(2, NUM_JOINTS),  # rad and rad/s, by which joints are led aside
        )

    @property
    def acts(self) -> bool:
        """Whether anything is fed back."""
        return self._share > 0.0

    def suit(self, damping: np.ndarray, inertia: np.ndarray) -> None:
        """Leads joints no faster than links follow: dampers of gears in N m s/rad, kg m^2, (6,) each."""
        self.frequency = np.minimum(_FREQUENCY, _PER_GREASE * _GREASE * np.asarray(damping) / inertia)

    def rest(self, memory: SimpleNamespace) -> None:
        """Nothing is known, and nothing led aside."""
        memory.all[:], memory.lasts[0] = 0.0, _LASTS

    def hear(
        self,
        memory: SimpleNamespace,
        J: np.ndarray,
        r: np.ndarray,
        weights: np.ndarray,
        by_model: np.ndarray,
        variances: np.ndarray,
        velocity: np.ndarray,
        exposure: float,
    ) -> None:
        """Takes one sample.

        Args:
            memory: of the layout.
            J: Jacobian of the tip, (6, 6), rotation first.
            r: how far the tip was seen from where it was predicted, (6,).
            weights: of the camera, one over variances, (6,).
            by_model: covariance of where the tip was predicted, (6, 6).
            variances: of what gears may be off by, rad^2, (6,).
            velocity: of the joints, rad/s, (6,).
            exposure: s, as the camera has it.
        """
        memory.lasts[0] = _LASTS if np.abs(velocity).max() > _AT_REST else _LASTS_AT_REST
        since = exposure - float(memory.exposure[0])
        # What the model is off by lasts as teeth do.
        known = samples_alike(since) * by_model, self._share * variances, _kept(memory, since)
        kernels.gears.follow(J, r, weights, USUAL, *known, memory.off, memory.P)
        memory.exposure[0] = exposure

    def lead(self, memory: SimpleNamespace, ahead: float, step: float) -> np.ndarray:
        """Leads joints aside; returns by how much in rad, and its two derivatives, (3, 6).

        Args:
            memory: of the layout.
            ahead: s, of the instant that is planned, after the last exposure.
            step: s since the last instant that was planned.
        """
        goal = -_kept(memory, ahead) * memory.off
        aside, rate = memory.aside
        before, w = rate.copy(), self.frequency
        # Implicit, so that it is stable with any step.
        rate[:] = (rate + step * w * w * (goal - aside)) / (1.0 + w * step) ** 2
        aside += step * rate
        return np.array((aside, rate, (rate - before) / step))


def samples_alike(period: float) -> float:
    """How many samples in a row say no more than one of where a robot is whose teeth are elsewhere so long.

    With white noise of so many times the variance an Ornstein-Uhlenbeck process says as much. At rest it
    lasts longer. But there the tip is to be where it is wanted, whatever keeps it from that.

    Args:
        period: s between two samples.
    """
    return 1.0 + 2.0 * _LASTS / period if period > 0.0 else 1.0


def _kept(memory: SimpleNamespace, time: float) -> float:
    """What is left after a time in s of what a joint is off by."""
    return math.exp(-max(0.0, time) / float(memory.lasts[0]))
