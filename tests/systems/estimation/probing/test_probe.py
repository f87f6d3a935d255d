"""The probe: smooth, at rest at its ends, within limits, and absent where it is not wanted."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.estimation.probing.probe import Probe, ProbeConfig

PATH_START = 4.0
HOME = np.array([0.9, 0.3, 0.2, 0.5, 0.9, 0.1])
JACOBIAN = np.vstack([np.zeros((3, 6)), 0.5 * np.ones((3, 6))])


def test_rates_are_derivatives_and_both_ends_are_at_rest():
    probe = Probe(load_robot("irb1200"), ProbeConfig())
    size, h = probe.amplitude(HOME, JACOBIAN, PATH_START), 1e-5
    begin, length = probe.window(PATH_START)
    for time in (0.2, 0.3, 0.5, *np.linspace(begin + 0.1, begin + length - 0.1, 7)):
        (p0, v0, _), (_, v, a), (p1, v1, _) = (
            probe.at(t, PATH_START, size) for t in (time - h, time, time + h)
        )
        np.testing.assert_allclose(v, (p1 - p0) / (2.0 * h), atol=1e-7)
        np.testing.assert_allclose(a, (v1 - v0) / (2.0 * h), atol=1e-6)
    for time in (0.15 + 1e-6, 0.55 - 1e-6, begin + 1e-6, begin + length - 1e-6):
        p, v, a = probe.at(time, PATH_START, size)
        assert max(np.abs(p).max(), np.abs(v).max()) < 1e-6
        assert np.abs(a).max() < 1e-3  # or gears, which it deflects, would be thrown about
    assert not np.any(probe.at(PATH_START, PATH_START, size))


@pytest.mark.parametrize("begin", [0.0, 0.2, 0.5, 0.8])
def test_no_joint_leaps_whenever_oscillations_begin(begin):
    robot = load_robot("irb1200")
    probe, period = Probe(robot, ProbeConfig(begin=begin)), 1e-3
    size = probe.amplitude(HOME, JACOBIAN, PATH_START)
    motion = np.array([probe.at(t, PATH_START, size) for t in np.arange(0.0, PATH_START, period)])
    steps = np.diff(motion[:, 0], axis=0)
    np.testing.assert_allclose(steps, period * 0.5 * (motion[1:, 1] + motion[:-1, 1]), atol=1e-6)


def test_oscillations_that_have_to_wait_begin_later_and_are_the_same():
    probe = Probe(load_robot("irb1200"), ProbeConfig())
    size, waited = probe.amplitude(HOME, JACOBIAN, PATH_START), 0.0
    for time in np.arange(0.0, 2.0, 6e-3):
        waited = probe.waited(time, waited)
        if time > 0.6:
            assert not np.any(probe.at(time, PATH_START, size, waited))
    assert waited == pytest.approx(2.0 - 0.8, abs=0.03)
    assert probe.waited(3.0, waited) == waited  # they have begun
    np.testing.assert_array_equal(
        probe.at(1.5 + waited, PATH_START, size, waited), probe.at(1.5, PATH_START, size)
    )


def test_oscillations_can_begin_anew_once_they_are_over():
    probe = Probe(load_robot("irb1200"), ProbeConfig())
    size, (begin, length) = probe.amplitude(HOME, JACOBIAN, PATH_START), probe.window(PATH_START)
    assert begin < probe.shown(PATH_START) < begin + length
    assert not probe.is_over(begin + length - 1e-3, PATH_START)
    assert probe.is_over(begin + length, PATH_START)
    again, first = (
        probe.at(begin + length + 0.7 - (length - waited), PATH_START, size, waited)
        for waited in (length, 0.0)
    )
    np.testing.assert_array_equal(again, first)


def test_it_keeps_to_joint_limits_and_to_the_excursion_of_the_tip():
    robot = load_robot("irb1200")
    probe = Probe(robot, ProbeConfig(largest_excursion=0.05))
    near_a_limit = HOME.copy()
    near_a_limit[2] = robot.upper[2] - 0.01
    size = probe.amplitude(near_a_limit, JACOBIAN, PATH_START)
    moved = [probe.at(t, PATH_START, size)[:2] for t in np.linspace(0.0, PATH_START, 1001)]
    displacement, velocity = np.array(moved).swapaxes(0, 1)
    assert (near_a_limit + displacement < robot.upper).all()
    excursion = np.linalg.norm(displacement @ JACOBIAN[3:].T, axis=1).max()
    assert 0.045 < excursion < 0.0505  # as far as it may, up to the step in which it was looked at
    assert (np.abs(velocity) < 0.31 * robot.speed).all()


@pytest.mark.parametrize(("period", "growth"), [(2e-3, 1.0), (4e-3, 1.0), (5e-3, 1.25**0.5), (0.04, 1.2)])
def test_a_camera_that_looks_less_often_is_shown_more_unless_limits_are_given(period, growth):
    """Samples times the square of the motion stay the same, until it is a fifth larger."""
    robot = load_robot("irb1200")
    given = ProbeConfig(amplitude=[0.19, 0.19, 0.19, 0.5, 0.5, 0.5], largest_excursion=0.125)
    limited, free = (
        Probe(robot, config, period).amplitude(HOME, JACOBIAN, PATH_START)
        for config in (given, ProbeConfig())
    )
    np.testing.assert_allclose(free[1], growth * limited[1])


def test_gears_with_errors_are_moved_less():
    usual, less = (
        Probe(load_robot("irb1200"), ProbeConfig(), has_gear_errors=has).amplitude(HOME, JACOBIAN, PATH_START)
        for has in (False, True)
    )
    np.testing.assert_allclose(less[1], 0.8 * usual[1])


@pytest.mark.parametrize(("kind", "path_start"), [("none", 4.0), ("smooth", 1.2)])
def test_there_is_none_without_leave_or_time(kind, path_start):
    probe = Probe(load_robot("irb1200"), ProbeConfig(kind=kind))
    assert not probe.amplitude(HOME, JACOBIAN, path_start).any()


@pytest.mark.parametrize("change", [{"kind": "wild"}, {"amplitude": [0.1] * 5}, {"amplitude": [-0.1] * 6}])
def test_refuses_what_cannot_be(change):
    with pytest.raises(ValueError, match="probe: "):
        Probe(load_robot("irb1200"), ProbeConfig(**change))
