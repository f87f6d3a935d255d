"""A connection as it may be in a hall full of machines: late, lost, doubled, out of order, or not itself."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robots.configuration.quantity import quantity


@dataclass
class FaultConfig:
    """What goes wrong; shares are of datagrams; read from a scenario file."""

    loss: float = quantity(0.0, 0.0, 1.0)  # share that never arrives
    duplication: float = quantity(0.0, 0.0, 1.0)  # share that arrives twice
    reordering: float = quantity(0.0, 0.0, 1.0)  # share that is overtaken by the next one
    jitter: float = quantity(0.0, 0.0, 1.0, "s")  # largest additional delay
    burst: float = quantity(0.0, 0.0, 1.0)  # share at which a burst of losses begins
    burst_length: int = quantity(10, 1, 100000)  # datagrams
    garbage: float = quantity(0.0, 0.0, 1.0)  # share before which a datagram of random bytes arrives
    wrong_sender: float = quantity(0.0, 0.0, 1.0)  # share of which a changed copy arrives from another port
    stall_at: float = -1.0  # s of the cell's time at which nothing gets through any more; negative: never
    stall_for: float = 1.0  # s
    stop_at: float = -1.0  # s at which the controller's program is stopped; negative: never
    deaf_at: float = -1.0  # s at which it says that it follows commands and follows none; negative: never
    clock_step_at: float = -1.0  # s at which the controller's clock is set; negative: never
    clock_step: float = quantity(1.0, -100.0, 100.0, "s")  # by which it is set
    joint_jump_at: float = -1.0  # s at which a joint is suddenly measured elsewhere; negative: never
    joint_jump_deg: float = quantity(20.0, -360.0, 360.0, "deg")  # of joint 1
    lost_body_at: float = -1.0  # s from which the camera does not see the body; negative: never
    lost_body_for: float = 1.0  # s
    clock_drift_ppm: float = quantity(0.0, -1e5, 1e5, "ppm")  # of the camera's clock against the controller's

    def is_stalled(self, time: float) -> bool:
        """Whether nothing gets through."""
        return 0.0 <= self.stall_at <= time < self.stall_at + self.stall_for

    def is_deaf(self, time: float) -> bool:
        """Whether the controller takes no commands, and does not say so."""
        return 0.0 <= self.deaf_at <= time

    def clock_offset(self, time: float) -> float:
        """By how much the controller's clock has been set, in s."""
        return self.clock_step if 0.0 <= self.clock_step_at <= time else 0.0

    def joint_offset(self, time: float) -> np.ndarray:
        """By how much the joints are measured elsewhere, (6,) in rad."""
        jump = self.joint_jump_deg if 0.0 <= self.joint_jump_at <= time else 0.0
        return np.deg2rad([jump, 0.0, 0.0, 0.0, 0.0, 0.0])

    def is_body_lost(self, time: float) -> bool:
        """Whether the camera does not see the body."""
        return 0.0 <= self.lost_body_at <= time < self.lost_body_at + self.lost_body_for


SHARES = ("loss", "duplication", "reordering", "burst", "garbage", "wrong_sender")


class Delivery(NamedTuple):
    """A datagram on its way."""

    time: float  # s, when it arrives
    data: bytes
    is_foreign: bool  # it comes from somebody else


class FaultyLink:
    """Decides the fate of datagrams, the same for the same seed."""

    def __init__(self, config: FaultConfig, period: float, seed: int) -> None:
        """Checks the configuration.

        Args:
            config: what goes wrong.
            period: between two datagrams in s; an overtaken one comes after one and a half of it.
            seed: of chance.

        Raises:
            ValueError: if a share is not in [0, 1] or a time negative.
        """
        for name in SHARES:
            if not 0.0 <= getattr(config, name) <= 1.0:
                raise ValueError(f"faults: {name} must be between 0 and 1, got {getattr(config, name)}")
        if not (config.jitter >= 0.0 and config.burst_length >= 1 and config.stall_for >= 0.0):
            raise ValueError("faults: jitter, burst_length and stall_for must not be negative")
        self._config, self._period = config, period
        self._random = np.random.default_rng(seed)
        self._burst_left = 0
        self.counts: dict[str, int] = dict.fromkeys(("lost", "doubled", "overtaken", "garbage", "foreign"), 0)

    def pass_on(self, time: float, data: bytes) -> list[Delivery]:
        """What arrives of a datagram, and when."""
        config = self._config
        loss, double, reorder, burst, garbage, foreign, late, late_again = self._random.random(8)
        deliveries = []
        if garbage < config.garbage:
            self.counts["garbage"] += 1
            size = int(self._random.integers(1, 400))
            deliveries.append(Delivery(time, self._random.bytes(size), False))
        if foreign < config.wrong_sender:
            self.counts["foreign"] += 1
            deliveries.append(Delivery(time, data, True))
        if self._burst_left == 0 and burst < config.burst:
            self._burst_left = config.burst_length
        if config.is_stalled(time) or self._burst_left > 0 or loss < config.loss:
            self._burst_left = max(0, self._burst_left - 1)
            self.counts["lost"] += 1
            return deliveries
        arrival = time + config.jitter * late
        if reorder < config.reordering:
            self.counts["overtaken"] += 1
            arrival += 1.5 * self._period
        deliveries.append(Delivery(arrival, data, False))
        if double < config.duplication:
            self.counts["doubled"] += 1
            deliveries.append(Delivery(arrival + config.jitter * late_again, data, False))
        return deliveries
