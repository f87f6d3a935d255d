"""A beam in space: analytic frequencies, its integrals by sums over points, files, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from robots.dynamics.modal.flexible_body import beam_body
from robots.dynamics.modal.modal_body import body_of_file, rigid_body
from robots.dynamics.modal.rayleigh_beam import RayleighBeam

BEAM = RayleighBeam(1.2, 3.0, (400.0, 700.0), 90.0, (0.03, 0.05), (2, 3, 2), damping=0.01)
MESH = beam_body(1.2, 3.0, 400.0, elements=12, modes=3)


def test_a_thin_beam_has_the_analytic_frequencies_in_both_planes_and_of_torsion():
    """b^2 sqrt(E I / (m l^3)) with cos b cosh b = -1; (k - 1/2) pi sqrt(G J l / (m r^2)) / l."""
    beam = RayleighBeam(1.2, 3.0, (400.0, 700.0), 90.0, (1e-5, 1e-5), (2, 2, 2))
    bending = np.array([1.875104, 4.694091]) ** 2 * np.sqrt(1.0 / (3.0 * 1.2**3))
    twisting = np.pi * np.array([0.5, 1.5]) * np.sqrt(90.0 / (3.0 * 1.2 * 2e-10))
    expected = np.concatenate([20.0 * bending, np.sqrt(700.0) * bending, twisting])
    np.testing.assert_allclose(beam.body().frequencies(), np.sort(expected), rtol=1e-6)


def test_its_integrals_are_sums_over_its_points():
    """Displacements and places of four points for each of many sections, which have the section's moments."""
    body = BEAM.body()
    count = 4000
    xi = (np.arange(count) + 0.5) / count
    fields = BEAM._fields(xi)
    corners = [(1.0, a * BEAM.radii[0], b * BEAM.radii[1]) for a in (-1, 1) for b in (-1, 1)]
    points = np.concatenate([np.einsum("p,kspi->ksi", corner, fields) for corner in corners], axis=1)
    dm = BEAM.mass / points.shape[1]
    place, moved = points[0], points[1:]
    np.testing.assert_allclose(body.first_moment, dm * place.sum(axis=0), atol=1e-6)
    np.testing.assert_allclose(body.Ct, dm * moved.sum(axis=1), atol=1e-6)
    np.testing.assert_allclose(body.Cr, dm * np.cross(place, moved).sum(axis=1), atol=1e-5)
    np.testing.assert_allclose(body.Me, dm * np.einsum("ksi,lsi->kl", moved, moved), atol=1e-5)
    w = np.array([0.4, -0.7, 1.1])
    squares = np.array([*w**2, w[0] * w[1], w[1] * w[2], w[0] * w[2]])
    inward = np.cross(w, np.cross(w, place))
    np.testing.assert_allclose(body.Oe @ squares, dm * np.einsum("ksi,si->k", moved, inward), atol=1e-5)
    kinetic = dm * (np.cross(w, place) ** 2).sum()
    assert w @ body.inertia @ w == pytest.approx(kinetic, rel=1e-6)


def test_all_modes_carry_what_a_held_frame_does_not():
    """Parseval: squares of C_r add up to the moments of inertia, as far as the section is thin."""
    body = replace(BEAM, radii=(1e-4, 1e-4), modes=(10, 10, 10)).body()
    shares = np.einsum("ki,kl,li->i", body.Cr, np.linalg.inv(body.Me), body.Cr) / np.diag(body.inertia)
    np.testing.assert_allclose(shares, 1.0, rtol=0.03)
    assert shares.max() < 1.0 + 1e-9


def test_a_body_of_a_file_has_the_integrals_of_the_file():
    body = body_of_file(MESH)
    np.testing.assert_allclose(body.Cr, MESH.Cr, atol=1e-12)
    np.testing.assert_allclose(body.Oe, np.asarray(MESH.Oe), atol=1e-12)
    np.testing.assert_allclose(body.inertia, MESH.inertia, atol=1e-12)
    beam = RayleighBeam(1.2, 3.0, (400.0, 400.0), radii=(0.0, 0.0), modes=(3, 0, 0)).body()
    ours, exact = (abs(each.Oe[:, 3]) / np.sqrt(np.diag(each.Me)) for each in (body, beam))
    np.testing.assert_allclose(ours, exact, rtol=1e-3)


REFUSED = {
    "length": (lambda: RayleighBeam(length=0.0), "length must be positive, got 0.0"),
    "stiffness": (lambda: RayleighBeam(bending_stiffness=(1.0, -1.0)), "bending_stiffness must be positive"),
    "radii": (lambda: RayleighBeam(radii=(-0.1, 0.1)), "radii must not be negative"),
    "modes": (lambda: RayleighBeam(modes=(2, 20, 2)), r"modes must be 0 to 12 each, got \(2, 20, 2\)"),
    "thin": (lambda: RayleighBeam(radii=(0.0, 0.0)), "a beam that twists needs radii above zero"),
    "psi": (lambda: body_of_file(replace(MESH, turns=None)), r"do not say how far .* \(psi\)"),
    "Oe": (lambda: body_of_file(replace(MESH, Oe=None)), "do not say O_e"),
    "clamped": (lambda: body_of_file(replace(MESH, shapes=MESH.shapes + 0.1)), "no mode may move or turn it"),
    "inertia": (lambda: rigid_body(1.0, (0.0, 0.0, 0.0), np.diag([1.0, 1.0, 3.0])), "no body has 1 kg"),
}  # fmt: skip


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED)
def test_an_impossible_body_is_refused(call, message: str):
    with pytest.raises(ValueError, match=message):
        call()
