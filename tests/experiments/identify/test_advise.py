"""Advice: candidates that the robot allows, steps that help most, and what came of one that was followed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from experiments.cli.workers import LocalProcesses
from experiments.identify.advice.advise import Advice, Option, Prospect, WeakParameter, chosen_few
from experiments.identify.advice.candidates import (
    candidate_motions,
    candidate_sensors,
    far_ends,
    planned_case,
)
from experiments.identify.advice.report import advice_json, advice_rows, advice_sections, advised
from experiments.identify.advice_bench import Robot
from experiments.identify.cases import FurtherMotion, MotionCases, PlannedMotion, default_cases
from experiments.identify.simulated import places
from experiments.identify.study import study_recording, with_advice
from robots.description.model import load_robot
from robots.identification.identified_robot import STIFFNESS_KNOWN
from robots.measurement_design.constraints import AdmissibleConfigurations

ROBOTS = ["kr210", "irb1200"]


@pytest.mark.parametrize("name", ROBOTS)
def test_candidates_keep_ranges_and_stay_clear_of_floor_and_arm(name: str):
    robot = load_robot(name)
    payload = robot.payload.largest_mass
    motions = candidate_motions(robot, payload)
    is_free = AdmissibleConfigurations(robot)
    ends = np.array([motion.start for motion in motions])
    ends[:, :3] += np.array([motion.angle for motion in motions])[:, None]
    assert is_free(np.array([motion.start for motion in motions])).all()
    assert is_free(ends).all()
    assert {motion.payload for motion in motions} == {0.0, round(0.5 * payload, 1), payload}
    # All over the range: some shoulder leans back, some forward, by a third of it at least.
    shoulder = np.array([motion.start[1] for motion in motions])
    assert np.ptp(shoulder) > (robot.upper - robot.lower)[1] / 3.0


def test_a_planned_motion_goes_from_rest_to_rest_by_its_angle():
    robot = load_robot("kr210")
    motion = PlannedMotion(np.deg2rad([0.0, -60.0, 40.0, 30.0, 50.0, 0.0]), -0.1)
    case = planned_case(robot, 210.0, motion, MotionCases(), 1e-3)
    np.testing.assert_allclose(case.theta[-1, :3] - case.theta[0, :3], -0.1)
    np.testing.assert_allclose(case.theta[-1, 3:], motion.start[3:])
    assert not case.rate[[0, -1]].any()


def test_candidate_sensors_are_those_that_are_not_there_at_the_far_ends_of_bodies():
    robot = load_robot("kr210")
    there = places(default_cases(robot).logger)
    new = candidate_sensors(robot, there)
    assert not {(s.kind, s.body) for s in there} & {(s.kind, s.body) for s in new}
    assert {s.sigma for s in new if s.kind == "accelerometer"} == {0.05}
    # The arm is a beam, at whose end the next joint turns.
    beam = robot.links[1].beam
    assert beam is not None
    assert np.linalg.norm(far_ends(robot)["link_2_segment_4"]) == pytest.approx(beam.length)


class FewOptions:
    """Standard deviations of two parameters, by what each option tells of them."""

    def __init__(self, tells: list[tuple[float, float]]) -> None:
        self.options = [Option(motion=PlannedMotion(np.zeros(6), 0.1, 0.0)) for _ in tells]
        self._tells = dict(zip(self.options, tells, strict=True))

    def sigmas(self, options: Sequence[Option]) -> dict[str, float]:
        information = np.array([1.0, 1.0]) + np.sum([self._tells[each] for each in options], axis=0)
        values = 2.0 * STIFFNESS_KNOWN / np.sqrt(information)
        return dict(zip(("stiffness_a", "stiffness_b"), values.tolist(), strict=True))


def test_steps_go_to_what_tells_most_and_end_where_all_is_known():
    prospects = FewOptions([(0.1, 0.1), (9.0, 0.0), (0.0, 9.0), (3.0, 0.0)])
    chosen = chosen_few(prospects.sigmas, prospects.options, prospects.sigmas([]), 4)
    assert [prospects.options.index(each) for each in chosen] == [1, 2]


def test_what_is_less_work_is_taken_where_it_helps_nearly_as_much():
    prospects = FewOptions([(8.0, 0.0), (9.0, 0.0)])
    chosen = chosen_few(prospects.sigmas, prospects.options, {"stiffness_a": 2.0 * STIFFNESS_KNOWN}, 1)
    assert chosen == prospects.options[:1]


def test_nothing_is_proposed_where_nothing_tells():
    prospects = FewOptions([(1e-3, 1e-3)])
    assert chosen_few(prospects.sigmas, prospects.options, prospects.sigmas([]), 4) == []


def weak(name: str, few: float) -> WeakParameter:
    option = Option(motion=PlannedMotion(np.deg2rad([0.0, -60.0, 40.0, 0.0, 30.0, 0.0]), 0.1, 0.0))
    best = Prospect((option,), few)
    return WeakParameter(name, 0.03, STIFFNESS_KNOWN, best, None, best, few)


def test_a_report_says_what_helps_and_what_nothing_shows():
    rows = [weak("stiffness_bearing_3_b", 0.01), weak("stiffness_gear_6", 0.025)]
    motion = rows[0].reach.options[0]
    advice = Advice(210.0, rows, [motion], 96, 4)
    assert [row[-1] for row in advice_rows(advice)] == ["one motion", "nothing"]
    said = advised(advice)
    assert "+6 degrees from (0, -60, 40, 0, 30, 0) with 0 kg would make stiffness_bearing_3_b ident" in said
    assert "None shows stiffness_gear_6 well enough." in said
    numbers = advice_json(advice)
    # As a file of --motions takes them.
    further = FurtherMotion(**numbers["further"][0])
    planned = replace(default_cases(load_robot("kr210")), further=[further]).planned(load_robot("kr210"))
    assert motion.motion is not None
    np.testing.assert_allclose(planned[-1].start, motion.motion.start, atol=1e-5)
    assert len(planned) == 19
    assert numbers["parameters"]["stiffness_gear_6"]["made_known_by"] == "nothing"
    assert "best motion" in str(advice_sections(advice)[0].content)
    assert "no further motion is needed" in advised(Advice(210.0))


def test_what_only_all_of_the_proposed_show_is_not_said_to_be_shown_by_none():
    """No few for it alone suffice, but what is proposed for others comes to it, too."""
    row = replace(weak("stiffness_bearing_3_b", 0.025), proposed=0.01)
    said = advised(Advice(210.0, [row], [row.reach.options[0]], 96, 4))
    assert said.endswith("would make stiffness_bearing_3_b identifiable.")


def test_a_further_motion_that_leaves_its_range_is_refused():
    robot = load_robot("kr210")
    motions = replace(default_cases(robot), further=[FurtherMotion([0.0, 80.0, 0.0, 0.0, 0.0, 0.0])])
    with pytest.raises(ValueError, match=r"further\[0\]: no room for 5 degrees from \[0.0, 80.0"):
        motions.planned(robot)


@pytest.mark.slow
def test_the_motion_that_is_advised_makes_known_what_was_weak():
    """Followed: it is simulated and added. The prediction is right to a factor of two."""
    robot = Robot(31)
    recording = robot.watched()
    before = with_advice(study_recording(robot.believed, robot.plant, recording), LocalProcesses(1))
    assert before.advice is not None
    gains = {row.motion.sigma / row.limit: row for row in before.advice.weak if row.motion is not None}
    row = gains[min(gains)]
    assert row.motion is not None
    assert row.motion.sigma < row.limit < row.sigma
    after = study_recording(robot.believed, robot.plant, robot.added(recording, row.motion.options))
    found = next(each for each in after.parameters if each.name == row.name)
    assert found.true is not None
    assert found.identifiable
    assert 0.5 < found.sigma / found.value / row.motion.sigma < 2.0
    assert abs(found.value - found.true) < 3.0 * found.sigma
