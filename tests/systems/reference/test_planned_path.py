"""Planned motions from files: written and read, between samples, and what is refused."""

import pickle
import shutil

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.planned_file import planned_text, read_planned
from systems.reference.shapes import Circle, Planned

PERIOD = 2e-3


@pytest.fixture(scope="module")
def circle():
    config = ReferenceConfig(Circle(turns=1), acceleration=2.0, timing="polynomial", dwell=0.0)
    return make_path(config)


@pytest.fixture(scope="module")
def file(circle, tmp_path_factory):
    times = PERIOD * np.arange(int(np.ceil(circle.duration / PERIOD)) + 1)
    path = tmp_path_factory.mktemp("plan") / "circle.csv"
    path.write_text(planned_text(times, circle.sample(times)[0], np.zeros((len(times), 6))))
    return str(path)


def test_between_samples_it_is_the_motion_that_was_written(circle, file):
    path = make_path(ReferenceConfig(Planned(file), settle=0.3, dwell=0.5))
    t = np.linspace(-0.1, circle.duration + 0.4, 700)
    for found, wanted, tolerance in zip(
        path.sample(t + 0.3), circle.sample(t), (1e-9, 1e-7, 2e-5), strict=True
    ):
        assert np.abs(found - wanted).max() < tolerance
    assert path.duration == pytest.approx(0.3 + path.dwell_start - path.path_start + 0.5)
    one = path.sample(1.0)
    assert np.array_equal(one[1], path.sample(np.array([1.0]))[1][0])


def test_rotation_velocity_and_acceleration_are_derivatives_of_the_rotation(tmp_path):
    """A tool that turns by more than half a turn about a skew axis, with quaternions of either sign."""
    from scipy.spatial.transform import Rotation

    t = PERIOD * np.arange(400)
    x = t / t[-1]
    angle = 4.0 * (462 * x**6 - 1980 * x**7 + 3465 * x**8 - 3080 * x**9 + 1386 * x**10 - 252 * x**11)
    X = np.tile(np.eye(4), (len(t), 1, 1))
    X[:, :3, :3] = Rotation.from_rotvec(np.outer(angle, [0.6, 0.0, 0.8])).as_matrix()
    file = tmp_path / "turn.csv"
    file.write_text(planned_text(t, X, np.zeros((len(t), 6))))
    path, h = make_path(ReferenceConfig(Planned(str(file)))), 1e-5
    times = np.linspace(0.05, 0.7, 40)
    before, now, after = (path.sample(times + step) for step in (-h, 0.0, h))
    spin = (after[0] - before[0])[:, :3, :3] / (2 * h) @ now[0][:, :3, :3].transpose(0, 2, 1)
    assert now[1][:, :3] == pytest.approx(
        np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1), abs=1e-5
    )
    assert now[2][:, :3] == pytest.approx((after[1] - before[1])[:, :3] / (2 * h), abs=1e-3)


def test_laps_follow_each_other(file):
    path = make_path(ReferenceConfig(Planned(file), laps=2))
    lap = path.lap_starts[1] - path.lap_starts[0]
    assert path.sample(path.path_start + 0.3)[0] == pytest.approx(path.sample(path.path_start + lap + 0.3)[0])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: [row.rsplit(";", 1)[0] for row in rows], r"has 14 columns .*, got 13"),
        (lambda rows: rows[:5], "at least 8 rows, got 4"),
        (lambda rows: [*rows[:20], *rows[21:]], "line 21: times must be even"),
        (lambda rows: [row.replace("; 0.5;", "; 0.9;") for row in rows], "line 2: .*must have the length 1"),
    ],
)
def test_a_file_that_is_no_motion_is_refused_with_its_line(file, tmp_path, change, reason):
    with open(file) as stream:
        rows = stream.read().splitlines()
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("\n".join(change(rows)))
    with pytest.raises(ValueError, match=reason):
        read_planned(str(wrong))


def test_a_file_that_is_written_anew_meanwhile_is_another_motion_for_nobody(file, tmp_path):
    copy = shutil.copy(file, tmp_path)
    shape = Planned(str(copy))
    first = shape.motion()
    (tmp_path / "circle.csv").write_text("")
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(shape)).motion().q, first.q)


def test_a_planned_path_without_a_file_is_refused():
    with pytest.raises(ValueError, match="needs a file"):
        make_path(ReferenceConfig(Planned()))


def test_joints_that_do_not_bring_the_tool_to_its_pose_are_refused_with_their_row(tmp_path):
    robot = Kinematics(load_robot("kr16"))
    q = np.deg2rad([0.0, -70.0, 80.0, 0.0, 40.0, 0.0]) + np.linspace(0.0, 0.1, 20)[:, None]
    text = planned_text(PERIOD * np.arange(20), robot.forward(q), q)
    file = tmp_path / "motion.csv"
    file.write_text(text)
    assert read_planned(str(file), robot.forward).q == pytest.approx(q)
    rows = [row.split("; ") for row in text.splitlines()]
    rows[7][8] = str(float(rows[7][8]) + 1.0)
    file.write_text("\n".join("; ".join(row) for row in rows))
    with pytest.raises(
        ValueError, match=r"motion\.csv, line 8: the joints do not bring the tool to the pose"
    ):
        read_planned(str(file), robot.forward)
