"""A picture of a Drake diagram: as text for graphviz, or as SVG."""

from collections.abc import Iterator
from html import escape
from pathlib import Path

from pydrake.systems.framework import Diagram, System

from experiments.diagram.graph import read_graph
from experiments.diagram.layout import HEADER, Box, Layout, Route
from experiments.diagram.stack import stacked
from systems.sampled_system import SampledSystem

EDGE = 24  # px around the picture
INK, SOFT, LINE, WIRE = "#1c2430", "#5b6673", "#aab4bf", "#33658a"
FILLS = ("#f1f4f7", "#e4eaf0")  # of opened diagrams, by level
ENDINGS = (".svg", ".dot")


def write_diagram(path: Path, diagram: Diagram, depth: int) -> None:
    """Writes a picture of a diagram, ``.svg`` or ``.dot``.

    Args:
        path: where to; the ending says which.
        diagram: what to draw.
        depth: how many levels of diagrams are opened; 1 shows the systems of this one.

    Raises:
        ValueError: if the ending is another or the depth is not positive.
        OSError: if the file cannot be written.
    """
    if path.suffix not in ENDINGS:
        raise ValueError(f"--write {path.name}: the ending must be one of {', '.join(ENDINGS)}")
    if depth < 1:
        raise ValueError(f"--depth must be at least 1, got {depth}")
    text = dot(diagram, depth) if path.suffix == ".dot" else svg(diagram, depth)
    path.write_text(text, encoding="utf-8")


def dot(diagram: Diagram, depth: int) -> str:
    """The diagram as text for graphviz."""
    text = diagram.GetGraphvizString(max_depth=depth)
    # Drake knows these systems by the class that they extend; it names all in this order.
    for system in _systems(diagram):
        if isinstance(system, SampledSystem):
            title, name = "<B>{}</B><BR/>\nname={}\n", system.get_name()
            known = title.format(SampledSystem.mro()[1].__name__, name)
            text = text.replace(known, title.format(type(system).__name__, name), 1)
    return text


def _systems(diagram: Diagram) -> Iterator[System]:
    for system in diagram.GetSystems():
        yield system
        if isinstance(system, Diagram):
            yield from _systems(system)


def svg(diagram: Diagram, depth: int) -> str:
    """The diagram as an SVG document: its systems one below the other, what is in them from left to right."""
    page = stacked(read_graph(diagram, depth))
    width, height = page.width + 2 * EDGE, page.height + 2 * EDGE
    body = "\n".join(_page(page, EDGE, EDGE, 0))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="system-ui, sans-serif" font-size="12" fill="{INK}">\n'
        f"<title>{escape(diagram.get_name())}</title>\n"
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
        f'orient="auto"><path d="M0,0.5L8,4L0,7.5z" fill="{WIRE}"/></marker></defs>\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{body}\n</svg>\n'
    )


def _page(page: Layout, x: float, y: float, level: int) -> list[str]:
    """Boxes, then the wires over them; x and y are the corner of the page."""
    parts = [part for box in page.boxes for part in _box(box, x, y, level)]
    return parts + [_wire(route, x, y) for route in page.wires]


def _box(box: Box, x: float, y: float, level: int) -> list[str]:
    assert box.block is not None
    x, y = x + box.x, y + box.y
    left = f'<text x="{x + 12:.1f}"'
    opened = box.inside is not None
    fill = FILLS[min(level, len(FILLS) - 1)] if opened else "#ffffff"
    parts = [
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" '
        f'rx="{8 if opened else 5}" fill="{fill}" stroke="{LINE}"/>',
        f'{left} y="{y + 19:.1f}" font-size="14" font-weight="600">{escape(box.block.name)}</text>',
        f'{left} y="{y + 34:.1f}" font-size="11" fill="{SOFT}">{escape(box.block.kind)}</text>',
    ]
    for ports, edge, anchor, shift in (
        (box.inputs, x, "start", 7),
        (box.outputs, x + box.width, "end", -7),
    ):
        for name, offset in ports.items():
            height = y + offset
            # The names of an opened diagram stand over its wires.
            rise = -4 if opened else 4
            parts.append(
                f'<text x="{edge + shift:.1f}" y="{height + rise:.1f}" font-size="{11.5 if opened else 11}" '
                f'fill="{INK if opened else SOFT}" text-anchor="{anchor}">{escape(name)}</text>'
            )
            parts.append(
                f'<circle cx="{edge:.1f}" cy="{height:.1f}" r="2.6" fill="#ffffff" stroke="{WIRE}"/>'
                if opened
                else ""
            )
    if box.inside is not None:
        parts += _page(box.inside, x, y + HEADER + 8, level + 1)
    return [part for part in parts if part]


def _wire(route: Route, x: float, y: float) -> str:
    corners = [(x + px, y + py) for px, py in route.corners]
    path = "M" + "L".join(f"{px:.1f},{py:.1f}" for px, py in corners)
    tip = ' marker-end="url(#tip)"' if route.has_tip else ""
    return f'<path d="{path}" fill="none" stroke="{WIRE}" stroke-width="1.3"{tip}/>'
