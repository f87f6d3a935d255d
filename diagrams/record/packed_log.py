"""Several ports in one of Drake's vector logs: one event a tick instead of many."""

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, Multiplexer


class PackedLog:
    """Logs vector ports side by side at the same instants."""

    def __init__(self, builder: DiagramBuilder, ports: dict[str, OutputPort], period: float) -> None:
        """Adds a multiplexer and a log to a diagram that is being built.

        Args:
            builder: of the diagram that holds the ports' systems.
            ports: what to log, by name.
            period: time between two entries in s.
        """
        self._sizes = {name: port.size() for name, port in ports.items()}
        together = builder.AddNamedSystem("log_inputs", Multiplexer(list(self._sizes.values())))
        for index, port in enumerate(ports.values()):
            builder.Connect(port, together.get_input_port(index))
        self._sink = LogVectorOutput(together.get_output_port(), builder, period)

    def read(self, root_context: Context) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The times, shape (n,), and by name what was logged, shape (n, size) each."""
        log = self._sink.FindLog(root_context)
        columns = np.split(log.data(), np.cumsum(list(self._sizes.values()))[:-1])
        return log.sample_times().copy(), {
            name: part.T for name, part in zip(self._sizes, columns, strict=True)
        }

    def clear(self, root_context: Context) -> None:
        """Forgets what was logged so far."""
        self._sink.FindMutableLog(root_context).Clear()
