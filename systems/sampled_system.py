"""The base of what happens at ticks and is written in Python."""

from pydrake.systems.sensors import ImageWriter


class SampledSystem(ImageWriter):
    """A LeafSystem that has no continuous state.

    At every step the integrator asks every system for its derivatives, and one that extends `LeafSystem` in
    Python is asked in Python, even if it has none: with 15 evaluations in a tick that takes longer than most
    systems do for their work. Systems of Drake's own are not asked in Python. A writer to which no image was
    declared is one without ports, state and events, and one that Drake converts to no other scalar: it does
    not make copies in which all that is declared here is missing. Ports, state and events are declared as for
    any other LeafSystem.
    """
