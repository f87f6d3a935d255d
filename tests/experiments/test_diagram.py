"""The picture of the diagram shows what is simulated, and one can read it."""

from pathlib import Path
from xml.etree import ElementTree

import pytest
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import VectorLogSink

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from experiments.diagram.graph import OUTSIDE, read_graph
from experiments.diagram.layout import Layout
from experiments.diagram.stack import stacked
from experiments.diagram.view import svg
from tests.experiments.commands import truetip

TEXT = "{http://www.w3.org/2000/svg}text"


@pytest.fixture(scope="module")
def diagram() -> Diagram:
    return Experiment(load_scenario("misaligned"), "pbvs", is_nested=True).diagram


def pages(page: Layout) -> list[Layout]:
    return [page, *(inner for box in page.boxes if box.inside for inner in pages(box.inside))]


def systems(diagram: Diagram, depth: int) -> list[str]:
    names = []
    for system in diagram.GetSystems():
        if not isinstance(system, VectorLogSink) and system.get_name() != "log_inputs":
            names.append(system.get_name())
            if isinstance(system, Diagram) and depth > 1:
                names += systems(system, depth - 1)
    return names


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_the_picture_is_valid_xml_and_names_every_system(diagram: Diagram, depth: int):
    texts = [element.text for element in ElementTree.fromstring(svg(diagram, depth)).iter(TEXT)]
    assert all(texts.count(name) >= systems(diagram, depth).count(name) for name in systems(diagram, depth))
    assert ("interpolator" in texts) == (depth == 3)
    if depth > 1:
        assert {"position_command", "joint_sample", "truth.X_WE", "MultibodyPlant", "Pbvs"} <= set(texts)


def test_every_connection_is_read_from_the_diagram(diagram: Diagram):
    graph = read_graph(diagram, 2)
    names = [block.name for block in graph.blocks]
    assert {
        (names[source.block], source.name, names[target.block], target.name)
        for source, target in graph.connections
    } == {
        ("servo", "position_command", "station", "position_command"),
        ("servo", "velocity_command", "station", "velocity_command"),
        ("station", "joint_sample", "servo", "joint_sample"),
        ("station", "pose_sample", "servo", "pose_sample"),
    }
    station = graph.blocks[names.index("station")]
    assert station.inside is not None
    exported = {target.name for _, target in station.inside.connections if target.block == OUTSIDE}
    assert exported == set(station.outputs)


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_no_block_covers_another_and_no_wire_runs_through_a_block(diagram: Diagram, depth: int):
    for page in pages(stacked(read_graph(diagram, depth))):
        frames = [(box.x, box.y, box.x + box.width, box.y + box.height) for box in page.boxes]
        for i, (left, top, right, bottom) in enumerate(frames):
            for other in frames[i + 1 :]:
                assert left >= other[2] or other[0] >= right or top >= other[3] or other[1] >= bottom
            for route in page.wires:
                for (x0, y0), (x1, y1) in zip(route.corners, route.corners[1:], strict=False):
                    beside = max(x0, x1) <= left + 0.1 or min(x0, x1) >= right - 0.1
                    assert beside or max(y0, y1) <= top or min(y0, y1) >= bottom


def test_the_command_writes_svg_and_dot(tmp_path: Path):
    for name in ("picture.svg", "picture.dot"):
        assert truetip("diagram", "--law=pbvs", f"--write={tmp_path / name}").exit_code == 0
    assert (tmp_path / "picture.svg").read_text().startswith("<svg ")
    dot = (tmp_path / "picture.dot").read_text()
    assert dot.startswith("digraph")
    assert all(name in dot for name in ("station", "servo", "guard", "camera"))
    assert "<B>PoseCamera</B>" in dot
