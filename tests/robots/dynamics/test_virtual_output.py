"""Virtual outputs: zeros where they are wanted, no difference at rest; and what is refused."""

import numpy as np
import pytest
from scipy.signal import ss2tf

from experiments.zeros.linear_arm import LinearArm, filtered_path, virtual_outputs
from robots.dynamics.virtual_output import virtual_output

A, B, C = LinearArm().state_space()


@pytest.mark.parametrize("wanted", [(-250.0, -292.0, -306.0), (-100.0, -50.0 + 80.0j, -50.0 - 80.0j)])
def test_the_zeros_are_where_they_are_wanted(wanted: tuple[complex, ...]):
    found = virtual_output(A, B, C, np.array(wanted))
    roots = np.roots(ss2tf(A, B[:, None], found.row[None], np.zeros((1, 1)))[0][0].round(12))
    finite = roots[np.abs(roots) < 1e4]
    np.testing.assert_allclose(np.sort_complex(finite), np.sort_complex(np.array(wanted)), rtol=1e-3)


def test_two_zeros_at_one_place_are_ill_conditioned_but_come_near():
    found = virtual_output(A, B, C, np.array([-292.1857, -292.1857, -305.5786]))
    assert found.error < 1e-6
    apart = np.abs(np.sort(np.real(found.numerator.roots())) - np.array([-305.5786, -292.1857, -292.1857]))
    assert 1e-6 < apart.max() < 1.0


def test_at_rest_it_is_the_output():
    """Wherever the driven joint stands still; the sprung one is at zero there."""
    found = virtual_output(A, B, C, np.array([-250.0, -292.0, -306.0]))
    rest = np.array([0.7, 0.0, 0.0, 0.0])
    assert np.abs(A @ rest).max() == 0.0
    assert found.row @ rest == pytest.approx(C @ rest)
    moving = np.array([0.7, 0.01, 0.0, 0.5])
    assert abs(found.row @ moving - C @ moving) > 1e-4


def test_the_quasi_static_correction_keeps_the_point_on_its_path():
    """Reiner (2010), figure 3.12: nearly identical with it, off by centimetres on the way without."""
    _, alone, corrected = virtual_outputs(LinearArm(), np.array([-292.1857, -292.1857, -305.5786]))
    path = filtered_path()
    assert np.abs(alone - path).max() > 0.02
    assert np.abs(corrected - path).max() < 2e-5
    assert max(abs(alone[-1] - path[-1]), abs(corrected[-1] - path[-1])) < 1e-9


@pytest.mark.parametrize(
    ("order", "wanted", "message"),
    [
        ((0, 1, 2, 3), (-1.0, -2.0), "3 zeros are wanted for 4 states, got 2"),
        ((0, 1, 2, 3), (-1.0, -2.0, 3.0), "must have a negative real part"),
        ((2, 3, 0, 1), (-1.0, -2.0, -3.0), "the input must act on the last state"),
    ],
)
def test_what_is_impossible_is_refused(order: tuple[int, ...], wanted: tuple[float, ...], message: str):
    states = list(order)
    with pytest.raises(ValueError, match=message):
        virtual_output(A[np.ix_(states, states)], B[states], C[states], np.array(wanted))
