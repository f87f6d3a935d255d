"""Somebody in the cell of a guided robot: what the monitor in the control cycle does with what it is told."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagrams.live_watch import LiveWatch, live_watch
from diagrams.runs.real_time import RealTimeRecord, RealTimeRun
from diagrams.scenario.scenario import Scenario, load_scenario
from robots.description.model import load_robot
from systems.reference.paths import make_path
from systems.samples import Person, PersonSample
from systems.vision.people.shared_watch import SharedWatch
from tests.diagrams.lockstep import Lockstep
from tests.diagrams.runs.test_rsi_run import RsiLockstep

SCENARIO = load_scenario(
    "cell-watched",
    [
        "reference.path=circle",
        "reference.acceleration=4",
        "station.elasticity=rigid",
        "initial_error_mm=[0,0,0]",
    ],
)
PERIOD, LATE = 0.1, 0.08  # s, between images and from an exposure until people are known
NEAR = Person(1, np.array([[0.5, 0.0, 0.6]]), 0.04, np.zeros(3))  # within the arm's reach


class Told:
    """In place of the process: people at times of the path, said when images of them would be known."""

    def __init__(self, near: tuple[float, float], silent_from: float, problem_from: float) -> None:
        self.shared, self._near = SharedWatch(), near
        self._silent_from, self._problem_from = silent_from, problem_from
        self.problem, self._said = "", -np.inf
        note = self.shared.note_joints
        self.shared.note_joints = lambda time, q: (note(time, q), self._say(time))  # type: ignore[method-assign]

    def _say(self, time: float) -> None:
        origin = self.shared.origin
        exposed = time - LATE
        since = exposed - origin if origin else -1.0
        if since > self._problem_from:
            self.problem = "camera 2 has gone"
        if exposed < self._said + PERIOD or since > self._silent_from:
            return
        self._said = exposed
        people = (NEAR,) if self._near[0] <= since < self._near[1] else ()
        self.shared.publish(PersonSample(exposed, True, people), 0.0)

    @property
    def is_ready(self) -> bool:
        return self.shared.is_ready

    def end(self) -> None:
        """Nothing runs."""


def guided(
    near: tuple[float, float] = (np.inf, np.inf),
    silent: float = np.inf,
    problem: float = np.inf,
    until: float = 20.0,
    acknowledged: tuple[float, ...] | None = None,
    wired: tuple[Scenario, type[Lockstep]] = (SCENARIO, Lockstep),
) -> RealTimeRecord:
    """A run that needs no acknowledgement, or has it for 0.1 s from some times of the path on."""
    scenario, kind = wired
    if acknowledged is not None:
        limits = replace(scenario.servo.separation, acknowledge=True)
        scenario = replace(scenario, servo=replace(scenario.servo, separation=limits))
    wire = kind(scenario)
    told: Any = Told(near, silent, problem)
    watch = live_watch(scenario, load_robot(scenario.robot))
    assert watch is not None
    run = RealTimeRun(scenario, "open_loop", watch=LiveWatch(watch.monitor, lambda: told))

    def is_acknowledged() -> bool:
        origin = told.shared.origin
        since = wire.now() - origin if origin else -1.0
        return any(begin <= since < begin + 0.1 for begin in acknowledged or ())

    return run.run(
        wire.link,
        wire.camera(),
        now=wire.now,
        is_asked_to_end=lambda: wire.time > until,
        is_acknowledged=is_acknowledged,
    )


@pytest.mark.slow
def test_the_robot_rests_while_somebody_is_near_then_goes_on_to_the_end_and_every_time_alike():
    once, again = guided((0.9, 2.5)), guided((0.9, 2.5), until=3.5)
    assert once.ended == "path"
    assert once.people is not None
    assert once.people.stops == 1
    times, rate = once.people.times, once.people.said["path_time"][:, 1]
    # Known after the chain's delay; then the path comes to rest within its slowing time.
    at_rest = (times > 0.9 + LATE + PERIOD + SCENARIO.reference.slowing + 0.1) & (times < 2.5)
    assert at_rest.any()
    assert np.abs(rate[at_rest]).max() < 1e-6
    assert once.log.time[-1] > make_path(SCENARIO.reference).duration + 1.0
    n = len(again.log.time)
    assert again.log.time[-1] > 1.5  # while it is slowed
    np.testing.assert_array_equal(once.log.position_command[:n], again.log.position_command)


@pytest.mark.slow
def test_images_that_no_longer_come_stop_the_robot_and_a_process_that_has_ended_ends_the_run():
    silent = guided(silent=1.0, until=5.0)
    assert silent.people is not None
    after = (
        silent.people.times > 1.0 + SCENARIO.servo.separation.stop_after + SCENARIO.reference.slowing + 0.3
    )
    assert silent.people.said["stop"][after].all()
    assert np.abs(silent.people.said["path_time"][after, 1]).max() < 1e-6
    broken = guided(problem=1.0)
    assert broken.ended == "nobody looks for people any more: camera 2 has gone"


@pytest.mark.slow
def test_after_a_stop_somebody_has_to_let_the_robot_go_on_once_the_way_is_free():
    """Pressed while somebody is near it does not count, and it is not kept for later."""
    run = guided((0.9, 1.8), until=6.0, acknowledged=(1.4, 3.2))
    assert run.people is not None
    times, rate = run.people.times, run.people.said["path_time"][:, 1]
    stands = (times > 1.8) & (times < 3.2)
    assert np.abs(rate[stands]).max() < 1e-6
    assert run.people.said["stop"][stands].all()
    assert rate[times > 3.2].max() > 0.1
    said = [(event.time, event.kind) for event in run.events]
    assert [kind for _, kind in said] == ["stopped_for_people", "acknowledged", "acknowledged", "goes_on"]
    # Told by the first decision after the chain's delay; gone on with the decision after the button.
    decision = SCENARIO.servo.separation.period + 2.0 * SCENARIO.station.period
    assert [at for at, _ in said] == pytest.approx(
        [0.9 + LATE + 0.5 * PERIOD, 1.4, 3.2, 3.2], abs=0.5 * PERIOD + decision
    )


@pytest.mark.slow
def test_a_robot_under_rsi_rests_while_somebody_is_near_too():
    people = {
        "overview": {"enabled": "true", "source": "drawn", "width": 320, "period": 0.2},
        "separation": {"acknowledge": "false", "slow_after": 0.6, "stop_after": 1.2},
    }
    settings = [f"station.overview.{name}={value}" for name, value in people["overview"].items()]
    settings += [f"servo.separation.{name}={value}" for name, value in people["separation"].items()]
    settings += ["servo.people.computation=0.1", "reference.settle=0.5", "reference.dwell=0.5"]
    record = guided((0.9, 2.5), wired=(load_scenario("cell-kuka", settings), RsiLockstep))
    assert record.ended == "path"
    assert record.people is not None
    assert [event.kind for event in record.events] == ["stopped_for_people", "goes_on"]
    stopped, goes_on = (event.time for event in record.events)
    stands = (record.people.times > stopped + SCENARIO.reference.slowing + 0.1) & (
        record.people.times < goes_on
    )
    assert np.abs(record.people.said["path_time"][stands, 1]).max() < 1e-6


def test_a_station_in_real_time_needs_images_from_somewhere():
    with pytest.raises(ValueError, match=r"needs station\.overview\.source"):
        load_scenario("cell-watched", ["station.kind=egm", "station.overview.source=''"])


def test_the_monitor_is_updated_with_the_cycle_and_decides_at_its_own_period():
    watch = live_watch(SCENARIO, load_robot("irb1200"))
    assert watch is not None
    attribute = watch.monitor.GetUniquePeriodicDiscreteUpdateAttribute()
    assert attribute is not None
    assert attribute.period_sec() == pytest.approx(SCENARIO.station.period)
