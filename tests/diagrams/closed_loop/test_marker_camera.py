"""A marker camera in the station: it takes the place of the pose camera, and the loop closes over it."""

import numpy as np
import pytest

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment, run
from diagrams.scenario.scenario import ScenarioError, load_scenario
from experiments.metrics.run_metrics import error_metrics

SETTLED = [
    "reference.path=circle",
    "reference.acceleration=8",
    "reference.settle=2",
    "reference.dwell=1.2",
]
EXACT = ["station.camera.position_sigma=0", "station.camera.orientation_sigma_deg=0"]
BRIEF = [*SETTLED, "reference.acceleration=20", "reference.settle=0.1", "reference.dwell=0"]


def log(kind: str, settings: list[str], seed: int = 0) -> RunLog:
    scenario = load_scenario("misaligned", [*settings, f"station.camera.kind={kind}"])
    return run(scenario, "numerical_ik", seed=seed)


@pytest.mark.slow
def test_a_misaligned_robot_comes_to_rest_where_it_should():
    """The requirement with 0.1 px of noise is 0.05 mm and 0.02 degrees; the open loop is 30 mm off."""
    errors = error_metrics(log("features", SETTLED), "true")
    assert max(errors["static_mm"]) < 0.05
    assert max(errors["static_deg"]) < 0.02


@pytest.mark.slow
def test_the_same_seed_gives_the_same_log():
    once, again, other = (log("features", BRIEF, seed) for seed in (0, 0, 1))
    for name in ("X_WE_true", "X_WE_measured", "position_command"):
        np.testing.assert_array_equal(getattr(again, name), getattr(once, name))
        assert not np.array_equal(getattr(other, name), getattr(once, name))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["features", "images"])
def test_the_tip_moves_as_under_a_pose_camera_without_noise(kind: str):
    """What differs is noise of some 20 um, which the law follows."""
    ours, exact = log(kind, BRIEF), log("pose", [*BRIEF, *EXACT])
    assert np.isfinite(ours.X_WE_measured[:-1]).all()
    difference = np.abs(ours.X_WE_true[:, :3, 3] - exact.X_WE_true[:, :3, 3]).max()
    assert 1e-9 < difference < 1e-4


def test_the_arm_hides_markers_of_the_true_station():
    """The camera hears of the motors; without them it would see through the arm."""
    scenario = load_scenario("misaligned", ["station.camera.kind=features"])
    diagram = Experiment(scenario, "open_loop").diagram
    camera = diagram.GetSubsystemByName("camera")
    motors = diagram.GetSubsystemByName("motor_signals")
    wires = diagram.connection_map()
    assert wires[camera, camera.GetInputPort("motor_state").get_index()] == (motors, 0)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("station.camera.kind=stereo", "station.camera must be one of pose, features, images"),
        ("station.markers.cell=nowhere", "cell 'nowhere': no file"),
        ("station.markers.features.missing=2", r"features: missing must be in \[0, 1\), got 2"),
        ("station.markers.images.exposure=0", "images: exposure must be positive, got 0"),
        ("station.markers.pixels=0", "pixels"),
    ],
)
def test_wrong_settings_are_refused(setting: str, message: str):
    settings = [setting] if "kind" in setting else ["station.camera.kind=features", setting]
    with pytest.raises((ScenarioError, ValueError), match=message):
        Experiment(load_scenario("misaligned", settings), "numerical_ik")
