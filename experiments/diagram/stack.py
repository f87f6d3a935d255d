"""The outermost level of a diagram: blocks one below the other, with wires around them.

Opened blocks are wide and flat, so a row of them would not fit on a page. A wire to a block further down
leaves on the right, runs back in the gap below its block and enters on the left; a wire to a block further
up runs over the top of the page.
"""

from experiments.diagram.graph import Graph, Port
from experiments.diagram.layout import LANE, MARGIN, TRACK, Box, Layout, Route, make_box


def stacked(graph: Graph) -> Layout:
    """Places the blocks of a diagram without ports of its own, and routes its wires.

    What feeds others comes first where that is possible, otherwise the block that was added last: a
    controller is added after its plant and stands above it.
    """
    boxes = [make_box(block) for block in graph.blocks]
    rank = {number: place for place, number in enumerate(reversed(range(len(boxes))))}
    wires = sorted(
        graph.connections,
        key=lambda wire: (rank[wire[0].block], -boxes[wire[0].block].outputs[wire[0].name]),
    )
    down = [wire for wire in wires if rank[wire[1].block] > rank[wire[0].block]]
    up = [wire for wire in wires if wire not in down]
    up.sort(key=lambda wire: boxes[wire[0].block].outputs[wire[0].name])
    left = MARGIN + TRACK * max(len(down), len(up), 1)
    gaps = {number: [wire for wire in down if wire[0].block == number] for number in rank}
    y = LANE * len(up) + (MARGIN if up else 0.0)
    top = y
    for number in sorted(rank, key=rank.__getitem__):
        boxes[number].x, boxes[number].y = left, y
        y += boxes[number].height + 2 * MARGIN + LANE * len(gaps[number])
    bottom, right = max(box.y + box.height for box in boxes), max(box.x + box.width for box in boxes)
    routes = []
    for number, bundle in gaps.items():
        box = boxes[number]
        for i, wire in enumerate(bundle):
            lane = box.y + box.height + MARGIN + LANE * i
            outer = left - MARGIN - TRACK * (len(bundle) - 1 - i)
            routes.append(_around(boxes, wire, box.x + box.width + MARGIN + TRACK * i, lane, outer))
    for i, wire in enumerate(up):
        routes.append(
            _around(
                boxes, wire, right + MARGIN + TRACK * i, top - MARGIN - LANE * i, left - MARGIN - TRACK * i
            )
        )
    return Layout(right + MARGIN + TRACK * len(up), bottom, boxes, routes, {}, {})


def _around(boxes: list[Box], wire: tuple[Port, Port], out: float, lane: float, back: float) -> Route:
    """Right to the track ``out``, along the lane, and down or up the track ``back``."""
    source, target = wire
    tail, head = boxes[source.block], boxes[target.block]
    start = tail.y + tail.outputs[source.name]
    end = head.y + head.inputs[target.name]
    corners = [
        (tail.x + tail.width, start),
        (out, start),
        (out, lane),
        (back, lane),
        (back, end),
        (head.x, end),
    ]
    return Route(corners)
