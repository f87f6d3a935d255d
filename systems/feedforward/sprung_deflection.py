"""How far springs and dampers in parallel yield to a load, and how they get there."""

import numpy as np

from robots.drivetrain.stiffness import GearSpring

_NEWTON_STEPS = 60  # at most; one or two if the load changes little in a tick
_CONVERGED = 1e-7  # of a deflection: Newton's next step would be about its square


class SprungDeflection:
    """Solves c(x) + D dx/dt = -load tick by tick, Reiner (2010) eqs. (3.78), (3.93), for many joints at once.

    The poles at K / D are hundreds to thousands of 1/s, beyond what a tick resolves. So the linear part is
    integrated exactly for a load that changes linearly in a tick: stable and bounded at any tick, with any
    damping and with none. What a nonlinear spring has beyond its tangent counts as load and is solved for by
    Newton's method, which converges because the spring is monotone and stiffens.
    """

    def __init__(
        self, stiffness: np.ndarray, damping: np.ndarray, period: float, spring: GearSpring | None = None
    ) -> None:
        """Sets the springs.

        Args:
            stiffness: in N m / rad, shape (n,); of a nonlinear spring, its stiffness at rest.
            damping: in N m s / rad, shape (n,).
            period: tick in s.
            spring: nonlinear characteristics in place of the linear ones: one for all joints, or a row of n.

        Raises:
            ValueError: if a stiffness is not positive or a damping is negative.
        """
        if not np.min(stiffness, initial=np.inf) > 0.0:
            raise ValueError(f"sprung joints: stiffness must be positive, got {np.min(stiffness)} N m/rad")
        if np.min(damping, initial=0.0) < 0.0:
            raise ValueError(f"sprung joints: damping must not be negative, got {np.min(damping)} N m s/rad")
        self._stiffness, self._damping, self._period, self._spring = stiffness, damping, period, spring
        self._gains = self._step_gains(stiffness)

    def at_rest(self, load: np.ndarray) -> np.ndarray:
        """Deflections in rad under a load in N m that has always been there, shape (n,)."""
        return -load / self._stiffness if self._spring is None else self._spring.deflection(-load)

    def step(self, deflection: np.ndarray, load_before: np.ndarray, load: np.ndarray) -> np.ndarray:
        """The deflections one tick later.

        Args:
            deflection: in rad at the last tick, shape (n,).
            load_before: in N m at the last tick, shape (n,).
            load: now.
        """
        if self._spring is None:
            decay, of_before, of_now = self._gains
            return decay * deflection - of_before * load_before - of_now * load
        # k x + D dx/dt = -(load + c(x) - k x) with the tangent k at the last deflection.
        spring, k = self._spring, self._spring.stiffness(deflection)
        decay, of_before, of_now = self._step_gains(k)
        known = decay * deflection - of_now * load
        known -= of_before * (load_before + spring.torque(deflection) - k * deflection)
        x = deflection
        for _ in range(_NEWTON_STEPS):
            excess = x - known + of_now * (spring.torque(x) - k * x)
            step = excess / (1.0 + of_now * (spring.stiffness(x) - k))
            x = x - step
            if (np.abs(step) <= _CONVERGED * np.abs(x)).all():
                break
        return x

    def _step_gains(self, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the last deflection, the last load and the new one weigh in the new deflection."""
        retardation = self._damping / stiffness / self._period  # in ticks
        with np.errstate(divide="ignore", over="ignore"):
            decay = np.exp(-1.0 / retardation)  # no damping: no memory
            lag = -retardation * np.expm1(-1.0 / retardation)
        return decay, (lag - decay) / stiffness, (1.0 - lag) / stiffness
