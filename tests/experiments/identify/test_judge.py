"""The full simulation as the judge: the true robot leaves noise, a wrong spring leaves more."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.cli.workers import LocalProcesses
from experiments.feedforward.trial import Trial
from experiments.identify.cases import default_cases
from experiments.identify.judge.full_run import (
    DrivenBy,
    FullReadings,
    FullRun,
    as_measured,
    with_heavy_rotors,
)
from experiments.identify.judge.judge import (
    BEFORE,
    FOUND,
    WRITTEN,
    JudgedSensors,
    Verdict,
    driven_by,
    judge,
    left_over,
)
from experiments.identify.judge.report import judge_json, judge_rows, judge_section, judge_summary, judged
from experiments.identify.recording_map import Recording
from experiments.identify.simulated import CaseRun, places
from robots.description.model import RobotModel, load_robot
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_fit import ArmFit
from robots.identification.arm_identification import ArmIdentification
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase
from robots.identification.recording import RecordedCase
from systems.cell.drive import DriveConfig
from systems.feedforward import FeedforwardConfig

PAYLOAD = 210.0  # kg
NOISE = 2e-3  # rad/s, of the gyros


def row(kind: str, left: float, driven: dict[str, float]) -> JudgedSensors:
    full = {BEFORE: 10.0 * left, WRITTEN: 2.0 * left, FOUND: left}
    return JudgedSensors("1", kind, 1.0, full, {BEFORE: 9.0 * left, FOUND: left}, driven)


def test_what_is_left_is_a_share_of_all_that_was_measured():
    louder = replace(row("gyro", 0.04, {}), measured=3.0)
    verdict = Verdict([row("gyro", 0.03, {}), louder, row("accelerometer", 0.5, {})], {})
    # sqrt(0.03^2 + 0.04^2) of sqrt(1^2 + 3^2)
    assert verdict.left("gyro", "full", FOUND) == pytest.approx(0.05 / np.sqrt(10.0))
    assert verdict.left("accelerometer", "linear", BEFORE) == pytest.approx(4.5)
    assert [each[0] for each in judge_summary(verdict)] == ["gyro", "accelerometer"]
    assert "gyros are off by 1.6% of what they show with the values found" in judged(verdict)
    assert "closed" not in judged(verdict)
    assert len(judge_rows(verdict)) == 3


def test_closed_loop_is_told_where_there_is_one():
    driven = {BEFORE: 0.2, WRITTEN: 0.1}
    verdict = Verdict([row("gyro", 0.03, driven)], {BEFORE: 2e-3, WRITTEN: 1e-3})
    assert "motors are off by 1.000 mrad, 2.000 before" in judged(verdict)
    assert judge_rows(verdict)[0][-2:] == ["0.2000", "0.1000"]
    assert "in loop as written" in str(judge_section(verdict).content)
    numbers = judge_json(verdict)
    assert numbers["motions"][0]["closed_loop"] == driven
    assert numbers["closed_loop_motors_rad"][WRITTEN] == 1e-3


def test_commands_are_one_a_tick():
    time = 1e-3 * np.arange(40)
    told = np.repeat(np.arange(10.0), 4)[:, None, None] * np.ones((1, 3, 6))
    still = np.zeros((40, 6))
    case = RecordedCase("1", time, still, still, still, time, np.zeros((40, 0, 3)), told)
    drive = DriveConfig()
    silent, driven = driven_by(Recording(None, [replace(case, commands=None), case], [], 4e-3), drive)
    assert silent is None
    assert isinstance(driven, DrivenBy)
    np.testing.assert_array_equal(driven.told[:, 0, 0], np.arange(10.0))


def test_what_a_sensor_shows_at_rest_is_its_bias_and_not_left_over():
    theta = np.concatenate([np.zeros(50), np.linspace(0.0, 0.1, 50)])[:, None] * np.ones(6)
    rate = np.gradient(theta, 1e-3, axis=0)
    shown = np.random.default_rng(1).normal(size=(100, 1, 3))
    case = MotionCase("1", 1e-3, theta, rate, shown)
    left = left_over(case, FullReadings(shown + 0.3, theta))
    np.testing.assert_allclose(left, 0.0, atol=1e-12)


@pytest.fixture(scope="module")
def recorded() -> tuple[RobotModel, Recording]:
    """Two motions of a realistic robot, and that robot."""
    nominal, plant = load_robot("kr210"), load_robot("kr210-realistic")
    motions = default_cases(nominal)
    motions.logger.clock_offset = motions.logger.clock_drift_ppm = 0.0
    cases = []
    for number in (0, 6):
        q, angle = motions.starts(nominal)[number]
        trial = Trial(
            nominal,
            PAYLOAD,
            q,
            angle,
            FeedforwardConfig(kind="rigid"),
            plant,
            settle=motions.settle,
            speeding_up=motions.speeding_up,
        )
        cases.append(CaseRun(f"{number}", trial, motions.logger, 0.3, number).run())
    return plant, Recording(PAYLOAD, cases, places(motions.logger))


def identification(robot: RobotModel, recording: Recording) -> ArmIdentification:
    """As if all springs were right: none is changed. Of the linear model nothing is left."""
    arm = ElasticArm(robot, PAYLOAD, recording.sensors)
    parameters = ElasticParameters(arm, gear_parts=False)
    covariance = np.eye(len(parameters))
    fit = ArmFit(parameters, parameters.start, covariance, covariance, np.ones(1), 0, 1.0)
    cases = [case.at_lag(0.0) for case in recording.cases]
    n = min(len(case.theta) for case in cases)
    measured = np.stack([case.readings[:n].reshape(n, -1) for case in cases], axis=1)
    return ArmIdentification(
        arm,
        cases,
        recording.sensors,
        np.zeros(len(cases)),
        fit,
        1e-3 * np.arange(n),
        measured,
        measured,
        measured,
        [PAYLOAD] * len(cases),
    )


def softer(robot: RobotModel, joint: int, share: float) -> RobotModel:
    joints = list(robot.joints)
    train = joints[joint].drive_train
    joints[joint] = replace(joints[joint], drive_train=replace(train, stiffness=share * train.stiffness))
    return replace(robot, joints=joints)


@pytest.mark.slow
def test_the_true_robot_leaves_noise_and_one_with_a_wrong_spring_five_times_as_much(recorded):
    """A fifth of one gear's stiffness; motors move as measured, whatever the drives would have done."""
    plant, recording = recorded
    found = identification(plant, recording)
    verdict = judge(softer(plant, 1, 0.8), plant, found, LocalProcesses(1))
    gyros = [row for row in verdict.rows if row.kind == "gyro"]
    assert len(gyros) == 2
    for row in gyros:
        assert row.full[WRITTEN] < 1.5 * NOISE
        assert row.full[BEFORE] > 5.0 * row.full[WRITTEN]
    assert verdict.left("gyro", "full", BEFORE) > 5.0 * verdict.left("gyro", "full", WRITTEN)


@pytest.mark.slow
def test_heavy_rotors_keep_to_the_measured_motion(recorded):
    """To a thousandth of the motion's deflections, which are some milliradians."""
    plant, recording = recorded
    case = recording.cases[0].at_lag(0.0)
    shown = FullRun(plant, PAYLOAD, case, recording.sensors).run()
    np.testing.assert_allclose(shown.theta, case.theta, atol=4e-6)
    heavy = with_heavy_rotors(plant)
    assert heavy.reflected_inertia == pytest.approx(1e6)
    assert as_measured(case, case.period).told.shape == (len(case.theta), 3, 6)


@pytest.mark.slow
def test_a_robot_that_says_where_its_motors_are_every_4_ms_is_judged_as_well(recorded):
    """What gyros show is off by less than a hundredth: cubics between samples are near enough."""
    plant, recording = recorded
    case = recording.cases[0].at_lag(0.0)
    seldom = MotionCase("seldom", 4e-3, case.theta[::4], case.rate[::4], case.readings[::4])
    shown, finely = (FullRun(plant, PAYLOAD, each, recording.sensors).run() for each in (seldom, case))
    gyros = [i for i, sensor in enumerate(recording.sensors) if sensor.kind == "gyro"]
    off = (shown.readings - finely.readings[::4])[:, gyros]
    assert np.sqrt(np.mean(np.square(off))) < 0.01 * np.sqrt(np.nanmean(np.square(case.readings[:, gyros])))


@pytest.mark.slow
def test_commands_drive_the_true_robot_where_it_was_measured(recorded):
    """The same drives, plant and commands: the same motion, but for steps of the integration."""
    plant, recording = recorded
    case = recording.cases[0].at_lag(0.0)
    driven = driven_by(recording, DriveConfig())[0]
    shown = FullRun(plant, PAYLOAD, case, recording.sensors, driven).run()
    np.testing.assert_allclose(shown.theta, case.theta, atol=1e-6)
