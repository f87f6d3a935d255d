"""How the plant is integrated: fast, and right to less than a micrometre at the tip."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pydrake.systems.analysis import ApplySimulatorConfig, GetIntegrationSchemes, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from robots.configuration.quantity import choice, quantity

# Beyond this rate the explicit runge_kutta3 with its tiny steps takes longer than the implicit radau3.
_EXPLICIT_RATE_LIMIT = 4000.0  # 1/s
# Of each scheme the accuracy that is needed, and the steps in a tick while the robot is pulled onto the path
# and after that. Loops that runge_kutta3 is for would let it make about four steps; it would try fewer after
# each tick and make them again.
_MEASURED = {"runge_kutta3": (1e-3, 5, 5), "radau3": (1e-5, 5, 2)}
# In a stiff loop the estimate of radau3's error takes the camera's noise for one and would make steps ten
# times too small. An accuracy that allows for that, 2e-3, would solve its implicit equations as loosely,
# and be off by 0.7 um. So the steps are those above, and the accuracy is that of the equations. Where these
# have no solution the integrator halves the step itself.
_OF_FIXED_STEPS = ("radau3",)
_PULLING_IN = 0.8  # s, in which a law brings the tip from centimetres away onto the path
_MARGIN = 1.01  # so that the steps in a tick leave no rest for another


@dataclass
class IntegratorConfig:
    """How the plant is integrated; read from a scenario file.

    ``auto`` is runge_kutta3, or radau3 where that one would need tiny steps. What is left open is chosen such
    that the tip is right to less than a micrometre, as the bench shows.
    """

    # Or any name of Drake's GetIntegrationSchemes
    scheme: str = choice("auto", lambda: ("auto", *GetIntegrationSchemes()))
    accuracy: float | None = quantity(None, 1e-12, 1e-1)  # relative, of each step; empty: chosen
    max_step: float | None = quantity(None, 1e-6, 0.1, "s")  # the largest step; empty: chosen


@dataclass(frozen=True)
class Change:
    """What happens to the parameters of a plant at a time."""

    time: float  # s
    apply: Callable[[Context, float], None]  # to the root context, at that time


class Integration:
    """Advances simulators of one plant and its drives."""

    def __init__(
        self, config: IntegratorConfig, period: float, rate: float, changes: Sequence[Change] = ()
    ) -> None:
        """Chooses what the configuration leaves open.

        Args:
            config: what is wanted.
            period: the tick of the controller in s.
            rate: the largest eigenvalue of plant and drives in 1/s.
            changes: in the order of their times; a simulator stops there and goes on with the changed plant.
        """
        self._changes = changes
        scheme = config.scheme
        if scheme == "auto":
            scheme = "runge_kutta3" if rate < _EXPLICIT_RATE_LIMIT else "radau3"
        self.scheme = scheme
        accuracy, first_steps, steps = _MEASURED.get(scheme, _MEASURED["runge_kutta3"])
        self._accuracy = config.accuracy or accuracy
        self._has_fixed_steps = scheme in _OF_FIXED_STEPS and config.accuracy is None
        self._first_step = config.max_step or _MARGIN * period / first_steps
        self._step = config.max_step or _MARGIN * period / steps
        self._config = SimulatorConfig(
            integration_scheme=scheme,
            max_step_size=self._first_step,
            accuracy=self._accuracy,
            use_error_control=True,
        )

    def initialize(self, simulator: Simulator) -> None:
        """Gives a simulator its integrator."""
        ApplySimulatorConfig(self._config, simulator)
        integrator = simulator.get_mutable_integrator()
        integrator.set_fixed_step_mode(self._has_fixed_steps)
        # After the configuration, which has an accuracy only for steps that are not fixed.
        integrator.set_target_accuracy(self._accuracy)
        simulator.Initialize()

    def advance(self, simulator: Simulator, until: float) -> None:
        """Advances a simulator to a time in s."""
        for change in self._changes:
            if simulator.get_context().get_time() < change.time <= until:
                self._advance(simulator, change.time)
                change.apply(simulator.get_mutable_context(), change.time)
        self._advance(simulator, until)

    def _advance(self, simulator: Simulator, until: float) -> None:
        if simulator.get_context().get_time() < _PULLING_IN:
            simulator.AdvanceTo(min(until, _PULLING_IN))
        if simulator.get_context().get_time() < until:
            simulator.get_mutable_integrator().set_maximum_step_size(self._step)
            simulator.AdvanceTo(until)
