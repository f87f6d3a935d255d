"""What happens to a station at its time: the true tip, what the camera sees, and when commands arrive."""

import numpy as np
import pytest

from diagrams.record.log import RunLog
from diagrams.runs.simulation import Experiment
from robots.pose import pose_error
from tests.diagrams.rigs import QUIET, scenario

AT = 0.3
FAST = ["reference.settle=0", "reference.acceleration=3", *QUIET]
RIGID = ["station.elasticity=rigid"]


def ran(*settings: str, law: str = "open_loop", until: float = 0.6) -> RunLog:
    experiment = Experiment(scenario("misaligned", *FAST, *settings), law)
    experiment.advance(until)
    return experiment.log()


def event(text: str) -> str:
    return f"station.events=[{text}]"


@pytest.fixture(scope="module")
def undisturbed() -> RunLog:
    return ran(*RIGID)


def test_a_displaced_tool_is_another_point_of_the_same_robot(undisturbed: RunLog):
    log = ran(*RIGID, event(f"!ToolShift {{at: {AT}, shift_mm: [0.5, 0, 0]}}"))
    moved = log.X_WE_true[:, :3, 3] - undisturbed.X_WE_true[:, :3, 3]
    after = log.time >= AT - 1e-9
    assert np.array_equal(log.joint_position, undisturbed.joint_position)
    assert not moved[~after].any()
    np.testing.assert_allclose(moved[after], 0.5e-3 * log.X_WE_true[after, :3, 0], atol=1e-12)
    seen = after & (log.time < log.time[-1])  # the last exposure is still to come
    np.testing.assert_allclose(log.X_WE_measured[seen], log.X_WE_true[seen], atol=1e-12)


def test_a_moved_camera_sees_everything_displaced_the_other_way(undisturbed: RunLog):
    log = ran(*RIGID, event(f"!CameraShift {{at: {AT}, shift_mm: [0, 0, 0.5], turn_deg: [0, 0, 90]}}"))
    after = (log.time >= AT - 1e-9) & (log.time < log.time[-1])
    before = log.time < AT - 1e-9
    assert np.array_equal(log.X_WE_true, undisturbed.X_WE_true)
    x, y, z = log.X_WE_true[after, :3, 3].T
    np.testing.assert_allclose(log.X_WE_measured[after, :3, 3].T, [y, -x, z - 0.5e-3], atol=1e-12)
    np.testing.assert_allclose(log.X_WE_measured[before], log.X_WE_true[before], atol=1e-12)


def test_a_slipped_joint_turns_the_tip_about_its_axis(undisturbed: RunLog):
    log = ran(*RIGID, event(f"!JointZeroShift {{at: {AT}, shift_deg: [1, 0, 0, 0, 0, 0]}}"))
    i = int(np.searchsorted(log.time, AT - 1e-9))  # the robot has not had the time to move
    error = pose_error(log.X_WE_true[i], undisturbed.X_WE_true[i])
    np.testing.assert_allclose(np.rad2deg(error[:3]), [0.0, 0.0, 1.0], atol=1e-4)
    assert np.array_equal(log.joint_position[: i + 1], undisturbed.joint_position[: i + 1])


@pytest.mark.slow
def test_a_load_that_is_picked_up_bends_the_robot_as_the_same_load_from_the_start():
    still = ["reference.settle=20", "station.drive.payload=0", "station.errors.tool_zyx_deg=[0, 0, 0]"]
    always = ran("station.payload=7", *still, until=1.5)
    never = ran("station.payload=0", *still, until=0.1)
    picked = ran("station.payload=0", *still, event("!PayloadChange {at: 0.1, payload: 7}"), until=1.5)
    sag = [log.link_position[-1] - log.joint_position[-1] for log in (always, never, picked)]
    assert np.abs(sag[0] - sag[1]).max() > 2e-4
    np.testing.assert_allclose(sag[2], sag[0], atol=2e-6)


@pytest.mark.slow
def test_commands_come_later_by_the_change_of_the_dead_time():
    """A faster and a slower interface lead to the same path, one later than the other."""
    before = ran(*RIGID, "station.drive.dead_time=0.02")
    change = ran(
        *RIGID, "station.drive.dead_time=0.02", event("!DeadTimeChange {at: 0.1, dead_time: 0.05, over: 0.1}")
    )
    late = ran(*RIGID, "station.drive.dead_time=0.05")
    first = before.time <= 0.1 + 1e-9
    assert np.array_equal(change.joint_position[first], before.joint_position[first])
    after = change.time > 0.4  # what the change has stirred has died away
    distance = np.abs(late.joint_position - before.joint_position)[after].max()
    assert distance > 0.01
    np.testing.assert_allclose(change.joint_position[after], late.joint_position[after], atol=0.01 * distance)


def test_a_lost_camera_gives_no_sample():
    log = ran(*RIGID, event("!CameraLoss {at: 0.2, duration: 0.1}"))
    lost = np.isnan(log.X_WE_measured[:, 0, 0])
    wanted = np.logical_and(log.time >= 0.2 - 1e-9, log.time < 0.3 - 1e-9)
    assert np.array_equal(lost[1:-1], wanted[1:-1])


def test_warm_links_carry_the_tip_outwards():
    cold = ran(*RIGID, "station.link_growth_ppm_per_hour=0")
    warm = ran(*RIGID, "station.link_growth_ppm_per_hour=3.6e6")  # 1000 ppm a second
    growth = np.linalg.norm(warm.X_WE_true[:, :3, 3] - cold.X_WE_true[:, :3, 3], axis=1)
    assert growth[0] == 0.0
    reach = np.linalg.norm(cold.X_WE_true[-1, :3, 3])
    assert 0.5 < growth[-1] / (1e-3 * cold.time[-1] * reach) < 1.5


def test_an_event_must_say_what_it_is():
    with pytest.raises(ValueError, match=r"events\[0\] must begin with one of !PayloadChange, !ToolShift"):
        scenario("misaligned", event("{at: 1}"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "!PayloadChange {at: 99, payload: 1}",
            r"\[0\] \(PayloadChange\): at must be .* before the end",
        ),
        ("!PayloadChange {at: 1, payload: -1}", r"events\[0\].payload must be between 0 and 1000 kg, got -1"),
        ("!PayloadChange {at: 1, payload: 99}", "payload of .* must be between 0 and 7.0 kg, got 99"),
        ("!ToolShift {at: -1}", r"events\[0\].at must be positive, in s, got -1"),
        ("!CameraLoss {at: 1, duration: 0}", "duration must be positive, in s, got 0"),
        ("!DeadTimeChange {at: 1, dead_time: 0.2}", "over must be longer than the change of 0.2 s, got 0.1"),
    ],
)
def test_refuses_what_cannot_happen(text: str, message: str):
    with pytest.raises(ValueError, match=message):
        Experiment(scenario("misaligned", event(text)), "open_loop")
