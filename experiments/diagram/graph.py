"""The structure of a Drake diagram: systems, connected ports and connections."""

from dataclasses import dataclass, field

from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System
from pydrake.systems.primitives import VectorLogSink

OUTSIDE = -1  # in place of a block: the port belongs to the diagram that holds the blocks


@dataclass(frozen=True)
class Port:
    """A port of a block, by name."""

    block: int  # index in Graph.blocks, or OUTSIDE
    name: str


@dataclass
class Block:
    """A system: its name, its class, the names of its ports, and what is in it if it is opened."""

    name: str
    kind: str
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    inside: "Graph | None" = None


@dataclass
class Graph:
    """The blocks of one diagram, and its connections from port to port.

    A connection from OUTSIDE comes from an input of the diagram, one to OUTSIDE goes to an output of it.
    """

    blocks: list[Block]
    connections: list[tuple[Port, Port]]


def read_graph(diagram: Diagram, depth: int) -> Graph:
    """The structure of a diagram; diagrams in it are opened up to ``depth`` levels, the first being itself.

    Logs, and what feeds nothing but logs, are left out. A system shows the ports that are connected, an
    opened diagram shows all of its ports.
    """
    outgoing: dict[int, list[int]] = {}
    wires = [(*source, *target) for target, source in diagram.connection_map().items()]
    for source, _, target, _ in wires:
        outgoing.setdefault(id(source), []).append(id(target))
    hidden = _feeding_only_logs(diagram, outgoing)
    systems = [system for system in diagram.GetSystems() if id(system) not in hidden]
    number = {id(system): i for i, system in enumerate(systems)}
    connections = [
        (_output(number, source, i), _input(number, target, j))
        for source, i, target, j in wires
        if id(source) in number and id(target) in number
    ]
    for i in range(diagram.num_input_ports()):
        port = Port(OUTSIDE, diagram.get_input_port(i).get_name())
        locators = diagram.GetInputPortLocators(InputPortIndex(i))
        connections += [(port, _input(number, *locator)) for locator in locators]
    for i in range(diagram.num_output_ports()):
        port = Port(OUTSIDE, diagram.get_output_port(i).get_name())
        connections.append((_output(number, *diagram.get_output_port_locator(OutputPortIndex(i))), port))
    # A map of connections has no order of its own.
    connections.sort(key=lambda wire: (wire[0].block, wire[0].name, wire[1].block, wire[1].name))
    blocks = [_block(system, i, connections, depth - 1) for i, system in enumerate(systems)]
    return Graph(blocks, connections)


def _feeding_only_logs(diagram: Diagram, outgoing: dict[int, list[int]]) -> set[int]:
    hidden = {id(system) for system in diagram.GetSystems() if isinstance(system, VectorLogSink)}
    exported = {
        id(diagram.get_output_port_locator(OutputPortIndex(i))[0]) for i in range(diagram.num_output_ports())
    }
    while True:
        found = {source for source, targets in outgoing.items() if hidden.issuperset(targets)} - exported
        if found <= hidden:
            return hidden
        hidden |= found


def _block(system: System, number: int, connections: list[tuple[Port, Port]], depth: int) -> Block:
    inputs = [system.get_input_port(i).get_name() for i in range(system.num_input_ports())]
    outputs = [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
    block = Block(system.get_name(), type(system).__name__, inputs, outputs)
    if isinstance(system, Diagram) and depth > 0:
        block.inside = read_graph(system, depth)
    else:
        ends = {port for wire in connections for port in wire}
        block.inputs = [name for name in inputs if Port(number, name) in ends]
        block.outputs = [name for name in outputs if Port(number, name) in ends]
    return block


def _input(number: dict[int, int], system: System, index: int) -> Port:
    return Port(number[id(system)], system.get_input_port(int(index)).get_name())


def _output(number: dict[int, int], system: System, index: int) -> Port:
    return Port(number[id(system)], system.get_output_port(int(index)).get_name())
