"""A tick that was worked out before its message: the same command as after it, and none out of date."""

import numpy as np
import pytest

from diagrams.runs.real_time import RealTimeRun
from diagrams.runs.tick_ahead import TickAhead
from diagrams.scenario.scenario import load_scenario
from systems.samples import PoseSample
from systems.servo import LAWS
from systems.servo.contract import law_traits
from systems.servo.numerical_ik import NumericalIk
from tests.diagrams.lockstep import Lockstep

UNTIL = 1.2  # s of the path's time
FREE = [name for name in LAWS if not law_traits(LAWS.find(name)).awaits_joints]
NOISY = ["station.faults.loss=0.05", "station.faults.jitter=0.003", "station.faults.reordering=0.02"]


def begun(law: str, settings: list[str], works_ahead: bool, monkeypatch) -> tuple[list, float]:
    """Replies, log and findings of the beginning of a run; the share of replies that was ready beforehand."""
    asked, command = [], TickAhead.command

    def counted(self: TickAhead, time: float, sample: PoseSample):
        known = command(self, time, sample) if works_ahead else None
        asked.append(known is not None)
        return known

    monkeypatch.setattr(TickAhead, "command", counted)
    scenario = load_scenario("cell", ["reference.settle=1", *settings])
    wire, run = Lockstep(scenario), RealTimeRun(scenario, law)
    path_time = run.servo.path_time
    ends = lambda: path_time(run._context) > UNTIL  # noqa: E731
    log = run.run(wire.link, wire.camera(), now=wire.now, is_asked_to_end=ends).log
    found = [wire.sent, log.position_command.tolist(), log.correction.tolist(), log.guard_counts]
    return [*found, repr(log.learnt)], float(np.mean(asked))


@pytest.mark.slow
@pytest.mark.parametrize("law", FREE)
def test_when_a_command_is_worked_out_makes_no_difference_to_it(law: str, monkeypatch):
    """Joints that are measured differ from those that were taken for them, by all that the robot moves."""
    early, share = begun(law, [], True, monkeypatch)
    late, none = begun(law, [], False, monkeypatch)
    assert share > 0.8
    assert none == 0.0
    assert early == late


@pytest.mark.slow
@pytest.mark.parametrize("law", ["numerical_ik", "self_calibrating"])
def test_nor_does_it_where_messages_are_lost_late_and_out_of_order(law: str, monkeypatch):
    early, share = begun(law, NOISY, True, monkeypatch)
    late, _ = begun(law, NOISY, False, monkeypatch)
    assert 0.2 < share < 0.95
    assert early == late


@pytest.mark.slow
def test_a_law_that_awaits_the_joints_gets_them(monkeypatch):
    _, share = begun("pbvs", [], True, monkeypatch)
    assert share == 0.0


def test_a_law_that_extends_another_awaits_joints_unless_it_says_otherwise():
    class Extended(NumericalIk):
        pass

    assert not law_traits(NumericalIk).awaits_joints
    assert law_traits(Extended).awaits_joints
