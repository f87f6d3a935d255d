"""Predicted standard deviations: nothing added changes nothing, the same again halves what is independent."""

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.identification.advice.prediction import design_effects, with_further
from robots.identification.advice.sightings import Sighting, without_lag
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_fit import ArmFit, Evidence
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

PAYLOAD = 210.0  # kg
CASES = 6


@pytest.fixture(scope="module")
def parameters() -> ElasticParameters:
    return ElasticParameters(ElasticArm(load_robot("kr210"), PAYLOAD, []), gear_parts=False)


def fit(parameters: ElasticParameters, times: tuple[float, float, float]) -> ArmFit:
    """Of data that scatter so many times as noise does, by cases, sensors and phases."""
    n, rng = len(parameters), np.random.default_rng(2)
    J = rng.normal(size=(400, n + CASES))
    information = J.T @ J
    apart = [each * information for each in times]
    evidence = Evidence(information, np.full(n + CASES, 10.0), apart, np.zeros(n))
    noise = evidence.covariance[:n, :n]
    return ArmFit(parameters, parameters.start, evidence.whole(), noise, np.ones(3), 0, 1.0, evidence)


def test_nothing_added_changes_nothing(parameters: ElasticParameters):
    before = fit(parameters, (9.0, 5.0, 3.0))
    after = with_further(before, design_effects(before), np.zeros_like(before.covariance), CASES, 0)
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-9)


def test_design_effects_are_the_times_by_which_data_scatter_more_than_noise(parameters: ElasticParameters):
    np.testing.assert_allclose(design_effects(fit(parameters, (9.0, 5.0, 3.0))), [9.0, 5.0, 3.0], rtol=1e-6)


@pytest.mark.parametrize(("times", "share"), [((9.0, 2.0, 2.0), 0.5), ((2.0, 9.0, 2.0), 0.95)])
def test_the_same_again_halves_variances_that_cases_decide_but_not_those_of_sensors(
    parameters: ElasticParameters, times: tuple[float, float, float], share: float
):
    """Sensors that are wrong alike in both halves: what noise there is, a tenth, goes to the half."""
    before = fit(parameters, times)
    assert before.evidence is not None
    n = len(parameters)
    # What is left of the information where the lags have to be found, too.
    same = np.linalg.inv(np.linalg.inv(before.evidence.information)[:n, :n])
    after = with_further(before, design_effects(before), same, CASES, CASES)
    np.testing.assert_allclose(
        np.diagonal(after.covariance), share * np.diagonal(before.covariance), rtol=0.03
    )


def test_without_the_lag_is_what_marginalising_leaves():
    """The inverse of the information of all unknowns, with the prior of the lag, has the same block."""
    J = np.random.default_rng(4).normal(size=(30, 5))
    whole = J.T @ J
    prior = np.diag([0.0, 0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        without_lag(whole), np.linalg.inv(np.linalg.inv(whole + prior)[:4, :4]), rtol=1e-9
    )


def sighting(parameters: ElasticParameters, rates: np.ndarray, spread: float = 2e-3) -> Sighting:
    """Motors that turn with given largest speeds in rad/s, watched by a gyro on forearm and hand."""
    times = 1e-3 * np.arange(200)
    shape = np.sin(np.pi * np.clip((times - 0.02) / 0.1, 0.0, 1.0)) ** 2
    rate = np.outer(shape, rates)
    theta = np.deg2rad([0.0, -60.0, 40.0, 30.0, 50.0, 0.0]) + 1e-3 * np.cumsum(rate, axis=0)
    sensors = [
        SensorPlace(body, "gyro", body, np.zeros(3), np.eye(3), 200.0, 2e-3) for body in ("link_3", "link_5")
    ]
    case = MotionCase("one", 1e-3, theta, rate, np.zeros((len(times), 0, 3)))
    left = np.full(6, spread)
    return Sighting(load_robot("kr210"), PAYLOAD, case, sensors, left, parameters, parameters.start)


@pytest.mark.slow
def test_information_is_of_second_degree_in_motion_over_spread(parameters: ElasticParameters):
    """A motion half as fast tells a quarter: what it shows is linear in it, but for the squares of speeds."""
    rates = np.array([0.2, 0.2, 0.2, 0.0, 0.0, 0.0])
    whole = sighting(parameters, rates).information()
    assert whole.shape == (2, len(parameters) + 1, len(parameters) + 1)
    half = sighting(parameters, rates, spread=4e-3).information()
    np.testing.assert_allclose(half, 0.25 * whole, rtol=1e-9)
    names = parameters.names
    gear = names.index("stiffness_gear_2")
    slower = sighting(parameters, 0.5 * rates).information()
    assert slower[0, gear, gear] == pytest.approx(0.25 * whole[0, gear, gear], rel=0.1)


def test_a_motion_that_does_not_turn_an_axis_hardly_shows_the_spring_of_its_gear(
    parameters: ElasticParameters,
):
    of_1 = sighting(parameters, np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])).information().sum(axis=0)
    of_2 = sighting(parameters, np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])).information().sum(axis=0)
    gear = parameters.names.index("stiffness_gear_1")
    assert of_1[gear, gear] > 20.0 * of_2[gear, gear]
