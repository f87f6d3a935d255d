"""The self-calibrating law against the simulated station: from a nominal robot onto the path."""

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import load_scenario
from experiments.cli.prepare import prepare
from experiments.metrics.laps import lap_metrics
from experiments.metrics.run_metrics import pose_errors
from robots.pose import pose_error
from systems.estimation.drives.drive_model import DEAD_TIME

WRONG = [  # what the controller believes of springs and load
    "servo.model.payload=6.65",
    "servo.model.stiffness=[1.2]",
    "servo.model.structure=1.2",
]

_HUMPS = slice(16, 37, 4)  # of the drive model's parameters


def tip_errors(log) -> tuple[np.ndarray, np.ndarray]:
    """Distances of the true tip from the path in m, on the path and at rest in the end."""
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    return errors[log.time >= log.path_start], errors[log.time >= log.path_end - 0.5]


@pytest.mark.slow
def test_the_tip_comes_onto_the_path_before_it_begins():
    late = [
        "station.camera.clock_offset=-0.003",
        "station.drive.dead_time=0.003",
        "servo.model.command_delay=0.004",
    ]
    settings = ["station.elasticity=structure", *WRONG, *late, "reference.settle=3"]
    experiment = Experiment(load_scenario("misaligned", settings), "self_calibrating")
    experiment.advance(until=4.5)
    log = experiment.log()
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    assert errors[0] > 10e-3
    assert errors[log.time >= 3.0].max() < 0.15e-3
    assert not any(log.guard_counts.values())
    assert log.learnt is not None
    assert log.learnt["clock_offset_s"] == pytest.approx(3e-3, abs=0.2e-3)
    assert log.learnt["dead_time_s"] == pytest.approx(7e-3, abs=0.2e-3)
    assert log.learnt["coverage"]["share"] >= 0.8  # 0.95 of eight, where one may be outside


@pytest.mark.slow
def test_the_same_seed_gives_the_same_commands():
    scenario = load_scenario("misaligned", ["reference.settle=2"])
    commands = []
    for _ in range(2):
        experiment = Experiment(scenario, "self_calibrating")
        experiment.advance(until=1.2)
        commands.append(experiment.log().position_command)
    assert np.array_equal(*commands)


@pytest.mark.slow
def test_a_dead_time_that_nobody_told_is_found_before_the_path_begins():
    settings = ["station.drive.dead_time=0.2", "servo.model.command_delay=0.004", "reference.settle=3"]
    experiment = Experiment(load_scenario("misaligned", settings), "self_calibrating")
    experiment.advance(until=1.2)
    law = experiment.servo.law
    memory = law.memory(law.GetMyContextFromRoot(experiment.context))
    assert memory.delay.target[0] == pytest.approx(0.204, abs=2e-3)
    # What was planned while the dead time was wrong has taught the drives nothing.
    assert abs(memory.drives.beta[DEAD_TIME]) < 1e-3
    begin = memory.first[0] + memory.waited[0] + 0.8  # s, of the oscillations
    assert begin == pytest.approx(memory.delay.settled[0], abs=0.03)
    experiment.advance(until=4.2)
    assert 3.0 < experiment.servo.path_time(experiment.context) < 4.2 - 0.9 * memory.waited[0]
    assert not any(experiment.log().guard_counts.values())


def test_a_path_that_nothing_has_shown_the_needs_of_is_named():
    settings = ["servo.laws.self_calibrating.probe.kind=none", "reference.settle=0.2"]
    experiment = Experiment(load_scenario("misaligned", settings), "self_calibrating")
    experiment.advance(until=0.3)
    learnt = experiment.log().learnt
    assert learnt is not None
    assert [event["kind"] for event in learnt["events"]] == ["path needs more than was shown"]
    before = learnt["path"]["before"]
    assert learnt["events"][0]["size"] == before["tip_sigma_m"] > 1e-3
    assert before["parameter"] in learnt["parameters"]
    # By then the camera will have shown some of it.
    assert before["parameter_sigma"] < learnt["parameters"][before["parameter"]]["sigma"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings", "moving"),
    [
        ("misaligned", ["station.drive.dead_time=0.003", "servo.model.command_delay=0.004"], 0.05e-3),
        ("dead-time", ["station.drive.dead_time=0.139", "servo.model.command_delay=0.14"], 0.08e-3),
        ("cell", ["station.drive.command_delay=0.007032", "servo.model.command_delay=0.004032"], 0.05e-3),
    ],
)
def test_a_lap_from_a_nominal_robot(name, settings, moving):
    scenario = load_scenario(name, ["station.elasticity=structure", *WRONG, *settings])
    log = run(scenario, "self_calibrating")
    on_path, at_rest = tip_errors(log)
    assert on_path.max() < moving
    assert at_rest.mean() < 0.005e-3
    assert not any(log.guard_counts.values())


@pytest.mark.slow
@pytest.mark.parametrize("belief", ["irb1200", "irb1200-realistic"])
def test_a_realistic_robot_whether_its_friction_is_a_number_or_a_curve_to_the_controller(belief):
    settings = [f"servo.model.robot={belief}", "reference.settle=3"]
    experiment = Experiment(load_scenario("everything-realistic", settings), "self_calibrating")
    experiment.advance(until=9.0)
    log = experiment.log()
    assert tip_errors(log)[0].max() < 0.1e-3
    assert log.learnt is not None
    assert not log.learnt["events"]


@pytest.mark.slow
def test_friction_of_a_wrist_that_moves_it_much_is_learnt_before_the_path_begins():
    prepared = prepare("everything-realistic", robot="kr16-realistic")
    experiment = Experiment(prepared.scenario, "self_calibrating", prepared.robot)
    law = experiment.servo.law
    open_humps = {}
    for until in (1.9, 2.1):
        experiment.advance(until=until)
        drives = law.memory(law.GetMyContextFromRoot(experiment.context)).drives
        open_humps[until] = (np.flatnonzero(np.diag(drives.P)[_HUMPS]) + 1).tolist()
    assert open_humps == {1.9: [], 2.1: [4, 5, 6]}


@pytest.mark.slow
def test_the_tip_of_a_realistic_kr_16_is_where_the_law_says():
    names = ("seed", "station.errors.random.seed", "station.variation.seed")
    drawn = [f"{name}=3001" for name in names]
    prepared = prepare("everything-realistic", drawn, "kr16-realistic")
    log = run(prepared.scenario, "self_calibrating", prepared.robot)
    assert log.learnt is not None
    assert log.learnt["coverage"]["share"] >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "bits"), [(2001, 19), (2002, 17)])
def test_the_tip_is_where_the_law_says_with_encoders_of_any_steps(seed, bits):
    names = ("seed", "station.errors.random.seed", "station.variation.seed")
    drawn = [f"{name}={seed}" for name in names]
    settings = ["reference.path=circle", f"station.encoder.bits={bits}", *drawn]
    log = run(load_scenario("everything", settings), "self_calibrating")
    assert log.learnt is not None
    assert log.learnt["coverage"]["share"] >= 0.88  # 0.95 of forty samples, which are alike in turns


@pytest.mark.slow
def test_the_tip_is_predicted_at_no_time_that_the_encoders_have_not_reached():
    """At 1.6 s a camera of 3 ms without delay has seen 1.599 s, encoders have been read at 1.596 s."""
    settings = [f"station.camera.{each}" for each in ("period=0.003", "delay=0", "clock_offset=0")]
    experiment = Experiment(load_scenario("everything", settings), "self_calibrating")
    experiment.advance(until=1.6)
    law = experiment.servo.law
    context = law.GetMyContextFromRoot(experiment.context)
    prediction = law.predicted_tip(context)
    assert prediction is not None
    assert prediction[0] == law.memory(context).encoders.times.max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise", [["position_sigma=3e-4", "orientation_sigma_deg=0.05"], ["orientation_sigma_deg=0.05"]]
)
def test_a_camera_five_times_as_noisy_as_the_law_is_told_sets_nothing_off(noise):
    """What is left goes with the noise: 0.03 mm with 0.05 mm and 0.01 degrees, on paths that go slowly."""
    settings = ["reference.path=circle", *(f"station.camera.{each}" for each in noise)]
    log = run(load_scenario("everything", settings), "self_calibrating")
    on_path, at_rest = tip_errors(log)
    assert log.learnt is not None
    assert not [event for event in log.learnt["events"] if event["kind"] != "probe repeated"]
    assert not any(log.guard_counts.values())
    assert on_path.max() < 0.2e-3
    assert at_rest.mean() < 0.03e-3


@pytest.mark.slow
@pytest.mark.parametrize(("interface", "moving"), [("direct", 0.06e-3), ("egm", 0.08e-3)])
def test_a_robot_that_follows_speeds_alone_does_not_drift_from_its_plan(interface, moving):
    """Without encoders in the command it did by 0.16 and 0.03 mm until it rested."""
    settings = [f"station.interface={interface}", "servo.laws.self_calibrating.drive=velocity"]
    on_path, at_rest = tip_errors(run(load_scenario("everything", settings), "self_calibrating"))
    assert on_path.max() < moving
    assert at_rest.mean() < 0.01e-3


@pytest.mark.slow
def test_drives_without_a_loop_of_speed_are_known_for_what_they_are():
    """Taken for a cascade they left 0.07 mm on the second lap and 0.03 mm at rest; they ring at its start."""
    settings = ["servo.laws.self_calibrating.drive=position", "reference.laps=2"]
    log = run(load_scenario("everything", settings), "self_calibrating")
    on_path, at_rest = tip_errors(log)
    assert on_path.max() < 0.2e-3
    assert on_path[len(on_path) // 2 :].max() < 0.05e-3
    assert at_rest.mean() < 0.015e-3


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.25, 0.8])  # s
def test_a_camera_that_is_blind_on_the_path_costs_what_was_promised(gap):
    drawn = [f"{name}=4001" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    blind = [f"station.camera.dropouts=[[5, {5 + gap}]]", f"servo.laws.self_calibrating.probe.blind={gap}"]
    scenario = load_scenario("everything", ["reference.path=circle", *blind, *drawn])
    experiment = Experiment(scenario, "self_calibrating")
    experiment.advance(until=5.2 + gap)
    log = experiment.log()
    assert log.learnt is not None
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    promised = log.learnt["path"]["before"]["tip_sigma_m"]
    assert errors[log.time >= 5.0].max() < 2.0 * promised


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "held"), [(0.5, 0.5), (30.0, 2.0)])  # s
def test_the_path_waits_for_a_camera_that_is_blind_where_nothing_was_shown_but_not_for_ever(gap, held):
    drawn = [f"{name}=3003" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    only = "servo.laws.self_calibrating.known_on_path=1"  # nothing else makes it slower
    scenario = load_scenario("everything", [f"station.camera.dropouts=[[5, {5 + gap}]]", only, *drawn])
    experiment = Experiment(scenario, "self_calibrating")
    experiment.advance(until=9.0)
    log = experiment.log()
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    before = errors[(log.time >= 4.0) & (log.time < 5.0 + min(gap, held))]
    assert before.max() < 0.06e-3  # 0.11 mm where it goes on for half a second
    lost = 9.0 - experiment.servo.path_time(experiment.context)
    assert held - 0.1 < lost < held + 0.1
    assert not any(log.guard_counts.values())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4001, 4002])
def test_a_load_that_is_picked_up_is_made_up_for_and_named(seed):
    drawn = [f"{name}={seed}" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    empty = ["station.payload=0", "servo.model.payload=0"]
    picked = "station.events=[!PayloadChange {at: 6, payload: 7}]"
    experiment = Experiment(load_scenario("everything", [*empty, picked, *drawn]), "self_calibrating")
    experiment.advance(until=11.0)
    log = experiment.log()
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    assert errors[log.time >= 7.5].max() < 0.06e-3
    assert log.learnt is not None
    changes = [event for event in log.learnt["events"] if event["kind"] == "load changed"]
    assert changes
    assert changes[0]["time_s"] == pytest.approx(6.0, abs=0.1)
    assert sum(event["size"] for event in changes) == pytest.approx(7.0, abs=2.0)  # beside what springs are
    assert not any(log.guard_counts.values())


@pytest.mark.slow
def test_a_load_that_neither_robot_nor_law_was_told_is_made_up_for_and_named():
    drawn = [f"{name}=4001" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    untold = ["station.drive.payload=0", "servo.model.payload=0"]
    log = run(load_scenario("everything", [*untold, *drawn]), "self_calibrating")
    on_path, at_rest = tip_errors(log)
    assert on_path.max() < 0.08e-3
    assert at_rest.max() < 0.01e-3
    assert log.learnt is not None
    (event,) = log.learnt["events"]
    assert event["kind"] == "load unlike belief"
    assert event["time_s"] < log.path_start
    assert not any(log.guard_counts.values())


@pytest.mark.slow
@pytest.mark.parametrize(("interface", "allowed"), [("direct", 0.05e-3), ("egm", 0.1e-3)])
def test_a_load_of_which_the_robot_alone_was_not_told_is_made_up_for(interface, allowed):
    """What users forget: truetip and the camera know of the load, the robot's own controller does not."""
    drawn = [f"{name}=4001" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    untold = ["station.drive.payload=0", f"station.interface={interface}"]
    log = run(load_scenario("everything", [*untold, *drawn]), "self_calibrating")
    on_path, at_rest = tip_errors(log)
    assert on_path.max() < allowed  # 0.3 mm and more if the drives are believed to hold it
    assert at_rest.max() < 0.005e-3
    assert not any(log.guard_counts.values())


@pytest.mark.slow
@pytest.mark.parametrize(("interface", "times"), [("egm", 100 / 60 * 25 / 15 * 10 / 5), ("direct", None)])
def test_gains_of_drives_that_nobody_knows_are_found(interface, times):
    """A controller gives way five times as far as believed; else over EGM the tip is 0.9 mm off.

    Where torques are sent, motors tell no more than that the drives are softer.
    """
    cascade = zip(("velocity", "position", "integral"), (60, 15, 5), strict=True)
    soft = [f"station.drive.cascade.{name}={value}" for name, value in cascade]
    drawn = [f"{name}=3000" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    settings = [f"station.interface={interface}", *soft, *drawn]
    log = run(load_scenario("everything", settings), "self_calibrating")
    laps = lap_metrics(log, pose_errors(log, "true"))
    assert log.learnt is not None
    events = log.learnt["events"]
    assert {event["kind"] for event in events} == {"drive gains unlike belief"}
    assert len(events) <= 2
    if times:
        assert events[0]["size"] == pytest.approx(times, rel=0.2)  # as far
    assert events[0]["size"] > 1.5
    assert log.path_start > 6.5  # s: the probe has begun anew, and the path has waited for it
    assert laps[0]["max_norm_mm"] < (0.08 if times else 0.05)
    assert tip_errors(log)[1].max() < 0.005e-3
    assert not any(log.guard_counts.values())


@pytest.mark.slow
def test_a_camera_that_shows_little_has_the_probe_repeated_while_the_path_waits():
    """Of 30 Hz, with twice the noise that is believed; one probe leaves 0.12 mm on the first lap."""
    camera = ["period=0.0333", "position_sigma=1e-4", "orientation_sigma_deg=0.02"]
    drawn = [f"{name}=3001" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    log = run(
        load_scenario("everything", [*drawn, *(f"station.camera.{each}" for each in camera)]),
        "self_calibrating",
    )
    assert log.learnt is not None
    repeated = [event for event in log.learnt["events"] if event["kind"] == "probe repeated"]
    assert 1 <= len(repeated) <= 3
    assert log.path_start > 4.0 + 3.0 * len(repeated)  # s
    assert lap_metrics(log, pose_errors(log, "true"))[0]["max_norm_mm"] < 0.1
    assert not any(log.guard_counts.values())


@pytest.mark.slow
def test_a_tool_that_is_displaced_before_a_slow_camera_is_no_load():
    drawn = [f"{name}=3001" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    knocked = "station.events=[!ToolShift {at: 6, shift_mm: [0.29, 0.29, 0.29]}]"
    once = "servo.laws.self_calibrating.probe.repeats=0"  # it is on the path when that happens
    settings = [*drawn, knocked, once, "station.camera.period=0.0333"]
    log = run(load_scenario("everything", settings), "self_calibrating")
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    assert errors[log.time > 7.0].max() < 0.1e-3  # 0.7 mm for seconds if it is taken for a load
    assert log.learnt is not None
    assert not [event for event in log.learnt["events"] if "load" in event["kind"]]


@pytest.mark.slow
def test_a_dead_time_that_changes_on_the_path_is_learnt_while_the_tip_stays_on_its_track():
    only = "servo.laws.self_calibrating.known_on_path=1"  # nothing else makes it slower
    settings = ["station.events=[!DeadTimeChange {at: 6, dead_time: 0.033}]", "seed=1001", only]
    experiment = Experiment(load_scenario("everything", settings), "self_calibrating")
    experiment.advance(until=8.0)
    log = experiment.log()
    errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
    late = errors[(log.time >= 6.0) & (log.time < 6.5)].max()
    assert late > 1e-3  # 30 ms of its way
    assert errors[log.time >= 6.5].max() < 0.2 * late
    assert errors[log.time >= 7.5].max() < 0.1e-3
    # All joints are late alike: the tip is late too, but where it has to pass.
    on_track = log.time >= 6.0
    track = log.X_WE_desired[:, :3, 3]
    aside = [
        np.linalg.norm(track - p, axis=1).min() for p in log.X_WE_true[on_track][:125:5, :3, 3]
    ]  # to the nearest of points 4 ms apart
    assert max(aside) < 0.25 * late
    # It went slowly meanwhile.
    assert 0.2 < 8.0 - experiment.servo.path_time(experiment.context) < 1.2
    assert log.learnt is not None
    assert [event["kind"] for event in log.learnt["events"]] == ["dead time changed"]
    assert log.learnt["dead_time_s"] == pytest.approx(0.037, abs=0.2e-3)
    assert not any(log.guard_counts.values())


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "drift"), [(1001, 500), (1004, 500), (3001, 50), (3001, 100)])
def test_a_camera_clock_that_drifts_is_learnt_before_it_matters(seed, drift):
    """Crystals differ by tens of ppm: a millisecond within a lap, and half a millimetre at 0.5 m/s."""
    drawn = [f"{name}={seed}" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    scenario = load_scenario("everything", [f"station.camera.clock_drift_ppm={drift}", *drawn])
    experiment = Experiment(scenario, "self_calibrating")
    experiment.advance(until=8.0)
    log = experiment.log()
    assert tip_errors(log)[0].max() < 0.06e-3
    assert log.learnt is not None
    assert not log.learnt["events"]
    # Of what corrects the stamps; four seconds of small motions tell it to some 27 ppm.
    assert log.learnt["clock_drift_ppm"] == pytest.approx(-drift, rel=0.1, abs=40.0)


@pytest.mark.slow
def test_a_path_ahead_that_is_little_known_is_run_slowly_and_more_exactly():
    """With a dead time of 300 ms that nobody knew, what is seen acts late on the first lap."""
    drawn = [f"{name}=3008" for name in ("seed", "station.errors.random.seed", "station.variation.seed")]
    largest, ends = [], []
    for known in ("1", "3e-5"):
        settings = ["station.drive.dead_time=0.296", f"servo.laws.self_calibrating.known_on_path={known}"]
        log = run(load_scenario("everything", [*settings, *drawn]), "self_calibrating")
        errors = np.linalg.norm(pose_error(log.X_WE_desired, log.X_WE_true)[:, 3:], axis=1)
        largest.append(errors[log.time >= log.path_start].max())
        ends.append(log.time[-1])
    assert largest[1] < min(0.06e-3, 0.7 * largest[0])  # m
    assert 1.0 < ends[1] - ends[0] < 8.0  # s, of a path of 15 s
