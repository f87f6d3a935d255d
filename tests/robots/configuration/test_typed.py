"""YAML to dataclasses: ranges, units and choices are declared once, and serve check, message and list."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pytest
from pydrake.common.yaml import yaml_dump_typed

from robots.configuration.described import described
from robots.configuration.nodes import ConfigurationError, parse
from robots.configuration.quantity import choice, numbers, positive, quantity, vector
from robots.configuration.typed import merged, typed

BASES = "for YAML reads it with base 8 or 60; write a decimal number"


@dataclass
class Round:
    kind: ClassVar[str] = "round"
    radius: float = positive(1.0, "m")
    color: str = choice("red", ("red", "blue"))


@dataclass
class Square:
    side: float = quantity(1.0, 0.5, 2.0, "m")
    color: str = choice("red", ("red", "blue"))


@dataclass
class Part:
    shape: Round | Square = field(default_factory=Round)
    place: np.ndarray = vector((0.0, 0.0, 0.0), -1.0, 1.0, "m")
    weights: list[float] = numbers((1.0,), (1, 3), 0.0)
    count: int = quantity(1, 1, 9)
    limit: float | None = quantity(None, 0.0, 10.0)
    is_hollow: bool = False
    inner: Round | None = None


def read(text: str) -> Part:
    return typed(parse(text, "part"), Part)


def test_a_zero_before_a_number_that_does_not_change_it_is_harmless():
    assert (read("count: 07").count, read("count: 08").count, read("count: 0x8").count) == (7, 8, 8)


def test_what_is_left_out_has_its_default_and_small_numbers_need_no_point():
    part = read("place: [5e-2, 0, 0]\nweights: 2\n")
    np.testing.assert_array_equal(part.place, [0.05, 0.0, 0.0])
    assert (part.weights, part.count, part.limit, part.inner) == ([2.0], 1, None, None)
    assert part.shape == Round()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("count: 0", "part, line 1: count must be between 1 and 9, got 0"),
        ("shape:\n  radius: -1", "part, line 2: shape.radius must be positive, in m, got -1"),
        ("place: [0, 2, 0]", "part, line 1: place[1] must be between -1 and 1 m, got 2"),
        ("place: [0, 2]", "part, line 1: place must be 3 numbers, got [0, 2]"),
        ("weights: [1, 2]", "part, line 1: weights must be 1 or 3 numbers, got [1, 2]"),
        ("is_hollow: true\ncount: 010", f"part, line 2: 010 would be 8, {BASES}"),
        ("weights: [1:30]", f"part, line 1: 1:30 would be 90, {BASES}"),
        ("count: true", "part, line 1: count must be a whole number, got true"),
        ("count: 1.5", "part, line 1: count must be a whole number, got 1.5"),
        ("is_hollow: 1", "part, line 1: is_hollow must be true or false, got 1"),
        ("limit: .inf", "part, line 1: limit must be between 0 and 10, got inf"),
        ("shape: !Square {side: 3}", "part, line 1: shape.side must be between 0.5 and 2 m, got 3"),
        ("shape: !Star {}", "part, line 1: shape must be one of round, square, got 'Star'"),
        ("shape: ''", "part, line 1: shape must be one of round, square, got ''"),
        ("shape: {color: green}", "part, line 1: shape.color must be one of red, blue, got 'green'"),
        ("shape: {side: 1}", "part, line 1: unknown key 'shape.side'; known here: radius, color"),
        ("count: 1\ncount: 2", "part, line 2: key 'count' is given twice"),
        ("inner: 3", "part, line 1: inner must be a group of radius, color, got 3"),
        ("count: [", "part, line 1: no valid YAML: expected the node content, but found '<stream end>'"),
    ],
)
def test_a_refusal_names_the_line_the_place_and_what_is_allowed(text: str, message: str):
    with pytest.raises(ConfigurationError) as refused:
        read(text)
    assert str(refused.value) == message


@pytest.mark.parametrize("text", ["shape: !Square {side: 0.7}", "shape: {kind: square, side: 0.7}"])
def test_a_member_is_chosen_by_tag_or_kind_and_written_as_it_is_read(text: str):
    part = read(text)
    assert part.shape == Square(0.7)
    assert read(str(yaml_dump_typed(part))).shape == part.shape


def test_changing_the_member_keeps_what_both_have_and_changing_back_finds_the_rest():
    first = parse("shape: {radius: 3, color: blue}", "first")
    square = merged(first, parse("shape: square", "change"), Part)
    assert typed(square, Part).shape == Square(color="blue")
    back = merged(square, parse("shape: round", "change"), Part)
    assert typed(back, Part).shape == Round(3.0, "blue")


def test_every_field_is_described_with_its_range_and_unit():
    rows = {row.path: (row.default, row.allowed) for row in described(Part())}
    assert rows["count"] == ("1", "between 1 and 9")
    assert rows["shape"] == ("round", "round, square")
    assert rows["shape(!Square).side"] == ("1", "between 0.5 and 2 m")
    assert rows["is_hollow"] == ("False", "true or false")
