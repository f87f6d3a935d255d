"""Layout of a block diagram: placement of blocks and routing of wires.

Blocks stand in columns, so that wires run from left to right through the channels between the columns; a
wire that closes a loop runs back in a lane below. Lengths are in pixels, y points down.
"""

from collections import defaultdict
from dataclasses import dataclass, field
from itertools import permutations

from experiments.diagram.graph import OUTSIDE, Block, Graph, Port

HEADER = 42  # px, name and class of a block
ROW = 19  # per port
GAP = 26  # between blocks of a column
TRACK = 11  # between wires of a channel
MARGIN = 16  # on both sides of a channel
LANE = 13  # between wires that run back
SWEEPS = 12
CHARACTER = 6.7  # width of a letter of a port's name
LARGEST_SEARCH = 6  # wires of a channel whose order is searched in full

Wire = tuple[Port, Port]


@dataclass
class Box:
    """A block on the page, or a thing of no width that a wire passes: a port of the frame, a bend."""

    block: Block | None
    column: int = 0
    width: float = 0.0
    height: float = 0.0
    inputs: dict[str, float] = field(default_factory=dict)  # y of each port below the top
    outputs: dict[str, float] = field(default_factory=dict)
    x: float = 0.0
    y: float = 0.0
    inside: "Layout | None" = None


@dataclass
class Route:
    """The corners of a wire, and whether it ends at a block."""

    corners: list[tuple[float, float]]
    has_tip: bool = True


@dataclass
class Layout:
    """A finished page: boxes, the corners of every wire, and the ports on the frame."""

    width: float
    height: float
    boxes: list[Box]
    wires: list["Route"]
    inputs: dict[str, float]  # y on the left edge
    outputs: dict[str, float]  # y on the right edge


@dataclass
class _Hop:
    """A piece of a wire through one channel, from a height on its left to a height on its right."""

    net: Port
    channel: int
    start: float
    end: float


def layout(graph: Graph) -> Layout:
    """Places the blocks of a diagram and routes its wires."""
    page = _Page(graph)
    page.assign_columns()
    page.add_bends()
    page.place_vertically()
    return page.route()


class _Page:
    """The steps of `layout` and what they share."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.boxes = {i: make_box(block) for i, block in enumerate(graph.blocks)}
        self.loops = _closing_a_loop(graph)
        self.hops: list[tuple[tuple, str, tuple, str, Port]] = []  # from (box, port) to (box, port)

    def assign_columns(self) -> None:
        """Every block right of what feeds it; a source stands just left of what it feeds."""
        forward = [
            (source.block, target.block)
            for source, target in self.graph.connections
            if OUTSIDE not in (source.block, target.block) and (source, target) not in self.loops
        ]
        for _ in self.boxes:
            for source, target in forward:
                self.boxes[target].column = max(self.boxes[target].column, self.boxes[source].column + 1)
        fed = {target for _, target in forward}
        fed |= {target.block for source, target in self.graph.connections if source.block == OUTSIDE}
        for i, box in self.boxes.items():
            followers = [self.boxes[target].column for source, target in forward if source == i]
            if i not in fed and followers:
                box.column = min(followers) - 1
        self.last = max((box.column for box in self.boxes.values()), default=0)

    def add_bends(self) -> None:
        """Ports of the frame and bends in the columns that a wire crosses, so that all hops are short."""
        self.items: dict[tuple, Box] = {("block", i): box for i, box in self.boxes.items()}
        for block_ports, side, column in (
            ({s.name: None for s, _ in self.graph.connections if s.block == OUTSIDE}, "in", -1),
            ({t.name: None for _, t in self.graph.connections if t.block == OUTSIDE}, "out", self.last + 1),
        ):
            for name in block_ports:
                # Its name stands over the wire.
                self.items[side, name] = Box(
                    None, column, CHARACTER * len(name) + 6, 0.0, {name: 0.0}, {name: 0.0}
                )
        for source, target in self.graph.connections:
            if (source, target) in self.loops:
                continue
            here = ("in", source.name) if source.block == OUTSIDE else ("block", source.block)
            goal = ("out", target.name) if target.block == OUTSIDE else ("block", target.block)
            port = source.name
            for column in range(self.items[here].column + 1, self.items[goal].column):
                bend = ("bend", source, column)
                if bend not in self.items:
                    self.items[bend] = Box(None, column, 0.0, 0.0, {"": 0.0}, {"": 0.0})
                self._hop(here, port, bend, "", source)
                here, port = bend, ""
            self._hop(here, port, goal, target.name, source)

    def _hop(self, here: tuple, port: str, goal: tuple, goal_port: str, net: Port) -> None:
        hop = (here, port, goal, goal_port, net)
        if hop not in self.hops:
            self.hops.append(hop)

    def place_vertically(self) -> None:
        """Pulls every box to the height of its neighbours, left and right in turn, and orders by that."""
        columns: dict[int, list[tuple]] = defaultdict(list)
        for key, box in self.items.items():
            columns[box.column].append(key)
        for keys in columns.values():
            self._stack(keys, [0.0] * len(keys))
        for sweep in range(SWEEPS):
            is_late = sweep >= SWEEPS - 4
            sides = (True, True) if is_late else (sweep % 2 == 0, sweep % 2 == 1)
            for column in sorted(columns, reverse=sweep % 2 == 1):
                keys = columns[column]
                pulls = [self._pull(key, sides) for key in keys]
                if not is_late:
                    middles = [
                        pull + 0.5 * self.items[key].height for key, pull in zip(keys, pulls, strict=True)
                    ]
                    order = sorted(range(len(keys)), key=middles.__getitem__)
                    columns[column] = keys = [keys[i] for i in order]
                    pulls = [pulls[i] for i in order]
                self._stack(keys, pulls)
        for column in (-1, self.last + 1):
            self._stack(columns[column], [self._pull(key, (True, True)) for key in columns[column]])
        top = min(box.y for box in self.items.values())
        for box in self.items.values():
            box.y -= top
        self.bottom = max(box.y + box.height for box in self.items.values())

    def _pull(self, key: tuple, sides: tuple[bool, bool]) -> float:
        """Where a box would stand if its wires on these sides, left and right, ran straight."""
        heights: list[list[float]] = [[], []]
        for here, port, goal, goal_port, _ in self.hops:
            source, target = self.items[here], self.items[goal]
            if goal == key:
                heights[0].append(source.y + source.outputs[port] - target.inputs[goal_port])
            elif here == key:
                heights[1].append(target.y + target.inputs[goal_port] - source.outputs[port])
        if key[0] == "bend" and all(sides):
            sides = (True, False)  # between two heights a wire need not take a third
        chosen = [height for side, wanted in zip(heights, sides, strict=True) if wanted for height in side]
        chosen = chosen or heights[0] + heights[1]
        return sum(chosen) / len(chosen) if chosen else self.items[key].y

    def _stack(self, keys: list[tuple], wanted: list[float]) -> None:
        """The heights nearest to the wanted ones, least squares, at which no two boxes overlap."""
        offset, offsets = 0.0, []
        for above, key in zip([None, *keys], keys, strict=False):
            if above is not None:
                thin = self.items[above].block is None and self.items[key].block is None
                offset += self.items[above].height + (ROW if thin else GAP)
            offsets.append(offset)
        groups: list[list[float]] = []  # pooled neighbours: sum of wanted heights, count
        for height, shift in zip(wanted, offsets, strict=True):
            groups.append([height - shift, 1.0])
            while len(groups) > 1 and groups[-2][0] / groups[-2][1] > groups[-1][0] / groups[-1][1]:
                total, count = groups.pop()
                groups[-1][0] += total
                groups[-1][1] += count
        levels = [total / count for total, count in groups for _ in range(int(count))]
        for key, level, shift in zip(keys, levels, offsets, strict=True):
            self.items[key].y = level + shift

    def route(self) -> Layout:
        """Gives every wire a track in each channel, and the columns their places."""
        hops = [
            _Hop(
                net,
                self.items[here].column,
                self.items[here].y + self.items[here].outputs[port],
                self.items[goal].y + self.items[goal].inputs[goal_port],
            )
            for here, port, goal, goal_port, net in self.hops
        ]
        lanes: dict[Port, float] = {}
        for source, target in sorted(self.loops, key=lambda wire: -self._span(wire)):
            lane = lanes.setdefault(source, self.bottom + MARGIN + LANE * len(lanes))
            tail, head = self.boxes[source.block], self.boxes[target.block]
            hops.append(_Hop(source, tail.column, tail.y + tail.outputs[source.name], lane))
            hops.append(_Hop(source, head.column - 1, lane, head.y + head.inputs[target.name]))
        tracks = {
            channel: _tracks([h for h in hops if h.channel == channel])
            for channel in range(-1, self.last + 1)
        }
        self._place_horizontally(tracks)
        right = self.right
        wires = [self._forward_wire(hop, tracks) for hop in self.hops]
        wires += [self._loop_wire(wire, lanes[wire[0]], tracks) for wire in sorted(self.loops, key=str)]
        height = self.bottom + (MARGIN + LANE * len(lanes) if lanes else 0.0)
        frame = {
            side: {key[1]: box.y for key, box in self.items.items() if key[0] == side}
            for side in ("in", "out")
        }
        return Layout(right, height, list(self.boxes.values()), wires, frame["in"], frame["out"])

    def _span(self, wire: Wire) -> int:
        return self.boxes[wire[0].block].column - self.boxes[wire[1].block].column

    def _place_horizontally(self, tracks: dict[int, dict[Port, int]]) -> None:
        """The x of every column and of every track, channel by channel."""
        x, self.channel_x = 0.0, {}
        for column in range(-1, self.last + 2):
            widths = [box.width for box in self.items.values() if box.column == column]
            width = max(widths, default=0.0)
            for box in self.items.values():
                if box.column == column:
                    box.x = x + 0.5 * (width - box.width)
            x += width
            if column <= self.last:
                self.channel_x[column] = x + MARGIN
                count = len(set(tracks[column].values()))
                x += 2 * MARGIN + TRACK * max(0, count - 1)
        self.right = x

    def _track_x(self, net: Port, channel: int, tracks: dict[int, dict[Port, int]]) -> float:
        return self.channel_x[channel] + TRACK * tracks[channel].get(net, 0)

    def _forward_wire(self, hop: tuple, tracks: dict[int, dict[Port, int]]) -> Route:
        here, port, goal, goal_port, net = hop
        tail, head = self.items[here], self.items[goal]
        start = (0.0 if here[0] == "in" else tail.x + tail.width, tail.y + tail.outputs[port])
        end = (self.right if goal[0] == "out" else head.x, head.y + head.inputs[goal_port])
        x = self._track_x(net, tail.column, tracks)
        return Route([start, (x, start[1]), (x, end[1]), end], has_tip=goal[0] == "block")

    def _loop_wire(self, wire: Wire, lane: float, tracks: dict[int, dict[Port, int]]) -> Route:
        source, target = wire
        tail, head = self.boxes[source.block], self.boxes[target.block]
        start = (tail.x + tail.width, tail.y + tail.outputs[source.name])
        end = (head.x, head.y + head.inputs[target.name])
        out, back = (self._track_x(source, column, tracks) for column in (tail.column, head.column - 1))
        return Route([start, (out, start[1]), (out, lane), (back, lane), (back, end[1]), end])


def make_box(block: Block) -> Box:
    """A block with the size that its inside or its names need, and the places of its ports."""
    if block.inside is not None:
        inside = layout(block.inside)
        top = HEADER + 8
        box = Box(block, 0, inside.width, inside.height + top + MARGIN, inside=inside)
        box.inputs = {name: top + y for name, y in inside.inputs.items()}
        box.outputs = {name: top + y for name, y in inside.outputs.items()}
        return box
    sides = [
        max((CHARACTER * len(name) for name in names), default=0.0) for names in (block.inputs, block.outputs)
    ]
    width = max(sum(sides) + 38, 8.2 * len(block.name) + 28, CHARACTER * len(block.kind) + 28)
    box = Box(block, 0, width, HEADER + ROW * max(len(block.inputs), len(block.outputs)) + 8)
    box.inputs = {name: HEADER + ROW * (i + 0.5) for i, name in enumerate(block.inputs)}
    box.outputs = {name: HEADER + ROW * (i + 0.5) for i, name in enumerate(block.outputs)}
    return box


def _closing_a_loop(graph: Graph) -> set[Wire]:
    """The wires that lead back, when one follows the signals from the inputs of the diagram on."""
    followers: dict[int, list[Wire]] = defaultdict(list)
    for source, target in graph.connections:
        if OUTSIDE not in (source.block, target.block):
            followers[source.block].append((source, target))
    fed = [target.block for source, target in graph.connections if source.block == OUTSIDE]
    loops: set[Wire] = set()
    done: set[int] = set()

    def follow(block: int, trail: tuple[int, ...]) -> None:
        for wire in followers[block]:
            goal = wire[1].block
            if goal in (*trail, block):
                loops.add(wire)
            elif goal not in done:
                follow(goal, (*trail, block))
        done.add(block)

    # Where nothing comes in from outside, the last block that was added, a controller, comes first.
    for block in [*fed, *reversed(range(len(graph.blocks)))]:
        if block not in done:
            follow(block, ())
    return loops


def _tracks(hops: list[_Hop]) -> dict[Port, int]:
    """A track for every wire of a channel that has to change its height, so that few of them cross."""
    nets: dict[Port, list[_Hop]] = defaultdict(list)
    for hop in hops:
        nets[hop.net].append(hop)
    bent = [net for net, pieces in nets.items() if any(abs(p.start - p.end) > 0.5 for p in pieces)]
    # Downwards the wire that starts lowest turns first, upwards the one that starts highest.
    first = {net: pieces[0] for net, pieces in nets.items()}
    bent.sort(key=lambda net: first[net].start * (-1.0 if first[net].end > first[net].start else 1.0))
    if len(bent) <= LARGEST_SEARCH:
        bent = list(min(permutations(bent), key=lambda order: _crossings(order, nets)))
    return {net: i for i, net in enumerate(bent)}


def _crossings(order: tuple[Port, ...], nets: dict[Port, list[_Hop]]) -> int:
    """How often the wires of a channel cross if their tracks stand in this order."""
    count = 0
    spans = {
        net: (min(min(h.start, h.end) for h in nets[net]), max(max(h.start, h.end) for h in nets[net]))
        for net in order
    }
    for i, left in enumerate(order):
        for right in order[i + 1 :]:
            low, high = spans[left]
            count += sum(low < start < high for start in {h.start for h in nets[right]})
            low, high = spans[right]
            count += sum(low < end < high for end in {h.end for h in nets[left]})
    return count
