"""What gears with play, hysteresis and an uneven ratio yield to a load: the inverse of `DriveTrains`."""

import numpy as np

from robots.drivetrain.train import DriveTrains
from systems.feedforward.sprung_deflection import SprungDeflection

_PASSES = 5  # hysteresis is a tenth of the spring: each pass gains a digit


class GearParts:
    """Solves c(y) + D dy/dt + hysteresis(x) = -load tick by tick, and adds the error of the ratio.

    x is y and half of the gap, which is crossed smoothly, where loads bend the gear by less than that. The
    memory holds y, x and the states of the hysteresis at the last tick.
    """

    def __init__(self, trains: DriveTrains, gears: SprungDeflection) -> None:
        """Takes the parts of the trains, and springs and dampers as they are believed.

        Raises:
            ValueError: if a gear is visco-elastic: its soft branch has no inverse here.
        """
        if any(train.soft for train in trains.trains):
            raise ValueError("feedforward: the model's robot has a visco-elastic gear, which is not inverted")
        self._trains, self._gears = trains, gears
        self.memory_size = 2 * trains.size + trains.num_elements

    def at_rest(self, load: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The deflection q - theta in rad under a load in N m that has always been there, and the memory."""
        y = self._gears.at_rest(load)
        x = y + self._gap(load)
        return x + self._ratio_error(q, x), np.concatenate([y, x, np.zeros(self._trains.num_elements)])

    def step(
        self, memory: np.ndarray, load_before: np.ndarray, load: np.ndarray, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The deflection q - theta in rad one tick later, and the memory.

        Args:
            memory: of the last tick.
            load_before: in N m at the last tick, shape (n,).
            load: now.
            q: positions of the links in rad, shape (n,).
        """
        n = self._trains.size
        y_before, x_before, states = memory[:n], memory[n : 2 * n], memory[2 * n :]
        held_before = held = self._trains.hysteresis(states)
        y = x = x_before
        moved = states
        for _ in range(_PASSES):
            y = self._gears.step(y_before, load_before + held_before, load + held)
            x = y + self._gap(load + held)
            moved = self._trains.hysteresis_moved(states, x - x_before)
            held = self._trains.hysteresis(moved)
        return x + self._ratio_error(q, x), np.concatenate([y, x, moved])

    def _gap(self, load: np.ndarray) -> np.ndarray:
        half = self._trains.half_gap
        bent = -self._gears.at_rest(load)  # what the load would bend without a gap, the other way round
        return -half * np.tanh(bent / np.where(half > 0.0, half, 1.0))

    def _ratio_error(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        return self._trains.ratio_error(q - x)
