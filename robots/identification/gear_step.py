"""What six gears with play and hysteresis carry at the end of a time step, with all derivatives.

The same equations as `robots.drivetrain.train.DriveTrains` and `DahlHysteresis`, stepped: gears are asked for
their torque at the end of a step that began with known deflections.
"""

from dataclasses import dataclass

import numpy as np

from robots.identification.elastic_parameters import ArmNumbers

_GEARS = slice(0, 6)


@dataclass(frozen=True)
class GearStep:
    """Torques and derivatives at the end of a step; shape (cases, 6) each."""

    torque: np.ndarray  # N m
    hysteresis: np.ndarray  # rad, state of its element
    by_turn: np.ndarray  # N m / rad
    by_rate: np.ndarray  # N m s / rad
    kept: np.ndarray  # d(state) / d(state before)
    state_by_turn: np.ndarray  # d(state) / d(deflection), the negative of that by the one before
    is_out: np.ndarray  # 1 where teeth touch, else 0
    elastic: np.ndarray  # N m of spring and damper where they touch
    damped: np.ndarray  # N m of the damper where they touch
    oiled: np.ndarray  # N m of the lubricant


class Gears:
    """The gears of one set of parameters."""

    def __init__(self, numbers: ArmNumbers) -> None:
        """Takes the numbers of the arm."""
        self.c = numbers.stiffness[_GEARS]
        self.d = self.c * numbers.time[_GEARS]
        self.half_gap = 0.5 * numbers.play
        self.oil = np.where(numbers.play > 0.0, numbers.lubricant, 0.0) * self.d
        self.held = numbers.hysteresis * self.c
        self.width = numbers.width

    def at_rest(self, load: np.ndarray) -> np.ndarray:
        """Deflections in rad that carry loads in N m with relaxed hysteresis, any shape (..., 6)."""
        return load / self.c + np.sign(load) * self.half_gap

    def step(self, before: np.ndarray, z: np.ndarray, turn: np.ndarray, rate: np.ndarray) -> GearStep:
        """One step.

        Args:
            before: deflections at its beginning in rad.
            z: states of the hysteresis then in rad.
            turn: deflections at its end in rad.
            rate: their rates then in rad/s.
        """
        beyond = turn - np.clip(turn, -self.half_gap, self.half_gap)
        elastic = self.c * beyond + self.d * rate
        # Without a gap nothing parts.
        out = np.where(self.half_gap > 0.0, elastic * beyond > 0.0, True).astype(float)
        moved = turn - before
        direction, fall = np.sign(moved), np.exp(-np.abs(moved) / self.width)
        end = direction * self.width
        state = end + (z - end) * fall
        state_by_turn = 1.0 - direction * state / self.width
        return GearStep(
            torque=out * elastic + self.oil * rate + self.held * state,
            hysteresis=state,
            by_turn=out * self.c + self.held * state_by_turn,
            by_rate=out * self.d + self.oil,
            kept=fall,
            state_by_turn=state_by_turn,
            is_out=out,
            elastic=out * elastic,
            damped=out * self.d * rate,
            oiled=self.oil * rate,
        )
