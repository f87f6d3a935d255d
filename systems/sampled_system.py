"""The base of what happens at ticks and is written in Python."""

from pydrake.systems.primitives import Selector, SelectorParams


class SampledSystem(Selector):
    """A LeafSystem that has no continuous state.

    At every step the integrator asks every system for its derivatives, and one that extends `LeafSystem` in
    Python is asked in Python, even if it has none: with 15 evaluations in a tick that takes longer than most
    systems do for their work. Systems of Drake's own are not asked in Python, and a selector of nothing is
    one without ports. Ports, state and events are declared as for any other LeafSystem.
    """

    def __init__(self) -> None:
        """Has no port yet."""
        super().__init__(SelectorParams())
