"""All branches of robots without a spherical wrist: against the closed form of a UR, and a dense sampling."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from robots.description.model import Joint, JointLimits, Placement, RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics, JointLimitError, UnreachableError
from robots.kinematics.forward import Kinematics
from robots.kinematics.numeric_inverse import NumericInverse
from robots.pose import pose_error, wrap_angle
from tests.robots.urdfs import arm, published

# d_i, a_i, alpha_i of Denavit and Hartenberg, as Universal Robots publishes them; m and deg.
DH = {
    "ur5e": [
        (0.1625, 0.0, 90.0), (0.0, -0.425, 0.0), (0.0, -0.3922, 0.0),
        (0.1333, 0.0, 90.0), (0.0997, 0.0, -90.0), (0.0996, 0.0, 0.0),
    ],
    "ur10": [
        (0.1273, 0.0, 90.0), (0.0, -0.612, 0.0), (0.0, -0.5723, 0.0),
        (0.163941, 0.0, 90.0), (0.1157, 0.0, -90.0), (0.0922, 0.0, 0.0),
    ],
}  # fmt: skip
LIMITS = JointLimits(-360.0, 360.0, 180.0)


def from_dh(name: str) -> RobotModel:
    """A robot with the frames of Denavit and Hartenberg; it has no masses."""
    before = [Placement()] + [
        Placement(np.array([a, 0.0, 0.0]), np.array([0.0, 0.0, alpha])) for _, a, alpha in DH[name]
    ]
    joints = []
    for k, (d, _, _) in enumerate(DH[name]):
        X = before[k].pose()
        up = X.rotation() @ np.array([0.0, 0.0, d])
        place = Placement(X.translation() + up, before[k].zyx_deg)
        joints.append(Joint(np.array([0.0, 0.0, 1.0]), place, LIMITS))
    return RobotModel(name, joints=joints, tool=before[6])


def closed_form(name: str, X: np.ndarray) -> np.ndarray:
    """All joint positions of a UR for a pose of its flange: axes 2, 3, 4 are parallel.

    After Hawkins (2013), Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms, derived anew.
    """
    (_, a2, _), (_, a3, _) = DH[name][1:3]
    d1, d4, d6 = (DH[name][k][0] for k in (0, 3, 5))
    found = []
    p5 = X[:3, 3] - d6 * X[:3, 2]
    radius = np.hypot(p5[0], p5[1])
    for s1 in (1.0, -1.0):
        q1 = np.arctan2(p5[1], p5[0]) + s1 * np.arccos(d4 / radius) + np.pi / 2.0
        x, y = np.array([np.cos(q1), np.sin(q1)]), np.array([np.sin(q1), -np.cos(q1)])
        cosine = (X[:2, 3] @ y - d4) / d6
        if abs(cosine) > 1.0:
            continue
        for s5 in (1.0, -1.0):
            q5 = s5 * np.arccos(cosine)
            q6 = np.arctan2(-(X[:2, 1] @ y) / np.sin(q5), (X[:2, 0] @ y) / np.sin(q5))
            # In the plane of axes 2 to 4: the frame behind joint 4, with wrist and flange turned back.
            back = X @ inverse_dh(name, 5, float(q6)) @ inverse_dh(name, 4, float(q5))
            plane = np.array([x @ back[:2, 3], back[2, 3] - d1])
            wrist = np.array([x @ back[:2, 0], back[2, 0]])
            c3 = (plane @ plane - a2**2 - a3**2) / (2.0 * a2 * a3)
            if abs(c3) > 1.0:
                continue
            for s3 in (1.0, -1.0):
                q3 = s3 * np.arccos(c3)
                q2 = np.arctan2(plane[1], plane[0]) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
                q4 = np.arctan2(wrist[1], wrist[0]) - q2 - q3
                found.append([q1, q2, q3, q4, q5, q6])
    return wrap_angle(np.array(found).reshape(-1, 6))


def inverse_dh(name: str, k: int, q: float) -> np.ndarray:
    d, a, alpha = DH[name][k]
    c, s, ca, sa = np.cos(q), np.sin(q), np.cos(np.deg2rad(alpha)), np.sin(np.deg2rad(alpha))
    rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]]
    return np.linalg.inv(np.array(rows))


def assert_same_set(a: np.ndarray, b: np.ndarray, within: float):
    assert len(a) == len(b)
    apart = np.abs(wrap_angle(a[:, None] - b)).max(-1)
    assert apart.min(axis=1).max() < within
    assert apart.min(axis=0).max() < within


@pytest.mark.parametrize("name", DH)
def test_all_branches_of_a_ur_are_those_of_its_closed_form(name: str):
    robot = from_dh(name)
    kinematics, inverse = Kinematics(robot), NumericInverse(robot)
    rng, counts = np.random.default_rng(0), set()
    for q in rng.uniform(-np.pi, np.pi, (15, 6)):
        X = kinematics.forward(q)
        exact = closed_form(name, X)
        assert np.abs(kinematics.forward(exact) - X).max() < 1e-9
        counts.add(len(exact))
        assert_same_set(inverse.all_branches(X), exact, 1e-6)
    assert len(counts) > 1


@pytest.mark.parametrize("name", ["irb1200", "irb140", "puma560"])
def test_all_branches_of_a_spherical_wrist_are_the_analytic_ones(name: str):
    robot = load_robot(name)
    kinematics, inverse, analytic = Kinematics(robot), NumericInverse(robot), InverseKinematics(robot)
    for q in np.random.default_rng(1).uniform(-np.pi, np.pi, (10, 6)):
        X = kinematics.forward(q)
        branches = analytic.all_branches(X)
        assert_same_set(inverse.all_branches(X), branches[~np.isnan(branches[:, 0])], 1e-4)


def general(tmp_path: Path) -> RobotModel:
    """An arm without any special geometry."""
    path = tmp_path / "arm.urdf"
    path.write_text(arm())
    robot, rng = load_robot(str(path)), np.random.default_rng(3)
    for joint in robot.joints:
        joint.placement.zyx_deg = rng.uniform(-60.0, 60.0, 3)
        joint.limits = LIMITS
    return robot


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ur5", "general"])
def test_no_branch_is_missed_that_a_dense_sampling_finds(kind: str, tmp_path: Path):
    """Of 1e5 configurations the 150 nearest to the pose are led there by MINPACK; they find nothing new."""
    robot = load_robot(str(published("ur5_robot.urdf"))) if kind == "ur5" else general(tmp_path)
    kinematics, inverse, rng = Kinematics(robot), NumericInverse(robot), np.random.default_rng(4)
    dense = rng.uniform(-np.pi, np.pi, (100_000, 6))
    everywhere = kinematics.forward(dense)
    for q in rng.uniform(-np.pi, np.pi, (2, 6)):
        X = kinematics.forward(q)
        far = np.linalg.norm((everywhere - X)[:, :3].reshape(-1, 12), axis=1)
        led = [
            root(lambda q, X=X: pose_error(X, kinematics.forward(q)), start, tol=1e-12)
            for start in dense[np.argsort(far)[:150]]
        ]
        there = [found.x for found in led if found.success and np.abs(found.fun).max() < 1e-9]
        assert len(there) > 20
        branches = inverse.all_branches(X)
        apart = np.abs(wrap_angle(np.array(there)[:, None] - branches)).max(-1).min(axis=1)
        assert apart.max() < 1e-5
        assert np.abs(wrap_angle(branches - q)).max(-1).min() < 1e-6


def test_a_path_is_followed_on_its_branch():
    robot = load_robot(str(published("ur10_robot.urdf")))
    kinematics, inverse = Kinematics(robot), NumericInverse(robot)
    start = np.deg2rad([20.0, -80.0, 100.0, -60.0, -80.0, 30.0])
    end = start + np.deg2rad([60.0, 20.0, -40.0, 30.0, -40.0, 90.0])
    q = start + np.linspace(0.0, 1.0, 400)[:, None] * (end - start)
    np.testing.assert_allclose(inverse.along(kinematics.forward(q), start + 0.01), q, atol=1e-9)


def test_the_nearest_branch_within_the_limits_is_taken_and_a_refusal_says_why():
    robot = load_robot(str(published("ur10_robot.urdf")))
    kinematics, inverse = Kinematics(robot), NumericInverse(robot)
    q = np.deg2rad([20.0, -80.0, 100.0, -60.0, -80.0, 30.0])
    X = kinematics.forward(q)
    branches = inverse.all_branches(X)
    assert len(branches) == 8
    for branch in branches:
        found = inverse.nearest(X, branch + 0.2)
        np.testing.assert_allclose(kinematics.forward(found), X, atol=1e-9)
        assert np.linalg.norm(found - branch - 0.2) <= 0.2 * np.sqrt(6.0) + 1e-9
    far = X.copy()
    far[0, 3] += 3.0
    with pytest.raises(UnreachableError, match="out of reach"):
        inverse.nearest(far, q)
    narrow = replace(robot, joints=[replace(joint, limits=JointLimits(-1.0, 1.0)) for joint in robot.joints])
    with pytest.raises(JointLimitError, match=r"joint 1 would be at 20\.00 deg, allowed are -1 to 1 deg"):
        NumericInverse(narrow).nearest(X, q)
    with pytest.raises(ValueError, match="not finite"):
        inverse.nearest(np.full((4, 4), np.nan), q)
