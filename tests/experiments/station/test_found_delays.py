"""Delays that were measured as a scenario file."""

from pathlib import Path

from diagrams.scenario.scenario import load_scenario
from experiments.station.found_delays import scenario_with
from experiments.station.latency import Latency
from tests.experiments.commands import refusal, truetip


def test_delays_are_written_on_top_of_what_was_set_and_found_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "o'clock.yaml").write_text("extends: cell\nstation: {payload: 1}\n")
    monkeypatch.chdir(tmp_path)
    delays = Latency(0.004, 0.05, 0.046, 1e-4, 0.0, 0.02, 1e-4, 0.0, None, None, {}, {})
    settings = ["station.payload=2.5", "station.drive.dead_time=0.1", "initial_error_mm=[1, 0, 2]"]
    text = scenario_with("mine/o'clock.yaml", delays, settings, Path("found/delays.yaml"))
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "delays.yaml").write_text(text)
    scenario = load_scenario("found/delays.yaml")
    assert (scenario.station.payload, *scenario.initial_error_mm) == (2.5, 1.0, 0.0, 2.0)
    assert scenario.station.drive.dead_time == 0.046
    assert scenario.station.camera.delay == 0.02


def test_what_cannot_stand_beside_the_delays_is_refused_before_anything_moves(tmp_path):
    line = refusal(
        truetip("latency", "--set", "station.drive={dead_time: 0.1}", "--write", tmp_path / "found.yaml")
    )
    assert "--set ...drive={dead_time: 0.1} and station.drive.command_delay cannot stand in one file" in line
