"""Arms with beams under torques and commands of approximate inverses: Reiner (2010), figures 3.7 and 3.20."""

import casadi as ca
import numpy as np
import pytest

from experiments.zeros import beam_arm, two_beams
from experiments.zeros.end_path import EndPath
from experiments.zeros.runge_kutta import march
from robots.dynamics.modal.arm_equations import VARIANTS


def test_the_step_is_of_fourth_order():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    rates = ca.Function("rates", [x, u], [u * x])
    errors = []
    for steps in (10, 20):
        inputs = np.linspace(0.0, 1.0, 2 * steps + 1)[:, None]  # x = exp(t^2 / 2)
        errors.append(abs(march(rates, np.ones(1), inputs, 1.0 / steps)[-1, 0] - np.exp(0.5)))
    assert 12.0 < errors[0] / errors[1] < 20.0


def test_the_angles_of_a_path_put_the_end_on_it():
    path = EndPath((1.0, 0.2), (1.4, 0.6), start=0.1, duration=0.8)
    times = np.linspace(0.0, 1.0, 2001)
    angles = path.angles(times)
    first, both = angles[:, 0], angles[:, :2].sum(axis=1)
    end = np.stack([np.cos(first) + np.cos(both), np.sin(first) + np.sin(both)], axis=1)
    np.testing.assert_allclose(end, path.at(times)[0], atol=1e-12)
    for lower in (0, 2):
        slope = np.gradient(angles[:, lower : lower + 2], times, axis=0, edge_order=2)
        np.testing.assert_allclose(slope, angles[:, lower + 2 : lower + 4], atol=1e-3)


def test_outputs_at_nine_tenths_of_two_beams_with_one_mode_have_a_stable_inverse_which_three_modes_have_not():
    assert two_beams.output_zeros(1, two_beams.OUTPUT).is_minimum_phase
    assert not two_beams.output_zeros(3, two_beams.OUTPUT).is_minimum_phase


def test_two_beams_follow_its_torques_far_better_than_those_of_a_rigid_arm():
    """While they move, without a controller; gravity lets both drift away later."""
    moving = slice(0, round((two_beams.PATH.start + two_beams.PATH.duration) / two_beams.STEP))
    rigid, placed = (two_beams.run(modes).deviation[moving].max() for modes in (0, 1))
    assert placed < 0.25 * rigid


def test_only_without_the_couplings_the_structure_can_be_inverted():
    growth = {name: beam_arm.StructureInverse(terms).fastest_growth() for name, terms in VARIANTS.items()}
    assert all(growth[name] == 0.0 for name in "1234")
    assert growth["5"] > 100.0
    with pytest.raises(ValueError, match=r"this inverse is unstable: it grows by \d+ 1/s"):
        beam_arm.configuration(beam_arm.CONFIGURATIONS[0], VARIANTS["5"])


def test_an_unknown_configuration_is_refused():
    with pytest.raises(ValueError, match="must be one of gears and structure, gears, rigid, got 'soft'"):
        beam_arm.configuration("soft")
