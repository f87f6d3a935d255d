"""Beam surrogates: what the undeformed beam keeps, and the Euler-Bernoulli cantilever in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from robots.description.beam import Beam, beam_surrogate
from robots.description.model import Link
from robots.dynamics.elastic_structure import SprungJoints, add_beam_link

LENGTH, MASS, RADIUS = 1.2, 30.0, 0.1
GI, EI_Y, EI_Z = 2e5, 3e5, 5e5


def tube(mass: float, length: float, radius: float, along: int = 0) -> np.ndarray:
    """Principal moments of a thin-walled tube."""
    inertia = np.full(3, mass * (radius**2 / 2.0 + length**2 / 12.0))
    inertia[along] = mass * radius**2
    return inertia


def beam(degrees_of_freedom: int, **changes: object) -> Beam:
    values: dict = {"length": LENGTH, "stiffness": np.array([GI, EI_Y, EI_Z])}
    return Beam(**{**values, "degrees_of_freedom": degrees_of_freedom, **changes})


class Cantilever:
    """A beam along x, clamped to the world in a plant of its own."""

    def __init__(self, degrees_of_freedom: int, radius: float = RADIUS) -> None:
        self.plant = MultibodyPlant(0.0)
        link = Link(mass=MASS, inertia=tube(MASS, LENGTH, radius), beam=beam(degrees_of_freedom))
        link.center_of_mass = np.array([0.5 * LENGTH, 0.0, 0.0])
        self.hinges = SprungJoints()
        first, self.last = add_beam_link(self.plant, self.hinges, 1, link, None)
        self.plant.WeldFrames(self.plant.world_frame(), first.body_frame())
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.end = np.array([LENGTH, 0.0, 0.0])  # in the frame of the last body
        self.rows = [joint.position_start() for joint in self.hinges.joints]
        self.stiffness = np.array([spring.default_stiffness() for spring in self.hinges.springs])

    def compliance(self) -> np.ndarray:
        """How the end turns (rad) and moves (m) under a moment and a force there, (6, 6)."""
        world, frame = self.plant.world_frame(), self.last.body_frame()
        J = self.plant.CalcJacobianSpatialVelocity(
            self.context, JacobianWrtVariable.kV, frame, self.end, world, world
        )[:, self.rows]
        return J / self.stiffness @ J.T

    def angular_frequencies(self) -> np.ndarray:
        M = self.plant.CalcMassMatrix(self.context)[np.ix_(self.rows, self.rows)]
        return np.sqrt(eigh(np.diag(self.stiffness), M, eigvals_only=True))


@given(
    dof=st.sampled_from([3, 5]),
    along=st.integers(0, 2),
    share=st.floats(0.36, 0.64),  # of the length, where the centre of mass lies; a third is the limit
    start=st.floats(-1.0, 1.0),
    radius=st.floats(0.05, 0.3),
    flatness=st.floats(0.0, 0.9),
    beside=st.floats(-0.1, 0.1),
)
def test_mass_centre_and_inertia_of_the_undeformed_beam_are_conserved(
    dof: int, along: int, share: float, start: float, radius: float, flatness: float, beside: float
):
    """Reiner (2010), eqs. (2.23), (2.24) corrected, and each moment for itself."""
    center = np.full(3, beside)
    center[along] = start + share * LENGTH
    inertia = tube(MASS, LENGTH, radius, along)
    inertia[(along + 1) % 3] += flatness * MASS * radius**2
    # Heavier ends, which put the centre beside the middle, have more inertia.
    inertia += MASS * 0.3 * LENGTH**2 * abs(share - 0.5) * (np.arange(3) != along)
    surrogate = beam_surrogate(beam(dof, along="xyz"[along], start=start), MASS, center, inertia)

    masses = np.array([segment.mass for segment in surrogate.segments])
    centers = np.array([segment.center_of_mass for segment in surrogate.segments])
    assert masses.sum() == pytest.approx(MASS, rel=1e-12)
    np.testing.assert_allclose(masses @ centers / MASS, center, atol=1e-12)
    about_center = np.zeros((3, 3))
    for segment, d in zip(surrogate.segments, centers - center, strict=True):
        about_center += np.diag(segment.inertia) + segment.mass * (d @ d * np.eye(3) - np.outer(d, d))
    np.testing.assert_allclose(about_center, np.diag(inertia), atol=1e-11)
    assert surrogate.segments[0].start == start
    assert surrogate.segments[-1].end == pytest.approx(start + LENGTH)


def test_the_masses_of_the_five_degrees_of_freedom_are_those_of_the_source():
    k, center = 0.5 * (1.0 - 1.0 / np.sqrt(3.0)), 0.55 * LENGTH
    surrogate = beam_surrogate(beam(5), MASS, np.array([center, 0.0, 0.0]), np.array([0.3, 6.0, 6.0]))
    moved = MASS / 2.0 * (2.0 * center - LENGTH) / (LENGTH * (k - 1.0))  # (2.23g)
    expected = [MASS * k + moved, MASS * (0.5 - k), MASS * (0.5 - k), MASS * k - moved]
    assert [segment.mass for segment in surrogate.segments] == pytest.approx(expected)
    assert [hinge.name for hinge in surrogate.hinges] == ["y1", "z1", "x", "y2", "z2"]
    at = [hinge.position[0] / LENGTH for hinge in surrogate.hinges]
    assert at == pytest.approx([k, k, 0.5, 1.0 - k, 1.0 - k])


@pytest.mark.parametrize("degrees_of_freedom", [3, 5])
def test_the_end_deflects_and_turns_as_the_cantilever(degrees_of_freedom: int):
    """F l^3 / 3 EI and F l^2 / 2 EI under a force, M l^2 / 2 EI and M l / EI under a moment, T l / GI."""
    compliance = Cantilever(degrees_of_freedom).compliance()
    wx, wy, wz, _, vy, vz = range(6)
    length = LENGTH
    slope_under_moment = 1.0 if degrees_of_freedom == 5 else 0.75  # what the dependent rotation leaves out
    expected = np.zeros((6, 6))
    expected[wx, wx] = length / GI
    for w, v, EI, sign in ((wy, vz, EI_Y, -1.0), (wz, vy, EI_Z, 1.0)):
        expected[v, v] = length**3 / (3.0 * EI)
        expected[w, v] = expected[v, w] = sign * length**2 / (2.0 * EI)
        expected[w, w] = slope_under_moment * length / EI
    np.testing.assert_allclose(compliance, expected, atol=1e-17)  # entries of 1e-6, rounding


@pytest.mark.parametrize(("degrees_of_freedom", "tolerance"), [(5, 0.015), (3, 0.05)])
def test_the_lowest_bending_frequencies_are_those_of_the_cantilever(
    degrees_of_freedom: int, tolerance: float
):
    """1.8751^2 sqrt(EI / m l^3), uniform and thin; one percent too slow, five percent too fast."""
    thin = Cantilever(degrees_of_freedom, radius=0.01)
    exact = 1.8751041**2 * np.sqrt(np.array([EI_Y, EI_Z]) / (MASS * LENGTH**3))
    frequencies = thin.angular_frequencies()[:2]
    np.testing.assert_allclose(frequencies, exact, rtol=tolerance)


def test_three_degrees_of_freedom_move_the_end_as_a_dependent_rotation_does():
    """Figure 2.11: phi at the clamp and gamma phi at the end, gamma = 1/2, with a stiffness of 3 EI / l."""
    phi = np.array([1e-4, -2e-4])  # rad about y and z
    cantilever = Cantilever(3)
    positions = np.zeros(3)
    positions[cantilever.rows[:2]] = 1.5 * phi
    cantilever.plant.SetPositions(cantilever.context, positions)
    X = cantilever.last.EvalPoseInWorld(cantilever.context)
    clamp = Rotation.from_rotvec([0.0, *phi])
    assert X @ cantilever.end == pytest.approx(clamp.apply(cantilever.end), abs=1e-7)  # second order
    turned = (clamp * Rotation.from_rotvec([0.0, *(0.5 * phi)])).as_matrix()
    assert X.rotation().matrix() == pytest.approx(turned, abs=1e-7)
    energy = 0.5 * cantilever.stiffness @ positions[cantilever.rows] ** 2
    assert energy == pytest.approx(0.5 * 3.0 / LENGTH * (EI_Y * phi[0] ** 2 + EI_Z * phi[1] ** 2))


CENTER, INERTIA = np.array([0.5 * LENGTH, 0.0, 0.0]), tube(MASS, LENGTH, RADIUS)
REFUSED = {
    "radius": (beam(5), CENTER, np.array([0.3, 3.0, 3.0]), "square of the substitute radius must not be neg"),
    "stiffness": (beam(5, stiffness=np.array([1.0, 0.0, 1.0])), CENTER, INERTIA, "stiffness must be pos"),
    "length": (beam(5, length=0.0), CENTER, INERTIA, "length must be positive, got 0.0 m"),
    "kind": (beam(4), CENTER, INERTIA, "degrees_of_freedom must be 3 or 5, got 4"),
    "axis": (beam(5, along="w"), CENTER, INERTIA, "along must be one of x, y, z, got 'w'"),
    "damping": (beam(5, retardation_time=-1.0), CENTER, INERTIA, "retardation_time must not be negative"),
    "centre": (beam(5), 0.6 * CENTER, INERTIA, "must lie within 200.0 mm of the middle of the beam"),
    "no tube": (beam(5), CENTER, np.array([6.0, 4.0, 4.0]), "which no body has; the link is no hollow beam"),
}  # fmt: skip


@pytest.mark.parametrize(("refused", "center", "inertia", "message"), REFUSED.values(), ids=REFUSED)
def test_an_impossible_beam_is_refused(refused: Beam, center: np.ndarray, inertia: np.ndarray, message: str):
    with pytest.raises(ValueError, match=f"^beam: .*{message}"):
        beam_surrogate(refused, MASS, center, inertia)
