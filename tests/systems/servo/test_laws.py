"""The visual-servo laws on a perfect robot that is where it was told to be: decay, smoothness, refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.special import lambertw

from robots.description.model import RobotModel, load_robot
from robots.kinematics.analytic_inverse import InverseKinematics
from robots.kinematics.forward import Kinematics, rotation_about
from robots.pose import pose_error, rotation_from_zyx, sine_error_rate_matrix, sine_pose_error
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import ReferenceConfig, make_path
from systems.samples import PoseSample
from systems.servo import LAWS, LawConfig
from systems.servo.kernels.parts import sine_feedback
from tests.systems.rigs import PERIOD, LawRig, pose

ROBOT = load_robot("irb1200")
CORRECTING = ("numerical_ik", "pbvs", "position_level")
RECTANGLE = make_path(ReferenceConfig())
Path = Callable[[float], tuple[np.ndarray, np.ndarray]]


def at(p_mm: tuple[float, float, float], zyx_deg: tuple[float, float, float]) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = rotation_from_zyx(np.deg2rad(zyx_deg))
    X[:3, 3] = 1e-3 * np.array(p_mm)
    return X


HOME = at((550.0, 0.0, 400.0), (20.0, 5.0, 90.0))


def standing(X: np.ndarray) -> Path:
    return lambda time: (X, np.zeros(6))


def along(time: float) -> tuple[np.ndarray, np.ndarray]:
    X, V, _ = RECTANGLE.sample(time)
    return X, V


def joints_at(X: np.ndarray, robot: RobotModel = ROBOT) -> np.ndarray:
    return InverseKinematics(robot).nearest(X, np.zeros(6))


def displaced(error: np.ndarray, X: np.ndarray = HOME) -> np.ndarray:
    """The pose whose error (rotation vector, translation) to X is the given one."""
    X = X.copy()
    angle = np.linalg.norm(error[:3])
    if angle > 0.0:
        X[:3, :3] = rotation_about(-error[:3] / angle, float(angle)) @ X[:3, :3]
    X[:3, 3] -= error[3:]
    return X


def off_by_offsets() -> RobotModel:
    """A true robot with a long, tilted tool that the law does not know of."""
    robot = load_robot("irb1200")
    robot.tool.translation = np.array([0.01, 0.01, 0.01])
    robot.tool.zyx_deg = np.array([1.0, 2.0, 0.5])
    return robot


def decay_rate(errors: np.ndarray) -> float:
    """1/s, of the norm of the errors (n, 3) from a half to a thousandth of the first."""
    size = np.linalg.norm(errors, axis=1) / np.linalg.norm(errors[0])
    part = (size < 0.5) & (size > 1e-3)
    return -np.polyfit(PERIOD * np.flatnonzero(part), np.log(size[part]), 1)[0]


def test_the_closed_form_of_the_feedback_is_the_corrected_law():
    """L^-1 (L^T w + K e-bar) of Probst (2024) eq. (5.8), whose solution the law writes down directly."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        seen, V = displaced(0.4 * rng.uniform(-1.0, 1.0, 6))[:3], rng.normal(size=6)
        L = sine_error_rate_matrix(HOME[:3, :3], seen[:, :3])
        error = sine_pose_error(HOME[:3], seen)
        expected = np.linalg.solve(L, L.T @ V[:3] + 7.0 * error[:3])
        feedback = sine_feedback(HOME[:3], seen, V, 7.0, 3.0)
        assert V[:3] + feedback[:3] == pytest.approx(expected, abs=1e-12)
        assert feedback[3:] == pytest.approx(3.0 * error[3:], abs=1e-15)


@pytest.mark.parametrize("angle_deg", [61.0, 90.0, 120.0])
def test_far_from_the_wanted_orientation_the_feedback_still_turns_the_shorter_way(angle_deg: float):
    """At 90 degrees L cannot be inverted; from 60 degrees on the sine of the angle counts alone."""
    seen = displaced(np.array([0.0, 0.0, np.deg2rad(angle_deg), 0.0, 0.0, 0.0]))[:3]
    feedback = sine_feedback(HOME[:3], seen, np.ones(6), 7.0, 3.0)
    assert feedback[:3] == pytest.approx(7.0 * sine_pose_error(HOME[:3], seen)[:3], abs=1e-12)
    assert np.linalg.norm(feedback[:3]) == pytest.approx(7.0 * np.sin(np.deg2rad(angle_deg)))


@pytest.mark.slow
@pytest.mark.parametrize("law", CORRECTING)
@pytest.mark.parametrize("delay", [1, 10])
@pytest.mark.parametrize("part", ["translation", "rotation"])
def test_an_error_dies_with_the_time_constant_of_its_gain(law: str, part: str, delay: int):
    """10 mm or 1 degree along each axis; the other part has another gain.

    An integrator with gain K and dead time T decays with the real root of s = K exp(s T), which is
    -W(-K T) / T. T is the camera's delay, the tick from the command to the motion and half a tick of hold.
    """
    gains: dict[str, Any] = {"translation": 3.0, "rotation": 3.0, part: 5.0}
    error = np.repeat([0.0, 0.01] if part == "translation" else [np.deg2rad(1.0), 0.0], 3)
    rig = LawRig(
        law, ROBOT, standing(HOME), joints_at(displaced(error)), config=LawConfig(**gains), delay=delay
    )
    errors = pose_error(HOME[None], rig.run(2.0))
    dead_time = PERIOD * (delay + 0.5)
    expected = -lambertw(-5.0 * dead_time).real / dead_time
    rows = slice(0, 3) if part == "rotation" else slice(3, 6)
    assert decay_rate(errors[:, rows]) == pytest.approx(expected, rel=0.03)
    assert np.linalg.norm(errors[-1]) < 2e-3 * np.linalg.norm(error)


@pytest.mark.parametrize("law", CORRECTING)
def test_geometry_that_the_law_does_not_know_leaves_no_error(law: str):
    true = off_by_offsets()
    rig = LawRig(law, ROBOT, standing(HOME), joints_at(HOME), true=true)
    errors = pose_error(HOME[None], rig.run(4.0))
    assert np.linalg.norm(errors[0, 3:]) > 0.01
    assert np.linalg.norm(errors[-1, 3:]) < 1e-7
    assert np.linalg.norm(errors[-1, :3]) < 1e-7


@pytest.mark.parametrize("law", CORRECTING)
def test_the_first_command_moves_the_tip_by_one_tick_of_correction_at_most(law: str):
    """Bumpless, although the robot stands 17 mm off and its geometry is wrong."""
    q = joints_at(displaced(np.repeat([0.02, 0.01], 3)))
    rig = LawRig(law, ROBOT, standing(HOME), q, true=off_by_offsets(), delay=0)
    error = pose_error(HOME, rig.true.forward(q))
    command = rig.tick()
    moved = pose_error(Kinematics(ROBOT).forward(command), Kinematics(ROBOT).forward(q))
    assert np.linalg.norm(moved[3:]) < 1.2 * 5.0 * PERIOD * np.linalg.norm(error[3:]) + 1e-4
    blind = LawRig(law, ROBOT, standing(HOME), q)
    np.testing.assert_allclose(blind.tick(PoseSample()), q, atol=1e-9)


@pytest.mark.parametrize("law", CORRECTING)
@pytest.mark.parametrize(("wanted", "true"), [(179.0, -179.0), (-179.5, 178.0), (180.0, -178.0)])
def test_alpha_passes_180_degrees_the_short_way(law: str, wanted: float, true: float):
    """Plain differences of the Euler angles would send the tool all the way round."""
    X_WD, X_WE = at((550.0, 0.0, 400.0), (wanted, 0.0, 90.0)), at((550.0, 0.0, 400.0), (true, 0.0, 90.0))
    rig = LawRig(law, ROBOT, standing(X_WD), joints_at(X_WE))
    angles = np.linalg.norm(pose_error(X_WD[None], rig.run(1.5))[:, :3], axis=1)
    assert angles[0] < np.deg2rad(3.0)
    assert np.all(np.diff(angles) <= 1e-9)
    assert angles[-1] < 0.01 * angles[0]


@pytest.mark.parametrize("law", CORRECTING)
@pytest.mark.parametrize("delay", [1, 10])
def test_a_late_camera_is_no_error_on_a_moving_path(law: str, delay: int):
    """Samples are compared with the path at their exposure: a perfect robot at 0.2 m/s is left alone.

    Compared with the present, 40 ms of delay would look like 8 mm, and be corrected.
    """
    rig = LawRig(law, ROBOT, along, joints_at(along(0.0)[0]), delay=delay, preview=PERIOD)
    tips = rig.run(1.5)
    X, V, _ = RECTANGLE.sample(PERIOD * np.arange(len(tips)))
    assert np.linalg.norm(V[-1, 3:]) > 0.05
    errors = pose_error(X, tips)
    # One tick of a held joint velocity at 0.5 rad/s of rotation, 0.1 mm and 0.5 mrad after 1.5 s.
    assert np.abs(errors[:, 3:]).max() < 1e-4
    assert np.abs(errors[:, :3]).max() < 5e-4


def test_open_loop_follows_the_nominal_inverse_kinematics_whatever_the_camera_says():
    rig = LawRig("open_loop", ROBOT, along, joints_at(along(0.0)[0]), true=off_by_offsets())
    commands = np.array([rig.tick() for _ in range(100)])
    X, _, _ = RECTANGLE.sample(PERIOD * np.arange(100))
    np.testing.assert_allclose(Kinematics(ROBOT).forward(commands), X, atol=1e-12)
    np.testing.assert_array_equal(rig.output("correction"), 0.0)


@pytest.mark.parametrize("law", CORRECTING)
def test_a_false_detection_is_refused_and_moves_nothing(law: str):
    """Half a metre or 60 degrees off; the correction stays where it was."""
    rig = LawRig(law, ROBOT, standing(HOME), joints_at(HOME))
    rig.run(0.1)
    q = rig.q
    for number, error in enumerate(([0.0, 0.0, 0.0, 0.5, 0.0, 0.0], [0.0, 1.05, 0.0, 0.0, 0.0, 0.0]), 1):
        false = PoseSample(rig.ticks * PERIOD, pose(displaced(np.array(error))), True)
        np.testing.assert_allclose(rig.tick(false), q, atol=1e-9)
        last_used, refused, _ = rig.output("measurement")
        assert refused == number
        assert last_used == pytest.approx(0.1 - PERIOD)  # the last true one arrived a tick before


@pytest.mark.parametrize("law", CORRECTING)
@pytest.mark.parametrize("kind", ["invalid", "stale"])
def test_without_a_usable_sample_the_correction_is_held(law: str, kind: str):
    error = np.repeat([0.0, 0.01], 3)
    rig = LawRig(law, ROBOT, standing(HOME), joints_at(displaced(error)))
    rig.run(0.1)
    tip, q = pose(rig.tips[-1]), rig.q
    sample = PoseSample(rig.ticks * PERIOD, tip, False) if kind == "invalid" else PoseSample(0.096, tip, True)
    for _ in range(20 if kind == "stale" else 0):  # until it is older than 50 ms
        rig.tick(sample)
    q = rig.tick(sample)
    for _ in range(10):
        np.testing.assert_allclose(rig.tick(sample), q, atol=1e-4 if law == "numerical_ik" else 1e-9)
    assert GuardConfig().hold_after == 0.05


@pytest.mark.parametrize("law", CORRECTING)
def test_the_correction_stops_at_its_limit(law: str):
    """A camera that is wrong by 100 mm can move the tip by 20 mm; pbvs is limited in its speed, too."""
    config = LAWS[law].Config(correction_limit=0.02)
    if law == "pbvs":
        config.correction_speed_limit_deg_s = 2.0
    rig = LawRig(law, ROBOT, standing(HOME), joints_at(HOME), config=config)
    false = pose(displaced(np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0])))
    positions = [rig.q]
    for _ in range(750):
        positions.append(rig.tick(PoseSample(rig.ticks * PERIOD, false, True)))
    if law == "pbvs":
        fastest = np.abs(np.diff(positions, axis=0)).max() / PERIOD
        assert fastest == pytest.approx(np.deg2rad(2.0), rel=1e-6)
    moved = np.linalg.norm(Kinematics(ROBOT).forward(rig.q)[:3, 3] - HOME[:3, 3])
    assert moved == pytest.approx(0.02, abs=2e-3)  # within a tick of 5 1/s * 4 ms * 0.1 m


@pytest.mark.parametrize("law", ["position_level", "open_loop", "pbvs", "numerical_ik"])
def test_a_pose_out_of_reach_gives_no_command_and_the_law_goes_on_when_it_returns(law: str):
    far = at((2000.0, 0.0, 400.0), (20.0, 5.0, 90.0))
    rig = LawRig(law, ROBOT, lambda t: (far if 0.1 < t < 0.15 else HOME, np.zeros(6)), joints_at(HOME))
    rig.run(0.1 + PERIOD)
    assert np.isnan(rig.tick()).all()
    rig.run(0.1)
    np.testing.assert_allclose(rig.tick(), joints_at(HOME), atol=1e-6)


@pytest.mark.parametrize("law", [law for law in LAWS if law != "self_calibrating"])  # it has no gains
@pytest.mark.parametrize("label", ["translation", "rotation", "correction_limit", "correction_limit_deg"])
def test_refuses_gains_and_limits_that_are_not_positive(law: str, label: str):
    config = LawConfig()
    setattr(config, label, 0.0)
    with pytest.raises(ValueError, match=f"servo law: {label} must be positive, got 0.0"):
        LAWS[law](ControllerModel(ROBOT), config, GuardConfig())
