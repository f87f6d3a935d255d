"""Laws on many random robots: what is drawn, how it is judged, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagrams.record.log import GuardEvent
from diagrams.scenario.scenario import load_scenario
from experiments.robustness import command, study
from experiments.robustness.cases import CASES
from experiments.robustness.contenders import contenders
from experiments.robustness.mixed import ROBOTS
from experiments.robustness.study import Case, judged, trials
from systems.reference.paths import make_path
from systems.reference.shapes import Circle
from tests.experiments.commands import refusal, truetip
from tests.experiments.synthetic import comparison

QUICK = ["reference.settle=0", "reference.dwell=0.5", "reference.acceleration=8", "station.elasticity=rigid"]
OPEN_LOOP = contenders("open_loop")


def test_every_case_is_a_scenario_and_only_the_seed_draws_the_robot():
    chosen = [case for case in CASES.values() if case.draw is None]
    for trial in trials("everything", chosen, OPEN_LOOP, [3], ["circle"], laps=2):
        scenario = load_scenario(trial.scenario, trial.settings)
        station = scenario.station
        assert (scenario.seed, station.errors.random.seed, station.variation.seed) == (3, 3, 3)
        assert isinstance(scenario.reference.path, Circle)
        assert scenario.reference.laps == 2
        assert bool(station.events) == (trial.case.recovered_at is not None)


@pytest.mark.slow
def test_a_mixture_is_a_scenario_and_the_same_whenever_its_seed_is_drawn():
    todo, again = (trials("everything", [CASES["mixed"]], OPEN_LOOP, range(60), ["circle"]) for _ in "12")
    assert [trial.settings for trial in todo] == [trial.settings for trial in again]
    loaded = [load_scenario(trial.scenario, trial.settings) for trial in todo]
    assert {trial.drawn.robot for trial in todo} == set(ROBOTS)
    for name in ("dead_time", "command_delay"):
        assert len({getattr(each.station.drive, name) for each in loaded}) >= 4
    # Some controllers are told of their dead time to 3 ms, some not at all.
    late = []
    for station, model in ((each.station, each.servo.model) for each in loaded):
        assert model.command_delay is not None
        late.append(station.drive.command_delay + station.drive.dead_time - model.command_delay)
    assert min(late) == pytest.approx(3e-3)
    assert max(late) > 0.1


@pytest.mark.slow
def test_what_is_set_for_all_outweighs_what_is_drawn():
    case = replace(CASES["mixed"], settings=("station.period=0.006", "station.drive.command_delay=0.006"))
    (trial,) = trials("everything", [case], OPEN_LOOP, [3], ["circle"], robot="ur10")
    assert trial.load().station.period == 0.006
    assert trial.load().robot == "ur10"


def row(seed: int, laps: list[float], failure: str | None = None, times_planned: float = 1.0) -> dict:
    if failure:
        return {"seed": seed, "path": "circle", "failure": failure}
    return {
        "seed": seed,
        "path": "circle",
        "failure": None,
        "max_norm_mm": max(laps),
        "static_mm": 0.1 * seed,
        "static_deg": 0.01 * seed,
        "laps": [
            {"max_norm_mm": lap, "max_angle_deg": 0.1 * lap, "rms_mm": lap, "times_planned": times_planned}
            for lap in laps
        ],
        "guard": {"velocity_limit": seed},
    }


def test_worst_and_median_are_taken_over_the_runs_that_came_to_their_end():
    result = judged([row(1, [3.0, 1.0]), row(2, [5.0, 2.0]), row(3, [4.0, 3.0]), row(4, [], "ran away")])
    assert [lap["max_norm_mm"] for lap in result["laps"]] == [(5.0, 4.0), (3.0, 2.0)]
    assert result["static_mm"] == pytest.approx((0.3, 0.2))
    assert (result["worst_seed"], result["guard"]) == (2, 6)
    assert "worst_robot" not in result
    assert judged([row(1, [3.0]) | {"robot": "ur10"}])["worst_robot"] == "ur10"
    assert result["failures"] == ["seed 4, circle: ran away"]


def test_a_run_that_the_guard_stopped_is_named_and_its_figures_are_left_out(monkeypatch: pytest.MonkeyPatch):
    """The error of a robot that stands still may be smaller than that of one that runs its path."""
    (log,) = comparison(period=0.1)["pbvs"]
    stop = GuardEvent(3.0, "stopped", "", lasted=log.time[-1])
    monkeypatch.setattr(study, "run", lambda *_, **__: replace(log, guard_events=[stop]))
    (trial,) = trials("misaligned", [CASES["plain"]], OPEN_LOOP, [3], ["circle"])
    result = judged([study.run_trial(trial, lambda _: None)])
    said = "seed 3, circle: the guard stopped the robot at 3.0 s and it did not go on"
    assert result == {"runs": 1, "failures": [said]}


def test_without_a_single_run_there_are_only_failures():
    assert judged([row(1, [], "ran away")]) == {"runs": 1, "failures": ["seed 1, circle: ran away"]}


def test_a_case_is_a_name_and_settings():
    trial = trials(
        "misaligned", [Case("loaded", ("station.payload=3",))], contenders("pbvs"), [7], ["rectangle"]
    )[0]
    assert load_scenario(trial.scenario, trial.settings).station.payload == 3.0


def test_a_law_may_have_an_inverse_model_and_a_calibrated_robot():
    names = "pbvs, pbvs+flexible_joint, open_loop+rigid@calibrated, pbvs@calibrated"
    plain, beside, all_of_it, known = contenders(names)
    assert (plain.law, plain.feedforward, plain.is_calibrated, plain.settings) == ("pbvs", None, False, ())
    assert (beside.law, beside.feedforward) == ("pbvs", "flexible_joint")
    assert load_scenario("misaligned", list(beside.settings)).servo.feedforward.kind == "flexible_joint"
    assert (all_of_it.law, all_of_it.feedforward, all_of_it.is_calibrated) == ("open_loop", "rigid", True)
    assert (known.law, known.is_calibrated) == ("pbvs", True)
    assert len({each.title for each in (plain, beside, all_of_it, known)}) == 4


@pytest.mark.parametrize(("times", "is_said"), [(2.0, True), (1.001, False)])
def test_a_table_says_how_much_longer_than_planned_a_lap_took(monkeypatch, times: float, is_said: bool):
    rows = [row(seed, [2.0], times_planned=times) | {"case": "plain", "law": "open_loop"} for seed in (1, 2)]
    monkeypatch.setattr(command, "run_trials", lambda *_: rows)
    result = truetip("robustness", "--laws", "open_loop", "--seeds", 2)
    assert ("× 2.00 (2.00)" in result.output) == ("planned" in result.output) == is_said


def test_another_robot_gets_the_path_and_the_load_of_its_own_size():
    (trial,) = trials("everything", [CASES["plain"]], OPEN_LOOP, [3], ["rectangle"], robot="kr16")
    own, drawn = load_scenario(trial.scenario, trial.settings), trial.load()
    assert drawn.robot == "kr16"
    assert drawn.station.payload == pytest.approx(own.station.payload * 16.0 / 7.0)
    # The belief is wrong by the same share.
    assert drawn.servo.model.payload is not None
    assert drawn.servo.model.payload / drawn.station.payload == pytest.approx(0.95)
    assert drawn.station.errors.random.seed == 3
    paths = [make_path(each.reference) for each in (own, drawn)]
    poses = [path.sample(np.linspace(path.path_start, path.dwell_start, 200))[0] for path in paths]
    size = [np.ptp(X_WE[:, :3, 3], axis=0).max() for X_WE in poses]
    assert size[1] > 1.5 * size[0]


def test_coverage_is_that_of_the_worst_run_and_of_all_samples():
    rows = [
        row(seed, [1.0]) | {"coverage": {"share": share, "samples": samples}}
        for seed, share, samples in ((1, 0.9, 10), (2, 1.0, 30))
    ]
    assert judged(rows)["coverage"] == pytest.approx((0.9, 0.975))
    assert "coverage" not in judged([row(1, [1.0])])


@pytest.mark.slow
def test_the_command_prints_a_row_of_each_law_and_writes_the_numbers(tmp_path: Path):
    file = tmp_path / "numbers.json"
    settings = [part for setting in QUICK for part in ("--set", setting)]
    options = ["--scenario", "everything", "--paths", "circle", "--seeds", 2, "--jobs", 1, "--json", file]
    result = truetip("robustness", "--laws", "open_loop", *options, *settings)
    assert result.exit_code == 0, result.output
    numbers = json.loads(file.read_text())
    assert [run["seed"] for run in numbers["runs"]] == [1000, 1001]
    worst, median = numbers["results"][0]["laps"][0]["max_norm_mm"]
    assert worst > median > 5.0  # millimetres, of robots that are off by some


@pytest.mark.slow
def test_a_robot_that_was_calibrated_before_keeps_the_open_loop_near_its_path(tmp_path: Path):
    """What is left is the sag of the gears that the controller believes in and this rigid plant has not."""
    file, laws = tmp_path / "numbers.json", "open_loop,open_loop@calibrated"
    settings = [part for setting in QUICK for part in ("--set", setting)]
    options = ["--paths", "circle", "--seeds", 1, "--jobs", 1, "--json", file]
    result = truetip("robustness", "--laws", laws, *options, *settings)
    assert result.exit_code == 0, result.output
    drawn, known = json.loads(file.read_text())["results"]
    assert drawn["static_mm"][0] > 5.0
    assert known["static_mm"][0] < 0.05 * drawn["static_mm"][0]


@pytest.mark.slow
def test_what_is_left_after_an_event_is_told(tmp_path: Path):
    file = tmp_path / "numbers.json"
    settings = [part for setting in ["reference.settle=5.8", *QUICK[1:]] for part in ("--set", setting)]
    options = ["--scenario", "everything", "--paths", "circle", "--seeds", 1, "--jobs", 1, "--json", file]
    result = truetip("robustness", "--laws", "open_loop", "--cases", "tool-displaced", *options, *settings)
    assert result.exit_code == 0, result.output
    (judged_case,) = json.loads(file.read_text())["results"]
    assert judged_case["recovered_mm"][0] > 5.0


@pytest.mark.parametrize(
    ("failing", "code", "says"),
    [
        ([], 0, ""),
        ([("pbvs", 1001)], 0, ""),
        ([("pbvs", 1000), ("pbvs", 1001)], 1, "truetip: no run of pbvs came to its end\n"),
        ([(law, seed) for law in ("open_loop", "pbvs") for seed in (1000, 1001)], 1,
         "truetip: no run came to its end\n"),
    ],
    ids=("none", "one run", "one law", "all"),
)  # fmt: skip
def test_a_command_of_which_no_run_of_a_law_came_to_its_end_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: list, code: int, says: str
):
    """As a comparison has that lacks a law; among many robots one may fail, and is named."""
    file = tmp_path / "numbers.json"
    rows = [
        row(seed, [1.0], "ran away" if (law, seed) in failing else None) | {"case": "plain", "law": law}
        for law in ("open_loop", "pbvs")
        for seed in (1000, 1001)
    ]
    monkeypatch.setattr(command, "run_trials", lambda *_: rows)
    result = truetip("robustness", "--laws", "open_loop,pbvs", "--seeds", 2, "--json", file)
    assert (result.exit_code, result.stderr) == (code, says)
    assert sum(len(each["failures"]) for each in json.loads(file.read_text())["results"]) == len(failing)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--cases", "earthquake"], "--cases: must be of plain, 140ms"),
        (["--laws", "nothing"], "nothing"),
        (["--laws", "pbvs+elastic"], "'pbvs+elastic': behind + stands one of"),
        (["--laws", "pbvs@calibrated,pbvs@calibrated"], "'pbvs@calibrated' is there twice"),
        (["--cases", "plain,plain"], "--cases: 'plain' is there twice"),
        (["--paths", "circle,circle"], "--paths: 'circle' is there twice"),
        (["--seeds", 0], "--seeds"),
        (["--paths", "spiral"], "spiral"),
        (
            ["--cases", "camera-moved", "--set", "reference.acceleration=6"],
            "case camera-moved: the path ends at 10.6 s, what happens on it must be made up for by 11 s",
        ),
        (["--robot", "kr17"], "kr17"),
        (["--scenario", "nowhere"], "scenario 'nowhere': no file"),
    ],
)
def test_refuses_what_cannot_be_run_before_anything_runs(arguments: list, message: str):
    assert message in refusal(truetip("robustness", *arguments))
