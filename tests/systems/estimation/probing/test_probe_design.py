"""Probes for a path: what the path needs is shown, for less than a larger motion of the usual kind would."""

import numpy as np
import pytest

from robots.description.model import load_robot
from systems.estimation.probing.path_needs import PathNeeds
from systems.estimation.probing.probe import USUAL, Probe, ProbeConfig
from systems.estimation.probing.probe_design import designed
from systems.reference.paths import Circle, Rectangle, ReferenceConfig, make_path
from tests.systems.estimation.arms import CAMERA, tip_model

HOME = np.deg2rad([45.0, 45.0, 5.0, -50.0, -60.0, 120.0])
RATE = 250.0  # samples of the camera in a second
MODEL = tip_model()
WEIGHTS = 1.0 / CAMERA**2


def needs(shape, late: float = 0.5) -> PathNeeds:
    return PathNeeds(MODEL, WEIGHTS, make_path(ReferenceConfig(path=shape, settle=4.0)), HOME, late)


def expected(of: PathNeeds, probe: Probe, amplitude: np.ndarray) -> float:
    """How well the tip will be known after a probe, worked out sample by sample from its motion."""
    times = np.arange(0.0, 4.0, 1.0 / RATE)
    q, v, a = np.array([probe.at(t, 4.0, amplitude) for t in times]).swapaxes(0, 1)
    return of.expected(of.prior + of.information(of.columns(of.q[0] + q, v, a)), RATE)


def test_columns_are_how_the_tip_moves():
    of, i = needs(Circle()), MODEL.G.start + 3
    q, still = of.q[:1], np.zeros((1, 6))
    x = MODEL.mean.copy()
    x[i] += 1e-3 * MODEL.sigma[i]
    arm = MODEL.forward(MODEL.constants(MODEL.mean), MODEL.mean, q)[1]
    loads = MODEL.loads.at(arm.frames, q, still, still)
    before, after = (MODEL.predict(MODEL.constants(y), y, q, loads, still).X_WE for y in (MODEL.mean, x))
    step = (after - before)[0, :3, 3] / 1e-3
    np.testing.assert_allclose(of.columns(q, still, still)[0, 3:, i], step, rtol=1e-3, atol=1e-7)


def test_a_path_again_and_again_needs_what_it_needs_once():
    paths = [make_path(ReferenceConfig(path=Circle(), settle=4.0, laps=laps)) for laps in (1, 3)]
    once, thrice = (PathNeeds(MODEL, WEIGHTS, path, HOME, 0.5) for path in paths)
    np.testing.assert_allclose(thrice.times, once.times, atol=1e-9)
    np.testing.assert_allclose(thrice.q, once.q, atol=1e-9)
    A = once.prior + once.information(once.H[:1])
    assert thrice.expected(A, RATE) == pytest.approx(once.expected(A, RATE), rel=1e-6)


def test_what_is_known_ahead_is_known_worst_between_two_times_of_any_lap():
    path = make_path(ReferenceConfig(path=Circle(), settle=4.0, laps=2))
    of = PathNeeds(MODEL, WEIGHTS, path, HOME, 0.5)
    P = np.linalg.inv(of.prior + of.information(of.H[:1]))
    standing, (first, second) = of.standing(P), path.lap_starts
    # The scale of angles is not changed by a test: at the first instant all of the path's begin is known.
    assert of.sigma_between(P, 0.0, 0.0) == of.sigma_between(P, first, first)
    assert of.sigma_between(P, first, first + 0.5) < of.sigma_between(P, first, first + 2.0)
    assert of.sigma_between(P, first, second - 0.1) == pytest.approx(standing.sigma)
    assert of.sigma_between(P, second + 1.0, second + 2.0) == of.sigma_between(P, first + 1.0, first + 2.0)
    assert of.sigma_between(P, second - 0.1, second + 0.1) < standing.sigma


@pytest.mark.slow
@pytest.mark.parametrize("shape", [Rectangle(), Circle()])
def test_what_the_design_promises_its_motion_shows(shape):
    of, probe = needs(shape), Probe(load_robot("irb1200"), ProbeConfig())
    J = of.jacobian(of.q[0])
    usual = expected(of, probe, probe.amplitude(of.q[0], J, 4.0))
    probe.pattern, promised = designed(of, probe, 4.0, RATE, sharp=0.0)
    amplitude = probe.amplitude(of.q[0], J, 4.0)
    shown = expected(of, probe, amplitude)
    nothing = expected(of, probe, 0.0 * amplitude)
    assert shown == pytest.approx(promised.sigma, rel=0.2)  # knock and tails are not counted in the promise
    assert shown <= 1.02 * usual
    assert shown < 0.1 * nothing


@pytest.mark.slow
def test_what_a_slow_camera_misses_a_larger_motion_makes_up_for():
    """With 100 samples a second in place of 250 a deviation could be larger by sqrt(2.5) = 1.6.

    A motion that is a fifth larger makes up for some of that.
    """
    of, robot = needs(Rectangle()), load_robot("irb1200")
    _, fast = designed(of, Probe(robot, ProbeConfig()), 4.0, RATE, sharp=0.0)
    _, slow = designed(of, Probe(robot, ProbeConfig(), 0.01), 4.0, 100.0, sharp=0.0)
    limits = ProbeConfig(amplitude=[0.19, 0.19, 0.19, 0.5, 0.5, 0.5], largest_excursion=0.125)
    _, limited = designed(of, Probe(robot, limits, 0.01), 4.0, 100.0, sharp=0.0)
    assert slow.sigma < 1.4 * fast.sigma
    assert limited.sigma > slow.sigma


@pytest.mark.slow
def test_the_longer_the_camera_may_be_blind_the_more_is_shown_before():
    probe = Probe(load_robot("irb1200"), ProbeConfig())
    sees, blind = needs(Rectangle(), late=0.05), needs(Rectangle(), late=0.8)
    shown = []
    for of in (sees, blind):
        probe.pattern, promised = designed(of, probe, 4.0, RATE, sharp=0.0)
        amplitude = probe.amplitude(of.q[0], of.jacobian(of.q[0]), 4.0)
        assert promised.sigma > 0.0
        shown.append([expected(each, probe, amplitude) for each in (sees, blind)])
    (sees_sees, sees_blind), (_, blind_blind) = shown
    assert sees_blind > 1.1 * sees_sees  # the same motion promises less
    assert blind_blind < sees_blind  # and another one more


def test_none_where_the_tip_is_known_well_enough():
    of, probe = needs(Circle()), Probe(load_robot("irb1200"), ProbeConfig())
    pattern, without = designed(of, probe, 4.0, RATE, sharp=1.0)
    assert not pattern.size.any()
    still = Probe(load_robot("irb1200"), ProbeConfig(kind="none"))
    assert without == designed(of, still, 4.0, RATE, sharp=0.0)[1]
    assert (probe.pattern.periods == USUAL.periods).all()


def test_what_is_known_least_has_a_name_and_a_size():
    of, i = needs(Rectangle()), MODEL.G.start + 4
    P = 1e-6 * np.eye(MODEL.size)
    P[i, i] = 1.0
    found = of.standing(P)
    assert found.unknown == i
    assert found.unknown_sigma == MODEL.sigma[i]
    assert found.share == pytest.approx(1.0, abs=1e-3)
    ways = np.linalg.norm(of.H[:, 3:, i], axis=1)
    turns = np.linalg.norm(of.H[:, :3, i], axis=1)
    assert found.sigma == pytest.approx(np.sqrt(ways**2 + (0.25 * turns) ** 2).max(), rel=1e-3)


def test_a_forecast_says_when_and_because_of_what():
    of = needs(Circle())
    found = of.forecast(of.prior, RATE)
    assert found.sigma == of.expected(of.prior, RATE)
    assert found.time in of.times
    better = of.prior.copy()
    better[found.unknown, found.unknown] *= 1e6
    assert of.expected(better, RATE) < found.sigma
