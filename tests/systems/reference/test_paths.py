"""Paths: the profile in time, the geometry of each shape, how the pieces join, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.yaml import yaml_load_typed
from scipy.integrate import cumulative_simpson

from robots.pose import pose_error, rotation_from_zyx
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.segment import line
from systems.reference.shapes import Circle, FigureEight, Points, Rectangle, Waypoint, rectangle_waypoints
from systems.reference.timing import SineSquaredProfile

TILTED = np.array([30.0, 40.0, 50.0])
SHAPES = {
    "rectangle": ReferenceConfig(),
    "points": ReferenceConfig(Points(), dwell=0.5),
    "circle": ReferenceConfig(Circle(plane_zyx_deg=TILTED, turns=2)),
    "figure_eight": ReferenceConfig(FigureEight(plane_zyx_deg=TILTED)),
    "smooth rectangle": ReferenceConfig(timing="polynomial"),
}
every_shape = pytest.mark.parametrize("config", SHAPES.values(), ids=SHAPES.keys())
fractions = st.floats(0.0, 1.0)
angles = st.lists(st.floats(-math.pi, math.pi), min_size=3, max_size=3)


def inside(path, fraction: float) -> float:
    """A time between a little before the path and a little after it."""
    return -0.1 + fraction * (path.duration + 0.2)


@every_shape
@given(fraction=fractions)
def test_twist_and_acceleration_are_derivatives_of_the_pose(config: ReferenceConfig, fraction: float):
    path = make_path(config)
    t, h = inside(path, fraction), 1e-5
    _, V, A = path.sample(t)
    (X_before, V_before, _), (X_after, V_after, _) = path.sample(t - h), path.sample(t + h)
    # h^2/6 times the third derivative (below 100 in these shapes), plus rounding of 1e-16 / h.
    np.testing.assert_allclose(pose_error(X_after, X_before) / (2.0 * h), V, atol=1e-8)
    np.testing.assert_allclose((V_after - V_before) / (2.0 * h), A, atol=1e-8)


@every_shape
def test_pose_twist_and_acceleration_are_continuous(config: ReferenceConfig):
    path = make_path(config)

    def largest_steps(samples: int) -> np.ndarray:
        times = np.linspace(-0.1, path.duration + 0.1, samples)
        return np.array([np.abs(np.diff(part, axis=0)).max() for part in path.sample(times)])

    # Of a continuous function the largest step shrinks with the grid, a jump stays what it is.
    assert np.all(largest_steps(40_001) < 0.6 * largest_steps(20_001))


@every_shape
def test_rests_before_the_start_and_after_the_last_pose(config: ReferenceConfig):
    path = make_path(config)
    for inner, outer in [(path.path_start, -1.0), (path.dwell_start, path.duration + 1.0)]:
        X, V, A = path.sample(outer)
        np.testing.assert_allclose(X, path.sample(inner)[0], atol=1e-15)
        assert not np.any(V)
        assert not np.any(A)
    assert path.duration - path.dwell_start == pytest.approx(config.dwell)


@every_shape
def test_many_times_at_once_give_the_same_as_one_by_one(config: ReferenceConfig):
    path = make_path(config)
    times = np.linspace(-0.1, path.duration + 0.1, 400)
    for batch, single in zip(path.sample(times), zip(*map(path.sample, times), strict=True), strict=True):
        np.testing.assert_allclose(batch, np.array(single), atol=1e-14)  # rounding of values below 10


def test_the_rectangle_hits_its_corners():
    path = make_path(ReferenceConfig())
    side = 2.0 * math.sqrt(2.0 / 0.7)
    corners = [(0.35, 0.45, 180), (0.55, 0.45, 90), (0.55, -0.45, 0), (0.35, -0.45, 90), (0.35, 0.45, 180)]
    for i, (x, y, alpha) in enumerate(corners):
        X, V, _ = path.sample(i * side)
        np.testing.assert_allclose(X[:3, 3], [x, y, 0.4], atol=1e-15)
        np.testing.assert_allclose(X[:3, :3], rotation_from_zyx(np.deg2rad([alpha, 0.0, 90.0])), atol=1e-15)
        np.testing.assert_allclose(V, 0.0, atol=1e-15)
    assert path.duration == pytest.approx(4.0 * side + 2.0)


def test_the_rectangle_turns_by_90_degrees_a_side_about_the_vertical():
    path = make_path(ReferenceConfig())
    side = path.dwell_start / 4.0
    peak = math.sqrt(0.7 / 2.0)
    for i, (sign, travel) in enumerate(
        [(-1, [0.2, 0, 0]), (-1, [0, -0.9, 0]), (1, [-0.2, 0, 0]), (1, [0, 0.9, 0])]
    ):
        X, V, _ = path.sample((i + 0.5) * side)
        np.testing.assert_allclose(V, peak * np.array([0, 0, sign * math.pi / 2, *travel]), atol=1e-14)
        half_turned = (
            rotation_from_zyx(np.array([sign * math.pi / 4, 0.0, 0.0])) @ path.sample(i * side)[0][:3, :3]
        )
        np.testing.assert_allclose(X[:3, :3], half_turned, atol=1e-14)


@given(start=angles, end=angles)
def test_a_line_leads_from_any_orientation_to_any_other(start: list[float], end: list[float]):
    X_start, X_end = np.eye(4), np.eye(4)
    X_start[:3, :3], X_end[:3, :3] = rotation_from_zyx(np.array([start, end]))
    segment = line(X_start, X_end)
    for s, X in [(0.0, X_start), (1.0, X_end)]:
        u = segment.angle * s
        reached = np.array([1.0, s, math.sin(u), math.cos(u), math.sin(2.0 * u)]) @ segment.pose
        # Angles within 1e-7 of half a turn or of none are resolved no better by the rotation vector.
        np.testing.assert_allclose(reached.reshape(4, 4), X, atol=1e-7)
    assert segment.angle <= math.pi + 1e-12


@given(fraction=fractions)
def test_the_circle_pulls_towards_its_center(fraction: float):
    config = SHAPES["circle"]
    path = make_path(config)
    X, V, A = path.sample(inside(path, fraction))
    normal = rotation_from_zyx(np.deg2rad(TILTED))[:, 2]
    arm = X[:3, 3] - np.array([0.45, 0.0, 0.4])
    assert np.linalg.norm(arm) == pytest.approx(0.1)
    assert arm @ normal == pytest.approx(0.0, abs=1e-14)
    assert V[3:] @ np.cross(normal, arm) >= 0.0  # from x towards y
    assert -A[3:] @ arm / 0.1 == pytest.approx(V[3:] @ V[3:] / 0.1, abs=1e-12)
    np.testing.assert_allclose(X[:3, :3], rotation_from_zyx(np.deg2rad([90.0, 0.0, 90.0])), atol=1e-14)
    assert not np.any(V[:3])
    assert not np.any(A[:3])


@pytest.mark.parametrize("turns", [1, 3])
def test_the_circle_runs_all_its_turns_in_one_motion(turns: int):
    path = make_path(ReferenceConfig(Circle(turns=turns)))
    assert path.dwell_start == pytest.approx(2.0 * math.sqrt(2.0 * turns / 0.7))
    t = np.linspace(0.0, path.dwell_start, 4001)
    distance = cumulative_simpson(np.linalg.norm(path.sample(t)[1][:, 3:], axis=-1), x=t)[-1]
    assert distance == pytest.approx(turns * 2.0 * math.pi * 0.1, rel=1e-9)


def test_the_figure_eight_closes_crosses_its_center_and_fills_its_box():
    path = make_path(SHAPES["figure_eight"])
    times = np.linspace(0.0, path.dwell_start, 20_001)
    X, V, _ = path.sample(times)
    p = (X[:, :3, 3] - np.array([0.45, 0.0, 0.4])) @ rotation_from_zyx(np.deg2rad(TILTED))
    for i in (0, 10_000, 20_000):
        np.testing.assert_allclose(p[i], 0.0, atol=1e-15)
    # 20 000 samples miss an extremum by at most half a step, of second order in the step: below 1e-8 m.
    np.testing.assert_allclose(np.abs(p).max(axis=0), [0.1, 0.05, 0.0], atol=1e-8)
    assert p[5000, 0] * p[15_000, 0] < 0.0  # one loop on each side
    assert np.all(np.linalg.norm(V[1:-1], axis=-1) > 0.0)  # never stops on the way


def test_points_rests_at_every_one_of_them():
    path = make_path(ReferenceConfig(Points(), dwell=0.5, settle=1.0))
    move = 2.0 * math.sqrt(2.0 / 0.7)
    for i, (x, y) in enumerate([(0.35, 0.45), (0.55, 0.45), (0.55, -0.45), (0.35, -0.45), (0.35, 0.45)]):
        X, V, A = path.sample(1.0 + i * (0.5 + move) + np.array([0.01, 0.25, 0.49]))
        np.testing.assert_allclose(X[:, :2, 3], np.tile([x, y], (3, 1)), atol=1e-15)
        assert not np.any(V)
        assert not np.any(A)
    assert path.duration == pytest.approx(1.0 + 5 * 0.5 + 4 * move)


def test_a_path_of_one_point_holds_its_pose():
    point = Waypoint(np.array([400.0, 0.0, 400.0]), np.array([90.0, 0.0, 90.0]))
    path = make_path(ReferenceConfig(Rectangle([point]), dwell=3.0, settle=1.0))
    X, V, A = path.sample(np.linspace(-0.1, path.duration + 0.1, 100))
    np.testing.assert_allclose(X, np.tile(point.pose(), (100, 1, 1)), atol=1e-15)
    assert not V.any()
    assert not A.any()
    assert path.duration == pytest.approx(1.0 + SineSquaredProfile(0.7).duration + 3.0)


@every_shape
def test_settling_shifts_everything(config: ReferenceConfig):
    early = make_path(config)
    late = make_path(ReferenceConfig(**{**vars(config), "settle": 0.75}))
    assert late.path_start == 0.75
    assert late.dwell_start == pytest.approx(early.dwell_start + 0.75)
    assert late.duration == pytest.approx(early.duration + 0.75)
    times = np.linspace(-0.5, early.duration, 50)
    for shifted, original in zip(late.sample(times + 0.75), early.sample(times), strict=True):
        np.testing.assert_allclose(shifted, original, atol=1e-13)  # rounding of the time


@pytest.mark.parametrize("name", ["rectangle", "circle", "figure_eight"])
def test_every_lap_is_the_first_one_again_without_a_pause(name: str):
    once, path = (make_path(ReferenceConfig(SHAPES[name].path, settle=1.0, laps=laps)) for laps in (1, 3))
    length = once.dwell_start - once.path_start
    np.testing.assert_allclose(path.lap_starts, 1.0 + length * np.arange(3))
    assert path.dwell_start == pytest.approx(1.0 + 3.0 * length)
    t = np.linspace(1.0, 1.0 + length, 101)
    for start in path.lap_starts:
        for again, first in zip(path.sample(t - 1.0 + start), once.sample(t), strict=True):
            np.testing.assert_allclose(again, first, atol=1e-9)


def test_a_new_path_is_a_few_lines_of_a_scenario():
    config = yaml_load_typed(
        schema=ReferenceConfig,
        data="""
        path: !Rectangle
          waypoints:
          - {translation_mm: [400, 100, 400], zyx_deg: [90, 0, 90]}
          - {translation_mm: [400, -100, 400], zyx_deg: [90, 0, 90]}
        """,
    )
    X, V, _ = make_path(config).sample(math.sqrt(2.0 / 0.7))
    np.testing.assert_allclose(X[:3, 3], [0.4, 0.0, 0.4], atol=1e-15)
    np.testing.assert_allclose(V, [0, 0, 0, 0, -0.2 * math.sqrt(0.35), 0], atol=1e-15)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (ReferenceConfig(Rectangle([])), "path 'rectangle' needs at least one waypoint, got none"),
        (ReferenceConfig(acceleration=0.0), "acceleration must be finite and positive, got 0.0"),
        (ReferenceConfig(acceleration=math.nan), "acceleration must be finite and positive, got nan"),
        (ReferenceConfig(dwell=-1.0), "dwell must be finite and not negative, got -1.0 s"),
        (ReferenceConfig(settle=math.inf), "settle must be finite and not negative, got inf s"),
        (ReferenceConfig(laps=0), "laps must be a whole number from 1 on, got 0"),
        (
            ReferenceConfig(Rectangle(rectangle_waypoints()[:2]), laps=2),
            "2 laps need a path that ends where it starts, but the ends of 'rectangle' are 200 mm and 90 deg",
        ),
        (ReferenceConfig(preview=-0.01), "preview must be finite and not negative, got -0.01 s"),
        (
            ReferenceConfig(Rectangle([Waypoint(), Waypoint(np.array([0, math.nan, 0]))])),
            "waypoint 2 translation_mm",
        ),
        (ReferenceConfig(Rectangle([Waypoint(zyx_deg=np.zeros(2)), Waypoint()])), "waypoint 1 zyx_deg"),
        (ReferenceConfig(Circle(radius_mm=0.0)), "circle radius_mm must be"),
        (ReferenceConfig("circle"), "path must be a Rectangle, Circle, .* got 'circle'"),  # type: ignore
        (
            ReferenceConfig(Points([(0.5, 0.0, 0.4)])),  # type: ignore
            r"waypoint 1 must be a Waypoint, got \(0.5, 0.0, 0.4\)",
        ),
        (ReferenceConfig(Circle(turns=0)), "circle turns must be between 1 and 100000, got 0"),
        (
            ReferenceConfig(FigureEight(width_mm=-1.0)),
            "width_mm must be",
        ),
    ],
)
def test_refuses_what_is_no_path(config: ReferenceConfig, message: str):
    with pytest.raises(ValueError, match=message) as refusal:
        make_path(config)
    assert str(refusal.value).startswith("reference: ")
    assert "\n" not in str(refusal.value)
