"""Pictures of a study: axes carry the units that the scenario declares, and no name of a column."""

import numpy as np
import pytest

from diagrams.scenario.scenario import Scenario
from experiments.study.analysis import strongest_factor
from experiments.study.figures import effects_figure, metric_name, metric_unit
from experiments.study.study_file import Levels, Range, Study
from robots.configuration.quantity import unit_at

STUDY = Study(
    laws=["pbvs"],
    factors={
        "station.payload": Levels([0.0, 7.0]),
        "station.drive.dead_time": Range(0.0, 0.04, 2),
        "reference.path": Levels([1.0, 2.0]),
    },
)
ROWS = {
    "law": np.array(["pbvs"] * 4),
    "station.payload": np.array([0.0, 0.0, 7.0, 7.0]),
    "station.drive.dead_time": np.array([0.0, 0.04, 0.0, 0.04]),
    "reference.path": np.array([1.0, 2.0, 2.0, 1.0]),
    "max_norm_mm": np.array([1.0, 2.0, 3.0, 4.0]),
}


def test_an_axis_has_the_unit_of_its_factor_where_the_scenario_declares_one():
    layout = effects_figure(STUDY, ROWS, "max_norm_mm").to_dict()["layout"]
    titles = [layout[axis]["title"]["text"].replace("<br>", "") for axis in ("xaxis", "xaxis2", "xaxis3")]
    assert titles == ["station.payload in kg", "station.drive.dead_time in s", "reference.path"]
    assert layout["yaxis"]["title"]["text"] == "mean, in mm"


def test_the_factor_that_changes_the_result_most_is_named_where_there_are_two():
    assert strongest_factor(STUDY, ROWS, "max_norm_mm") == "station.payload"  # by 2 mm, dead time by 1
    alone = Study(laws=["pbvs"], factors={"station.payload": Levels([0.0, 7.0])})
    assert strongest_factor(alone, ROWS, "max_norm_mm") is None


@pytest.mark.parametrize(
    ("path", "unit"),
    [("station.payload", "kg"), ("station.nothing", ""), ("station", ""), ("station.payload.more", "")],
)
def test_the_unit_of_a_place_in_a_scenario(path: str, unit: str):
    assert unit_at(Scenario(), path) == unit


def test_metrics_in_words():
    assert (metric_name("max_norm_mm"), metric_unit("max_norm_mm")) == (
        "largest distance of the tip from its path",
        "in mm",
    )
    assert (metric_name("guard_ticks"), metric_unit("guard_ticks")) == (
        "ticks in which the guard intervened",
        "in ticks",
    )
