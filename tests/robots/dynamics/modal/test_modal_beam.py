"""A beam as mode shapes: analytic frequencies, rigid limits, how far out its output may stand."""

import numpy as np
import pytest
from scipy.optimize import root_scalar

from robots.dynamics.modal.modal_beam import ModalBeam


def test_a_clamped_beam_without_load_has_the_analytic_frequencies():
    beam = ModalBeam(length=1.5, mass=4.0, bending_stiffness=900.0, load=0.0, num_modes=3)
    unit = np.sqrt(900.0 / (4.0 * 1.5**3))
    assert beam.frequencies() == pytest.approx(unit * np.array([1.875104, 4.694091, 7.854757]) ** 2, rel=1e-6)


def test_a_loaded_beam_converges_to_the_analytic_frequency_from_above():
    """1 + cos b cosh b = b m / M (sin b cosh b - cos b sinh b)."""

    def equation(b: float) -> float:
        inertia = 0.45 * b * (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b))
        return 1.0 + np.cos(b) * np.cosh(b) - inertia

    exact = root_scalar(equation, bracket=(0.5, 1.9)).root ** 2
    found = [ModalBeam(num_modes=n).frequencies()[0] for n in (1, 2, 4, 8)]
    assert np.all(np.diff(found) < 0.0)
    assert found[-1] == pytest.approx(exact, rel=2e-5)
    assert found[-1] > exact


@pytest.mark.parametrize("boundary", ["clamped", "supported"])
def test_turned_as_a_whole_it_is_a_rigid_rod(boundary: str):
    beam = ModalBeam(length=2.0, mass=3.0, load=0.5, num_modes=3, boundary=boundary)
    assert beam.mass_matrix()[0, 0] == pytest.approx(3.0 * 2.0**2 / 3.0 + 0.5 * 2.0**2)
    assert not beam.stiffness_matrix()[0].any()


@pytest.mark.parametrize(
    ("boundary", "one", "three"), [("clamped", 0.89, 0.309), ("supported", 0.92, 0.39)], ids=str
)
def test_how_far_out_the_output_may_stand(boundary: str, one: float, three: float):
    """Reiner (2010), section 3.5.1, prints 0.9 and 0.3; clamped modes have 0.89 and 0.309."""
    assert ModalBeam(num_modes=1, boundary=boundary).largest_stable_xi() == pytest.approx(one, abs=2e-3)
    assert ModalBeam(num_modes=3, boundary=boundary).largest_stable_xi() == pytest.approx(three, abs=2e-3)


def test_the_more_modes_the_nearer_to_the_joint():
    limits = [ModalBeam(num_modes=n).largest_stable_xi() for n in (1, 2, 3, 5)]
    assert np.all(np.diff(limits) < 0.0)
    assert limits[3] * 5.0 == pytest.approx(limits[2] * 3.0, rel=0.02)  # it falls like 1 / n


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"length": 0.0}, "length must be positive, got 0.0"),
        ({"load": -1.0}, "load must not be negative, got -1.0 kg"),
        ({"num_modes": 40}, "num_modes must be between 1 and 12, got 40"),
        ({"boundary": "glued"}, "boundary must be one of clamped, supported, got 'glued'"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_an_impossible_beam_is_refused(wrong: dict, message: str):
    with pytest.raises(ValueError, match=message):
        ModalBeam(**wrong)


@pytest.mark.parametrize("load", [0.2, 1.0, 5.0])
def test_without_the_coupling_of_its_own_mass_the_end_has_a_stable_inverse(load: float):
    """The zeros are then the natural frequencies of the clamped beam without its load, which stands still."""
    beam = ModalBeam(num_modes=3, load=load)
    assert not beam.zeros(1.0).is_minimum_phase
    decoupled = beam.decoupled_zeros(1.0)
    assert decoupled.is_minimum_phase
    found = np.sort(np.imag(decoupled.values))[3:]
    np.testing.assert_allclose(found, [3.516, 22.035, 61.697], rtol=1e-3)
    assert beam.decoupled_zeros(1.0, load_coupled=False).is_minimum_phase


def test_modes_of_a_supported_beam_are_not_decoupled():
    with pytest.raises(ValueError, match="only clamped modes can be decoupled"):
        ModalBeam(boundary="supported").decoupled_zeros()
