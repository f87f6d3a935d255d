"""How fast the self-calibrating law lets the path go on, by how well the tip ahead is known."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from systems.servo.self_calibrating.ahead import Pace
from systems.servo.self_calibrating.config import SelfCalibratingConfig

PERIOD, PATH_START = 4e-3, 4.0


class Known:
    """A law whose path is known ahead as well as is said."""

    def __init__(self, sigma: float, has_play: bool = False) -> None:
        self.sigma, self.noise = sigma, 4.0  # times the variance that is believed
        model: Any = SimpleNamespace(period=PERIOD, camera_period=PERIOD)
        estimator = SimpleNamespace(
            sigma=lambda memory, rows: self.sigma, variance_factor=lambda memory: self.noise
        )
        learning: Any = SimpleNamespace(
            estimator=estimator, tip_model=SimpleNamespace(has_gear_errors=has_play)
        )
        self.pace, self.time = Pace(model, SelfCalibratingConfig(known_on_path=3e-5), learning), PATH_START
        needs: Any = SimpleNamespace(rows_between=lambda begin, end: np.zeros((1, 6, 1)))
        self.pace.needs = needs
        self.foreign, self.seen = np.zeros(1), np.zeros(1)
        self.is_seeing = True
        self.memory = SimpleNamespace(
            by_knowledge=np.ones(1),
            planned=np.zeros(1),
            shown_at=np.array([PATH_START]),
            waited=np.zeros(1),
            repeats=SimpleNamespace(looks=np.zeros(1), count=np.zeros(1), sigma=np.zeros(1)),
            estimator=SimpleNamespace(is_foreign=self.foreign),
            heard=SimpleNamespace(accepted=self.seen),
        )
        path = SimpleNamespace(path_start=PATH_START)
        self.reference: Any = SimpleNamespace(path=path, path_time=lambda instant: instant)

    def after(self, seconds: float) -> list[float]:
        """The shares of the planned speed that were allowed since then, tick after tick."""
        shares = []
        for _ in range(round(seconds / PERIOD)):
            self.time += PERIOD
            self.memory.planned[0] = self.time
            self.seen[0] = self.time if self.is_seeing else self.seen[0]
            self.pace.look(self.memory, self.reference, self.time)
            shares.append(float(self.memory.by_knowledge[0]))
        return shares


def test_a_path_that_is_known_is_run_as_it_is_planned():
    assert set(Known(3e-5).after(4.0)) == {1.0}


@pytest.mark.parametrize("times", [1.2, 2.0, 3.0, 10.0])
def test_a_tip_that_is_known_n_times_less_well_goes_on_at_about_one_nth_and_at_no_less_than_a_quarter(times):
    share = Known(times * 3e-5).after(4.0)[-1]
    assert max(0.85 / times, 0.85 * 0.25) < share <= max(1.0 / times, 0.25)


def test_samples_that_are_alike_for_a_while_are_not_waited_for():
    """Teeth that last 0.1 s make 51 samples say as much as one: the tip is known seven times less well."""
    assert set(Known(7.0 * 3e-5, has_play=True).after(4.0)) == {1.0}
    assert Known(20.0 * 3e-5, has_play=True).after(4.0)[-1] < 0.5


def test_no_step_is_so_large_that_the_arm_rings_and_none_comes_soon_after_another():
    law = Known(3e-4)
    shares = law.after(4.0)
    law.sigma = 1e-6
    shares = np.array([*shares, *law.after(4.0)])
    assert shares[-1] == 1.0
    steps = np.flatnonzero(np.diff(shares))
    ratios = shares[steps + 1] / shares[steps]
    assert (np.minimum(ratios, 1.0 / ratios) >= 0.85 - 1e-9).all()
    assert np.diff(steps).min() * PERIOD >= 0.2 - 1e-9


def test_what_is_known_just_well_enough_does_not_make_it_faster_and_slower_in_turns():
    law = Known(3.3e-5)
    law.after(1.0)
    for sigma in (2.95e-5, 3.05e-5, 2.9e-5, 3.1e-5):
        law.sigma = sigma
        assert set(law.after(1.0)) == {0.85}


def test_nothing_is_looked_at_long_before_the_path_begins():
    law = Known(3e-4)
    law.time = 0.0
    assert set(law.after(PATH_START - 0.4)) == {1.0}


def test_a_camera_that_shows_nothing_is_not_waited_for_by_going_slowly():
    """It sees no more, or it sees another frame, from which nothing is learnt."""
    for blind, foreign in ((True, 0.0), (False, 1.0)):
        law = Known(3e-4)
        assert law.after(2.0)[-1] < 0.3
        law.is_seeing, law.foreign[0] = not blind, foreign
        assert law.after(5.0)[-1] == 1.0  # two seconds of patience, then step by step


def test_a_probe_that_did_not_show_enough_is_repeated_and_not_for_ever():
    law = Known(1e-4)
    law.memory.shown_at[0] = law.time = 3.4
    repeats, length = law.memory.repeats, 3.15
    for k in range(5):
        law.after(0.1)
        assert repeats.sigma[0] == (1e-4 if k < 3 else 0.0)
        repeats.count[0] += repeats.sigma[0] > 0.0
        repeats.sigma[0], law.memory.waited[0] = 0.0, length * repeats.count[0]
        law.after(length - 0.1)
        assert repeats.sigma[0] == 0.0  # until most of it is over again


def test_a_probe_that_has_shown_enough_is_not_repeated_though_later_less_is_known():
    law = Known(5e-5)
    law.after(0.1)
    law.sigma = 1e-3
    law.after(1.0)
    assert law.memory.repeats.sigma[0] == 0.0


def test_no_probe_is_repeated_where_samples_are_plenty():
    """What is left then is no noise, and the path itself shows it in no time."""
    law = Known(1e-4)
    law.noise = 1.0
    law.after(1.0)
    assert law.memory.repeats.sigma[0] == 0.0
