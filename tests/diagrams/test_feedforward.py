"""Feedforward in the closed diagram: the true tip of an elastic robot on its path, in motion and at rest."""

from functools import cache

import numpy as np
import pytest

from diagrams.log import RunLog
from diagrams.run import Experiment, run
from diagrams.scenario import load_scenario
from experiments.metrics import summary

# Exact geometry, 7 kg, the path of table 5.1, drives of industry; the path is previewed by the command delay.
SETTINGS = [
    "station.payload=7",
    "initial_error_mm=[0, 0, 0]",
    "reference.preview=0.004",
    "reference.settle=0.3",
    "reference.dwell=1.0",
    "station.camera.position_sigma=0",
]


@cache
def errors(kind: str, law: str, stiffness_error: float = 0.0) -> dict:
    settings = [f"servo.feedforward.kind={kind}", f"servo.feedforward.stiffness_error={stiffness_error}"]
    scenario = load_scenario("nominal", [*SETTINGS, *settings, f"servo.laws.{law}.drive=cascade"])
    log: RunLog = run(scenario, law)
    return summary("", {law: [log]})["runs"][law]["true"]


def test_the_elastic_inverse_keeps_the_tip_on_the_path_without_a_camera():
    found = errors("flexible_joint", "open_loop")
    assert found["max_norm_mm"] <= 0.05
    assert max(found["static_mm"]) <= 0.005
    assert errors("rigid", "open_loop")["max_norm_mm"] > 1.0  # gravity bends a robot that thinks itself rigid


def test_wrong_stiffness_leaves_its_share_and_the_camera_takes_the_rest():
    wrong = errors("flexible_joint", "open_loop", 0.2)
    assert 0.1 < wrong["max_norm_mm"] <= 0.35
    assert max(errors("flexible_joint", "position_level", 0.2)["static_mm"]) <= 0.02


@pytest.mark.parametrize("law", ["numerical_ik", "position_level"])
def test_a_law_with_an_exact_model_has_little_left_to_do(law: str):
    assert errors("flexible_joint", law)["max_norm_mm"] < 0.1 * errors("none", law)["max_norm_mm"]


def test_torque_has_a_port_on_both_sides_only_where_it_is_fed_forward():
    for kind in ("none", "rigid"):
        scenario = load_scenario("nominal", [*SETTINGS, f"servo.feedforward.kind={kind}"])
        experiment = Experiment(scenario, "open_loop")
        for diagram, has in ((experiment.servo, "HasOutputPort"), (experiment.station, "HasInputPort")):
            assert getattr(diagram, has)("torque_feedforward") == (kind != "none")


@pytest.mark.parametrize("dead_time", [0.0, 0.02])
def test_torque_arrives_as_late_as_the_positions_that_it_belongs_to(dead_time: float):
    """With the whole delay previewed, a model that is exact leaves as little as without a delay."""
    settings = [f"station.drive.dead_time={dead_time}", f"reference.preview={0.004 + dead_time}"]
    scenario = load_scenario(
        "nominal",
        [*SETTINGS, *settings, "servo.feedforward.kind=flexible_joint", "servo.laws.open_loop.drive=cascade"],
    )
    log = run(scenario, "open_loop")
    gap = np.linalg.norm(log.X_WE_true[:, :3, 3] - log.X_WE_desired[:, :3, 3], axis=1)
    assert 1e3 * gap[log.time >= log.path_start].max() < 0.01
