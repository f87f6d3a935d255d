"""The guard by itself: whatever a law commands, what leaves it is finite, in range and slow enough."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description.model import load_robot
from systems.guard.guard import CommandGuard, GuardConfig
from tests.systems.rigs import PERIOD, GuardRig, assert_within_limits

ROBOT = load_robot("irb1200")
STEP = ROBOT.speed * PERIOD  # rad, the largest step of each joint
NOTHING = np.full(6, np.nan)
SMOOTH = GuardConfig(stop_time=0.25)

anything = st.one_of(st.floats(-10.0, 10.0), st.floats(allow_nan=True, allow_infinity=True))
joints = st.lists(anything, min_size=6, max_size=6).map(np.array)
commands = st.lists(st.tuples(joints, joints), min_size=5, max_size=40)


def cruise(rig: GuardRig, ticks: int, **measurement) -> tuple[np.ndarray, np.ndarray, dict]:
    """A law that turns all joints evenly at a tenth of their largest speed; positions, velocities, counts."""
    speed = 0.1 * ROBOT.speed
    rows = [rig.tick(speed * rig.time, speed, **measurement) for _ in range(ticks)]
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows]), rows[-1][2]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow")  # numbers up to 1e308
@given(commands=commands, start=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array))
def test_whatever_is_commanded_the_output_is_finite_in_range_and_within_speed_and_acceleration(
    commands, start
):
    rig = GuardRig(ROBOT, start=start)
    issued = [(start, np.zeros(6)), (start, np.zeros(6))]
    issued += [rig.tick(position, velocity)[:2] for position, velocity in commands]
    positions, velocities = (np.array(part) for part in zip(*issued, strict=True))
    assert np.isfinite(positions).all()
    assert np.all((positions >= ROBOT.lower) & (positions <= ROBOT.upper))
    assert_within_limits(ROBOT, positions, velocities)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow")
@settings(max_examples=30)
@given(commands=commands)
def test_after_the_last_command_the_robot_comes_to_rest_where_it_is(commands):
    """Also when the law falls silent for ever after any beginning."""
    rig = GuardRig(ROBOT, SMOOTH)
    for position, velocity in commands:
        rig.tick(position, velocity)
    longest = SMOOTH.stop_time + float((ROBOT.speed / ROBOT.acceleration).max())
    tail = [rig.tick(NOTHING, NOTHING) for _ in range(round(longest / PERIOD) + 2)]
    np.testing.assert_array_equal(tail[-1][1], 0.0)
    np.testing.assert_array_equal(tail[-1][0], tail[-2][0])


@pytest.mark.parametrize("is_commanded", [False, True])
def test_a_robot_that_does_not_follow_is_commanded_where_it_was_read_last(is_commanded: bool):
    """Also if its joints are read anew when the command has been worked out already."""
    rig = GuardRig(ROBOT)
    rig.running = False
    rig.tick(np.full(6, 0.01) if is_commanded else NOTHING)
    for joints in (np.full(6, 0.1), np.full(6, -0.2)):
        rig.hear(joints)
        np.testing.assert_array_equal(rig.issued()[0], joints)


def test_a_command_within_the_limits_passes_unchanged_and_counts_nothing():
    rig = GuardRig(ROBOT)
    for k in range(50):
        position, velocity = 0.9 * STEP * k * np.array([1, -1, 1, -1, 1, -1.0]) / 10.0, 0.09 * ROBOT.speed
        issued, speed, counts = rig.tick(position, velocity)
        np.testing.assert_allclose(issued, position, atol=1e-15)
        np.testing.assert_array_equal(speed, velocity)
    assert not any(counts.values())


def test_before_the_first_command_the_output_is_the_measured_position():
    start = np.linspace(-0.5, 0.5, 6)
    rig = GuardRig(ROBOT, start=start)
    issued, speed, counts = rig.tick(NOTHING, NOTHING)
    np.testing.assert_array_equal(issued, start)
    np.testing.assert_array_equal(speed, 0.0)
    assert not any(counts.values())  # a law needs one tick before it can answer


def test_a_jump_is_approached_on_the_straight_line_as_fast_as_the_slowest_joint_may():
    """All joints are slowed alike: joint 2 sets the pace. From rest to rest as time-optimal motion says."""
    rig = GuardRig(ROBOT)
    target = np.array([0.01, 0.5, 0.02, 0.05, 0.0, -0.1])
    found = [rig.tick(target) for _ in range(60)]
    positions = np.array([row[0] for row in found])
    share = positions[:, 1] / target[1]
    np.testing.assert_allclose(positions, np.outer(share, target), atol=1e-12)
    assert share.max() <= 1.0 + 1e-12  # nothing overshoots
    speed, acceleration = ROBOT.speed[1], ROBOT.acceleration[1]
    shortest = target[1] / speed + speed / acceleration  # a trapezoid
    assert abs(np.argmax(share > 1.0 - 1e-12) + 1 - shortest / PERIOD) < 2.0
    counts = found[-1][2]
    assert counts["velocity_limit"] > 0
    assert counts["acceleration_limit"] > 0


def test_only_a_share_of_the_speed_can_be_allowed():
    rig = GuardRig(ROBOT, GuardConfig(speed_share=0.1))
    found = [rig.tick(np.full(6, 1.0), ROBOT.speed) for _ in range(10)]
    positions, velocities = np.array([row[0] for row in found]), np.array([row[1] for row in found])
    assert np.max(np.diff(positions, axis=0) / STEP) == pytest.approx(0.1)
    assert np.max(velocities / ROBOT.speed) == pytest.approx(0.1)
    assert found[-1][2]["velocity_limit"] > 5


def test_the_very_ends_of_the_range_may_be_commanded():
    rig = GuardRig(ROBOT, start=0.7 * ROBOT.upper)
    for target in (ROBOT.upper, ROBOT.lower):
        for _ in range(400):
            issued, _, counts = rig.tick(target)
        np.testing.assert_allclose(issued, target, rtol=1e-15)
    assert counts["position_limit"] == 0


def test_a_joint_stops_at_the_end_of_its_range_and_the_others_go_on():
    start = np.zeros(6)
    start[2] = ROBOT.upper[2] - 0.5 * STEP[2]
    rig = GuardRig(ROBOT, start=start)
    velocity = 0.2 * ROBOT.speed
    for k in range(1, 11):
        issued, speed, counts = rig.tick(start + k * PERIOD * velocity, velocity)
    assert issued[2] == ROBOT.upper[2]
    assert speed[2] == 0.0
    others = np.array([0, 1, 3, 4, 5])
    np.testing.assert_allclose(issued[others], 10 * PERIOD * velocity[others])
    assert counts["position_limit"] == 8  # after 0.4 steps of 0.5 there is room for two more ticks


def test_a_missing_command_is_bridged_and_counted():
    rig = GuardRig(ROBOT)
    cruise(rig, 10)
    rig.tick(NOTHING, NOTHING)
    _, _, counts = rig.tick(0.1 * ROBOT.speed * rig.time, 0.1 * ROBOT.speed)
    assert counts["no_command"] == 1
    assert counts["stopped"] == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("joint", [0, 5])
@pytest.mark.parametrize("port", ["position", "velocity"])
def test_a_law_without_a_finite_command_for_half_a_second_is_stopped_for_good(
    port: str, joint: int, bad: float
):
    """One bad number of one joint is enough, in either port; a law that recovers later is not followed."""
    rig = GuardRig(ROBOT)
    positions, _, _ = cruise(rig, 10)
    broken = {"position": positions[-1].copy(), "velocity": 0.1 * ROBOT.speed}
    broken[port][joint] = bad
    for _ in range(round(0.5 / PERIOD) + 1):
        _, _, counts = rig.tick(broken["position"], broken["velocity"])
    assert counts["no_command"] >= round(0.5 / PERIOD) - 1
    held, _, _ = rig.tick(broken["position"], broken["velocity"])
    for _ in range(5):
        issued, speed, counts = rig.tick(np.zeros(6), np.zeros(6))
        np.testing.assert_array_equal(issued, held)
        np.testing.assert_array_equal(speed, 0.0)
    assert counts["stopped"] > 0


def test_without_samples_it_holds_after_50_ms_and_stops_smoothly_after_500_ms():
    """The clock runs from the last exposure. A tick that finds it too old decides about the next one."""
    rig = GuardRig(ROBOT)
    cruise(rig, 5)
    last = rig.time
    history = []
    speed = 0.1 * ROBOT.speed
    while rig.time < last + 1.0:
        time = rig.time
        history.append((time - last, *rig.tick(speed * rig.time, speed, seen=last)))
    ages = np.array([row[0] for row in history])
    velocities = np.array([row[2] for row in history])
    held, stopped = (np.array([row[3][kind] for row in history]) for kind in ("measurement_held", "stopped"))
    first_held, first_stopped = ages[np.argmax(held > 0)], ages[np.argmax(stopped > 0)]
    assert 0.05 < first_held <= 0.05 + 2 * PERIOD
    assert 0.5 < first_stopped <= 0.5 + 2 * PERIOD
    np.testing.assert_allclose(
        velocities[ages < first_stopped], speed[None].repeat(np.sum(ages < first_stopped), 0)
    )
    braking = velocities[ages >= first_stopped] / speed
    np.testing.assert_allclose(braking, braking[:, :1].repeat(6, axis=1), atol=1e-12)  # all joints alike
    assert np.all(np.diff(braking[:, 0]) <= 0.0)
    assert np.all(np.diff(braking[:, 0]) >= -PERIOD / 0.25 - 1e-9)
    assert ages[len(ages) - np.sum(velocities[:, 0] == 0.0)] <= first_stopped + 0.25 + 1e-9
    positions = np.array([row[1] for row in history])
    assert np.abs(np.diff(positions, axis=0)).max() > 0.0
    np.testing.assert_array_equal(np.diff(positions[-10:], axis=0), 0.0)


def test_once_stopped_it_stays_so_even_if_samples_return():
    rig = GuardRig(ROBOT)
    positions, velocities, counts = cruise(rig, 250, seen=0.0)
    assert counts["stopped"] > 0
    after, velocities, counts_after = cruise(rig, 20)
    np.testing.assert_array_equal(after, np.broadcast_to(positions[-1], after.shape))
    np.testing.assert_array_equal(velocities, 0.0)
    assert counts_after["stopped"] == counts["stopped"] + 20


def test_samples_that_return_in_time_end_the_hold():
    rig = GuardRig(ROBOT)
    _, _, before = cruise(rig, 50, seen=0.0)  # 200 ms
    _, velocities, after = cruise(rig, 50)
    assert before["measurement_held"] > 0
    assert after["measurement_held"] == before["measurement_held"] + 1  # decided one tick before
    assert after["stopped"] == 0
    np.testing.assert_allclose(velocities, np.broadcast_to(0.1 * ROBOT.speed, velocities.shape))


def test_a_law_that_does_without_the_camera_is_not_stopped_by_its_silence():
    rig = GuardRig(ROBOT, uses_camera=False)
    _, _, counts = cruise(rig, 250, seen=-np.inf)
    assert not any(counts.values())


def is_smooth(positions: np.ndarray, velocities: np.ndarray) -> bool:
    """Whether velocities are the derivative of positions and never jump by more than 2 % of the top speed."""
    steps = np.diff(positions, axis=0) / PERIOD
    means = 0.5 * (velocities[1:] + velocities[:-1])
    jumps = np.abs(np.diff(velocities, axis=0)) / ROBOT.speed
    return bool(np.abs(steps - means).max() < 1e-2 and jumps.max() < 0.02)


def test_when_the_camera_is_back_the_robot_may_be_led_back_onto_its_way():
    """It stops within 0.25 s, stands, and joins the moving command again without a jump."""
    rig = GuardRig(ROBOT, GuardConfig(resume=True, resume_time=0.8))
    cruise(rig, 50)
    lost = rig.time
    blind, blind_speed, counts = cruise(rig, 200, seen=lost)
    assert counts["stopped"] > 50
    back, back_speed, counts = cruise(rig, 260)
    assert counts["resumed"] == 200  # 0.8 s
    np.testing.assert_array_equal(blind_speed[-1], 0.0)
    assert is_smooth(np.concatenate([blind, back]), np.concatenate([blind_speed, back_speed]))
    wanted = 0.1 * ROBOT.speed * (rig.time - PERIOD)
    np.testing.assert_allclose(back[-1], wanted, atol=1e-12)


def test_a_stop_lasts_unless_resuming_is_wanted():
    rig = GuardRig(ROBOT)
    cruise(rig, 50)
    cruise(rig, 250, seen=rig.time)
    positions, _, counts = cruise(rig, 100)
    np.testing.assert_array_equal(positions[0], positions[-1])
    assert counts["resumed"] == 0


def test_a_robot_that_does_not_run_is_followed_and_then_led_back():
    """Somebody moved it meanwhile: the command starts from where it is, not from where it was."""
    rig = GuardRig(ROBOT)
    before = cruise(rig, 50)[0][-1]
    elsewhere = before + 0.05
    rig.start, rig.running = elsewhere, False
    idle, _, _ = cruise(rig, 20)
    np.testing.assert_array_equal(idle, np.broadcast_to(elsewhere, idle.shape))
    rig.running = True
    positions, velocities, counts = cruise(rig, 400)
    assert counts["stopped"] == 20
    assert is_smooth(np.vstack([idle[-1], positions]), np.vstack([np.zeros(6), velocities]))
    np.testing.assert_allclose(positions[-1], 0.1 * ROBOT.speed * (rig.time - PERIOD), atol=1e-12)


def test_ticks_with_refused_samples_or_a_correction_at_its_limit_are_counted():
    rig = GuardRig(ROBOT, correction_limit=0.1, correction_limit_deg=20.0)
    for refused, correction in (
        (0, [0.0, 0.0, 0.0, 0.09, 0.0, 0.0]),
        (1, [0.0, 0.0, 0.0, 0.0, 0.1, 0.0]),
        (1, [np.deg2rad(20.0), 0.0, 0.0, 0.0, 0.0, 0.0]),
        (3, [0.0, 0.3, 0.0, 0.0, 0.0, 0.0]),
    ):
        _, _, counts = rig.tick(np.zeros(6), refused=refused, correction=np.array(correction))
    assert counts["measurement_refused"] == 2
    assert counts["correction_limit"] == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hold_after": 0.0}, "0 < hold_after < stop_after is needed, got 0.0 s and 0.5 s"),
        ({"stop_after": 0.04}, "0 < hold_after < stop_after is needed, got 0.05 s and 0.04 s"),
        ({"stop_time": 0.0}, "stop_time and resume_time must be positive .* got 0.0 s"),
        ({"resume_time": 0.0}, "stop_time and resume_time must be positive .* got 0.25 s, 0.0 s"),
        ({"speed_share": 1.5}, r"speed_share in \(0, 1\], got 0.25 s, 1.0 s and 1.5"),
    ],
)
def test_refuses_a_guard_that_does_not_guard(change: dict, message: str):
    with pytest.raises(ValueError, match=f"guard: .*{message}"):
        CommandGuard(ROBOT, GuardConfig(**change), PERIOD, 0.1, 20.0)
