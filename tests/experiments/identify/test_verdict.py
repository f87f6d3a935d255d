"""What the first lines of an identification say of how much its numbers are worth."""

from types import SimpleNamespace
from typing import Any

import pytest

from experiments.identify.plots import verdict
from experiments.identify.study import IdentifyStudy
from robots.description.model import load_robot


@pytest.mark.parametrize(
    ("motions", "said"),
    [
        (1, "0 of 0 springs are identifiable from 1 motion, in"),
        (2, "with 2 it is too small, above all that of dampers"),
    ],
)
def test_few_motions_do_not_show_what_is_wrong_with_each(motions: int, said: str):
    assert said in verdict(found_from(motions))


def test_with_many_motions_sigma_stands_for_itself():
    assert "too small" not in verdict(found_from(6))


def found_from(motions: int) -> IdentifyStudy:
    """A study of some motions in which nothing was looked for."""
    found: Any = SimpleNamespace(cases=motions * [None], fit=SimpleNamespace(evaluations=3))
    robot = load_robot("kr210")
    return IdentifyStudy(robot, None, 210.0, found, [], robot, 1.0, None, None)
