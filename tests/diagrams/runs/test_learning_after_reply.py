"""On a wire a law that learns answers first: its reply does not wait for what is learnt from the message."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagrams.hardware_link import StationError
from diagrams.runs.real_time import RealTimeRecord, RealTimeRun
from diagrams.scenario.scenario import load_scenario
from systems.samples import PoseSample
from systems.servo.self_calibrating.law import SelfCalibrating
from tests.diagrams.lockstep import Lockstep

LEARNING = 1.5e-3  # s that it is made to take, on the clock of the wire
UNTIL = 1.0  # s of the path's time; learning begins before


def guided(asks: bool) -> tuple[RealTimeRecord, Lockstep, list[int]]:
    """A run, its wire, and how many commands had been sent when the law was asked to learn."""
    wire, sent = Lockstep(load_scenario("cell")), []

    class Law(SelfCalibrating):
        def learn(self, context):
            sent.append(len(wire.sent))
            if asks:
                super().learn(context)
                wire.time += LEARNING

    run = RealTimeRun(load_scenario("cell"), Law)
    path_time = run.servo.path_time
    record = run.run(
        wire.link, wire.camera(), now=wire.now, is_asked_to_end=lambda: path_time(run._context) > UNTIL
    )
    return record, wire, sent


@pytest.fixture(scope="module")
def prompt():
    return guided(asks=True)


def test_each_reply_is_out_before_anything_is_learnt(prompt):
    record, _, sent = prompt
    assert len(sent) == pytest.approx(UNTIL / 4.032e-3, abs=2)
    assert (np.diff(sent) == 1).all()
    assert record.turn_around.max() < LEARNING
    assert len(record.log.learnt["parameters"]) > 30


@pytest.mark.slow
def test_a_run_begins_when_the_camera_sees_the_tool():
    scenario = load_scenario("cell", ["station.link.connect=1"])
    of_frames = SimpleNamespace(last_error="", counters={"frames": 100, "lost_body": 100})
    blind: Any = SimpleNamespace(poll=lambda now: PoseSample(), report=lambda: of_frames)
    wire, run = Lockstep(scenario), RealTimeRun(scenario, SelfCalibrating)
    with pytest.raises(StationError, match="it does not see the body"):
        run.run(wire.link, blind, now=wire.now)


@pytest.mark.slow
def test_when_it_is_learnt_makes_no_difference_to_a_command(prompt):
    late, *_ = guided(asks=False)
    early = prompt[0].log
    n = min(len(early.time), len(late.log.time))
    assert n > 200
    assert np.array_equal(early.position_command[:n], late.log.position_command[:n])
    assert early.learnt["mass_kg"] != 7.0
