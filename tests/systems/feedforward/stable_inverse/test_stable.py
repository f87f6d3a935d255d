"""The stable inverse of a robot: exact, from rest to rest, ahead of the motion; and what it refuses."""

from functools import cache

import numpy as np
import pytest

from experiments.feedforward.trial import Trial
from robots.description.model import load_robot
from systems.controller_model import ControllerModel
from systems.feedforward import FeedforwardConfig, JointReference
from systems.feedforward.elastic_structure import ElasticStructureFeedforward
from systems.feedforward.prefilter import PrefilterConfig
from systems.feedforward.stable_inverse.bounded_inverse import NoBoundedMotionError
from systems.feedforward.stable_inverse.stable import Plan, StableFeedforward
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.shapes import Circle
from systems.reference.timing import PolynomialProfile

STEP, SETTLE = 2e-3, 0.35  # s
START, ANGLE = np.deg2rad([0.0, -60.0, 90.0, 0.0, 0.0, 0.0]), np.deg2rad(5.0)
PROFILE = PolynomialProfile.lasting(0.25, ANGLE)


def inverse(name: str = "kr210", **settings) -> StableFeedforward:
    robot = load_robot(name)
    model = ControllerModel(robot, robot.payload.largest_mass)
    return StableFeedforward(model, FeedforwardConfig("stable", **settings))


@cache
def planned(point: str) -> Plan:
    times = np.arange(0.0, SETTLE + PROFILE.duration + SETTLE, STEP)
    axes = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return inverse(point=point).plan(times, START + PROFILE.at_times(times - SETTLE)[0][:, None] * axes)


@pytest.mark.slow
@pytest.mark.parametrize("point", ["tip", "wrist"])
def test_the_point_is_on_its_path_to_a_hundredth_of_a_micrometre(point: str):
    assert planned(point).history[-1] < 1e-8


@pytest.mark.slow
def test_motors_are_at_rest_at_both_ends():
    plan = planned("tip")
    end = SETTLE + PROFILE.duration + SETTLE
    assert np.abs(plan.velocity([0.0, end + 0.5])).max() < 2e-3  # rad/s, of one
    assert 0.0 <= plan.first < plan.last
    assert np.abs(plan.velocity(SETTLE + 0.5 * PROFILE.duration)).max() > 0.5


def test_at_rest_it_is_where_the_approximate_inverse_is():
    """Which is right there but for the share of a sag in the levers."""
    approximate = ElasticStructureFeedforward(
        ControllerModel(load_robot("kr210"), 210.0), FeedforwardConfig()
    )
    still = JointReference(START, np.zeros(6), np.zeros(6))
    expected = approximate.answer(still, approximate.fresh_memory()).position
    found = planned("tip").position(0.0)
    assert np.abs(expected - START)[:3].max() > 1e-3  # rad, what the robot yields
    np.testing.assert_allclose(found[:3], expected[:3], atol=1e-4)


@pytest.mark.slow
def test_where_zeros_change_sides_it_is_a_hundredth_of_a_millimetre_off_and_starts_within_its_time():
    """From -72.5 and 17.5 degrees of axes 2 and 3 a pair crosses the imaginary axis in these five degrees."""
    start = np.deg2rad([0.0, -72.5, 17.5, 0.0, 0.0, 0.0])
    times = np.arange(0.0, SETTLE + PROFILE.duration + SETTLE, STEP)
    axes = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    plan = inverse(point="wrist").plan(times, start + PROFILE.at_times(times - SETTLE)[0][:, None] * axes)
    assert 1e-7 < plan.history[-1] < 1e-5  # m: not exact
    assert plan.first >= 0.0
    assert np.abs(plan.velocity([0.0, plan.rigid.x[-1]])).max() < 2e-3  # rad/s


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [30.0, 45.0])
def test_a_motion_may_be_large(angle_deg: float):
    """The zeros wander with the pose; the equations are linear about the motion, sample by sample."""
    profile = PolynomialProfile.lasting(0.6, np.deg2rad(angle_deg))
    times = np.arange(0.0, SETTLE + profile.duration + SETTLE, STEP)
    axes = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    plan = inverse(point="wrist").plan(times, START + profile.at_times(times - SETTLE)[0][:, None] * axes)
    assert plan.history[-1] < 5e-5  # m, what `plan` may leave where zeros change sides


@pytest.mark.slow
def test_where_the_arm_is_stretched_on_the_way_it_says_so():
    """From there on axis 3 at -37 degrees turns by 45: past the stretched arm of a KR 210."""
    start = np.deg2rad([0.0, -45.0, -37.0, 0.0, 0.0, 0.0])
    profile = PolynomialProfile.lasting(0.6, np.deg2rad(45.0))
    times = np.arange(0.0, SETTLE + profile.duration + SETTLE, STEP)
    axes = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    with pytest.raises(NoBoundedMotionError, match=r"0\.7.. s from the start the arm is stretched"):
        inverse(point="wrist").plan(times, start + profile.at_times(times - SETTLE)[0][:, None] * axes)


@pytest.mark.slow
def test_the_wrist_rings_a_quarter_of_what_it_does_with_the_best_causal_inverse():
    """Of a KR 210 with 210 kg after five degrees in a fifth of a second."""
    robot = load_robot("kr210")

    def criterion(kind: str) -> float:
        config = FeedforwardConfig(kind, point="wrist")
        return Trial(robot, 210.0, START, ANGLE, config, settle=SETTLE, speeding_up=0.2).run()

    assert criterion("stable") < 0.25 * criterion("elastic_structure")


def test_it_refuses_what_it_cannot_invert():
    with pytest.raises(ValueError, match=r"prefilter\.kind must be none"):
        inverse(prefilter=PrefilterConfig("bessel"))
    with pytest.raises(ValueError, match="have parts beyond springs, dampers and friction"):
        inverse("kr16-realistic")


def test_it_refuses_a_path_that_begins_too_soon_is_too_rough_or_out_of_reach():
    home = np.deg2rad([0.0, 20.0, 20.0, 0.0, 50.0, 0.0])
    rough = make_path(ReferenceConfig(Circle(), settle=0.5))
    with pytest.raises(ValueError, match="stable takes 4 derivatives of its path, of which 3 are continuous"):
        inverse("irb1200").prepare(rough, home)
    far = make_path(ReferenceConfig(Circle(center_mm=np.array([2000.0, 0, 400])), timing="polynomial"))
    with pytest.raises(ValueError, match=r"stable: path at 0\.000 s: "):
        inverse("irb1200").prepare(far, home)
