"""Body names: out of the documents of old and new servers, and back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.link.qualisys.parameters import (
    Body,
    ParameterError,
    bodies_xml,
    find_body,
    parameters_xml,
    parse_bodies,
)

OLD = """<QTM_Parameters_Ver_1.12>
    <The_6D>
        <Bodies>2</Bodies>
        <Body><Name>Body1</Name><RGBColor>ffffff</RGBColor><Point><ID>1</ID><X>10.5</X></Point></Body>
        <Body><Name>Werkzeug 2</Name><RGBColor>00ff00</RGBColor></Body>
        <Euler><First>Roll</First></Euler>
    </The_6D>
</QTM_Parameters_Ver_1.12>"""

NEW = """<QTM_Parameters_Ver_1.25><The_6D>
    <Body><Name>tool</Name><Enabled>true</Enabled>
        <Mesh><Name>Arqus.obj</Name></Mesh><Points><Point X="1.0" Name="tool - 1"/></Points></Body>
    <Body><Name>Base</Name><Enabled>false</Enabled></Body>
</The_6D></QTM_Parameters_Ver_1.25>"""


@pytest.mark.parametrize(
    ("xml", "bodies"),
    [(OLD, [Body("Body1"), Body("Werkzeug 2")]), (NEW, [Body("tool"), Body("Base", enabled=False)])],
)
def test_bodies_of_the_documented_form_are_found_in_their_order(xml: str, bodies: list[Body]):
    assert parse_bodies(xml) == bodies


@pytest.mark.slow
@given(st.lists(st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1), max_size=5))
def test_any_name_survives(names: list[str]):
    assert [body.name for body in parse_bodies(parameters_xml("1.25", [bodies_xml(names)]))] == names


@pytest.mark.parametrize("xml", ["", "Parameters not available", "<a><The_6D></a>", "<a/>"])
def test_what_is_no_such_document_is_refused(xml: str):
    with pytest.raises(ParameterError, match="6D parameters: no"):
        parse_bodies(xml)


def test_a_body_is_found_by_its_name_and_by_its_case_only_if_that_is_clear():
    bodies = [Body("Base"), Body("tool"), Body("TOOL")]
    assert find_body(bodies, "TOOL") == 2
    assert find_body(bodies, "base") == 0
    with pytest.raises(ParameterError, match="body 'Tool': the server has 2 of this name"):
        find_body(bodies, "Tool")
    with pytest.raises(ParameterError, match="does not track it; it tracks 'Base', 'tool', 'TOOL'"):
        find_body(bodies, "hand")
