"""The base of what happens at ticks and is written in Python."""

from collections.abc import Callable
from typing import Any

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, DependencyTicket, OutputPort
from pydrake.systems.primitives import Selector, SelectorParams


class SampledSystem(Selector):
    """A LeafSystem that has no continuous state.

    At every step the integrator asks every system for its derivatives, and one that extends `LeafSystem` in
    Python is asked in Python, even if it has none: with 15 evaluations in a tick that takes longer than most
    systems do for their work. Systems of Drake's own are not asked in Python, and a selector of nothing is
    one without ports. Ports, state and events are declared as for any other LeafSystem.

    To automatic differentiation and symbols it is a selector of nothing: a diagram in which it stands cannot
    be converted to them.
    """

    def __init__(self) -> None:
        """Has no port yet."""
        super().__init__(SelectorParams())

    def DeclareVectorOutputPort(  # noqa: N802
        self,
        name: str,
        model: int | BasicVector,
        calc: Callable[[Context, BasicVector], None],
        prerequisites_of_calc: set[DependencyTicket] | None = None,
    ) -> OutputPort:
        """As a LeafSystem does; ``model`` is the size or a vector of it."""
        return super().DeclareVectorOutputPort(name, model, calc, self._sources(prerequisites_of_calc))

    def DeclareAbstractOutputPort(  # noqa: N802
        self,
        name: str,
        alloc: Callable[[], AbstractValue],
        calc: Callable[[Context, Any], None],
        prerequisites_of_calc: set[DependencyTicket] | None = None,
    ) -> OutputPort:
        """As a LeafSystem does."""
        return super().DeclareAbstractOutputPort(name, alloc, calc, self._sources(prerequisites_of_calc))

    def _sources(self, given: set[DependencyTicket] | None) -> set[DependencyTicket]:
        """All sources one by one where they are not said, or said to be all.

        Of an output that depends on "all sources" Drake looks for the inputs in a symbolic copy, which is a
        selector of nothing here: it would read beyond its end, and the process would crash.
        """
        if given not in (None, {self.all_sources_ticket()}):
            return given
        return {
            self.time_ticket(),
            self.accuracy_ticket(),
            self.all_state_ticket(),
            self.all_parameters_ticket(),
            self.all_input_ports_ticket(),
        }
