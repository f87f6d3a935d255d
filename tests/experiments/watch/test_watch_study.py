"""What `truetip watch --study` must reach, with rendered images of the whole size."""

import pytest

from experiments.cli.prepare import prepare
from experiments.watch.study import WatchStudy, study_watch


def study(places: int, minutes: float, *settings: str) -> WatchStudy:
    prepared = prepare("watched", list(settings))
    return study_watch(prepared.scenario, prepared.robot, places, minutes, 2.0, lambda share: None)


@pytest.mark.slow
def test_everybody_is_found_hardly_ever_too_far_and_light_and_robot_stop_nothing():
    numbers = study(15, 10.0).as_dict()
    assert numbers["found"] == numbers["places"] == 15
    assert numbers["largest_overestimate_m"] <= 0.1
    assert numbers["median_abs_error_m"] <= 0.08
    assert numbers["false_stops"] == 0
    assert numbers["smallest_share"] == 1.0


@pytest.mark.slow
def test_with_images_of_half_the_size_people_are_found_too():
    small = ["station.overview.width=320", "servo.people.hull.edge=0.08"]
    numbers = study(3, 0.1, *small).as_dict()
    assert numbers["found"] == 3
    assert numbers["largest_overestimate_m"] <= 0.15
    assert (numbers["false_stops"], numbers["empty_sets"]) == (0, 3)
