"""Arms of bodies that bend as fields: energy, the analytic beam, rigid limits, and what is refused."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)

from robots.dynamics.modal.arm_equations import VARIANTS
from robots.dynamics.modal.flexible_body import beam_body
from robots.dynamics.modal.modal_arm import ModalArm, beam_link, body_link
from robots.dynamics.modal.modal_beam import BOUNDARIES, ModalBeam

LENGTH, MASS, EI, LOAD = 1.2, 3.0, 400.0, 0.7
BODY = beam_body(LENGTH, MASS, EI, elements=16, modes=3, damping=0.01)
GRAVITY = 9.81


def beam(modes: int = 3, boundary: str = "clamped") -> ModalBeam:
    return ModalBeam(LENGTH, MASS, EI, LOAD, modes, boundary)


def test_what_the_torques_do_is_what_the_energy_gains():
    """In random states, without damping; the rate of the energy by central differences, 1e-7 s apart."""
    rng = np.random.default_rng(0)
    arm = ModalArm([beam_link(beam()), beam_link(beam(2, "supported"))])
    is_angle = np.isin(np.arange(arm.size), arm.joints)
    for _ in range(4):
        x, v = rng.normal(size=(2, arm.size)) * np.where(is_angle, 1.0, [[0.01], [0.3]])
        tau = rng.normal(scale=20.0, size=2)
        a = np.linalg.solve(np.asarray(arm.mass(x)), arm.B @ tau - np.asarray(arm.bias(x, v))[:, 0])
        ends = [float(arm.energy(x + t * v + 0.5 * t * t * a, v + t * a)) for t in (1e-7, -1e-7)]
        assert (ends[0] - ends[1]) / 2e-7 == pytest.approx(float(tau @ arm.B.T @ v), abs=2e-3)  # W of some 20


def test_a_damped_arm_only_loses_energy():
    arm = ModalArm([body_link(BODY, LOAD)])
    x, v = np.zeros(arm.size), np.array([0.0, 0.1, -0.2, 0.05])
    a = np.linalg.solve(np.asarray(arm.mass(x)), -np.asarray(arm.bias(x, v))[:, 0])
    ends = [float(arm.energy(x + t * v + 0.5 * t * t * a, v + t * a)) for t in (1e-7, -1e-7)]
    assert (ends[0] - ends[1]) / 2e-7 == pytest.approx(-v[1:] @ BODY.De @ v[1:], rel=1e-3)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_about_rest_one_link_is_the_analytic_beam(boundary: str):
    arm = ModalArm([beam_link(beam(boundary=boundary))], gravity=0.0)
    at_rest = np.zeros(arm.size)
    np.testing.assert_allclose(
        arm.mass(at_rest), beam(boundary=boundary).mass_matrix(), rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        arm.tangent(at_rest), beam(boundary=boundary).stiffness_matrix(), rtol=1e-12, atol=1e-7
    )
    np.testing.assert_allclose(arm.B, beam(boundary=boundary).input_column())


def test_with_more_modes_the_sag_goes_to_that_of_the_cantilever():
    """(3 m + 8 M) g l^3 / (24 E I) of a level beam."""
    exact = -GRAVITY * LENGTH**3 * (3.0 * MASS + 8.0 * LOAD) / (24.0 * EI)
    errors = []
    for modes in (2, 4, 8):
        arm = ModalArm([beam_link(beam(modes))])
        end = arm.end(arm.at_rest(np.zeros(1)), np.zeros(arm.size))[0]
        errors.append(abs(float(end[1]) / exact - 1.0))
    assert errors[-1] < 1e-4
    assert all(after < before / 5.0 for before, after in pairwise(errors))


def test_a_body_of_a_mesh_in_the_arm_is_the_beam_with_the_same_modes():
    mesh, exact = ModalArm([body_link(BODY, LOAD)] * 2), ModalArm([beam_link(beam())] * 2)
    angles = np.array([0.4, -0.9])
    ends = [arm.end(arm.at_rest(angles), np.zeros(arm.size))[0] for arm in (mesh, exact)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)
    frequencies = []
    for arm in (mesh, exact):
        x = arm.at_rest(angles)
        squares = np.linalg.eigvals(np.linalg.solve(np.asarray(arm.mass(x)), np.asarray(arm.tangent(x))))
        frequencies.append(np.sort(np.sqrt(np.abs(squares))))
    np.testing.assert_allclose(frequencies[0][2:], frequencies[1][2:], rtol=2e-3)


def test_without_modes_it_is_the_double_pendulum_of_drake():
    arm = ModalArm([beam_link(beam()).rigid, body_link(BODY, LOAD).rigid])
    plant = MultibodyPlant(0.0)
    rod = SpatialInertia(MASS, np.array([0.5 * LENGTH, 0.0, 0.0]), UnitInertia(0.0, *[LENGTH**2 / 3.0] * 2))
    at_end = UnitInertia(0.0, LENGTH**2, LENGTH**2)
    rod += SpatialInertia(LOAD, np.array([LENGTH, 0.0, 0.0]), at_end)
    socket = plant.world_frame()
    for number in range(2):
        body = plant.AddRigidBody(f"rod_{number}", rod)
        # x ahead and z up: against y a positive angle lifts the rod.
        axis = np.array([0.0, -1.0, 0.0])
        plant.AddJoint(RevoluteJoint(f"joint_{number}", socket, body.body_frame(), axis))
        end = RigidTransform(np.array([LENGTH, 0.0, 0.0]))
        socket = plant.AddFrame(FixedOffsetFrame(f"end_{number}", body.body_frame(), end))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    x, v, a = np.array([[0.3, -1.1], [1.2, -0.7], [-3.0, 5.0]])
    plant.SetPositionsAndVelocities(context, np.concatenate([x, v]))
    plant.CalcForceElementsContribution(context, forces)
    expected = plant.CalcInverseDynamics(context, a, forces)
    np.testing.assert_allclose(arm.torques(x[None], v[None], a[None])[0], expected, rtol=1e-9)


def test_variants_leave_out_what_they_say():
    """Where it turns and bends, each differs from the one before it; only the last one has C_r."""
    link = beam_link(beam())
    x, v = np.array([0.2, 0.02, -0.004, 0.001]), np.array([2.0, 0.3, -0.2, 0.1])
    arms = {name: ModalArm([link], terms) for name, terms in VARIANTS.items()}
    bias = {name: np.asarray(arm.bias(x, v))[:, 0] for name, arm in arms.items()}
    for first, second in (("1", "2"), ("2", "3"), ("3", "4")):
        assert np.abs(bias[first] - bias[second]).max() > 0.01  # N m or N
    coupling = np.asarray(arms["5"].mass(x)) - np.asarray(arms["4"].mass(x))
    np.testing.assert_allclose(coupling[0, 1:], link.Cr, rtol=1e-12)


REFUSED = {
    "no link": (lambda: ModalArm([]), "needs at least one link"),
    "turns": (lambda: body_link(replace(BODY, turns=None)), "does not say how far its modes turn"),
    "bends": (lambda: body_link(replace(BODY, shapes=BODY.shapes[:, [1, 0, 2]])), "bend along y"),
}


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED)
def test_a_body_that_does_not_fit_is_refused(call, message: str):
    with pytest.raises(ValueError, match=message):
        call()
