"""Arms in space with bodies that bend and twist: conservation, rigid limits by Drake, the plane, statics."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

from robots.dynamics.modal.arm_equations import NOMINAL, VARIANTS
from robots.dynamics.modal.flexible_body import beam_body
from robots.dynamics.modal.modal_arm import ModalArm, beam_link
from robots.dynamics.modal.modal_beam import ModalBeam
from robots.dynamics.modal.modal_body import ModalBody, body_of_file, rigid_body
from robots.dynamics.modal.rayleigh_beam import RayleighBeam
from robots.dynamics.modal.spatial_arm import SpatialArm, SpatialLink

GRAVITY = np.array([1.0, -2.0, -9.5])  # in no special direction
LOAD = rigid_body(0.7, (0.05, 0.1, -0.08), np.diag([0.01, 0.02, 0.025]))
AXES = ((0.0, 0.3, 1.0), (0.1, 1.0, 0.0), (1.0, 1.0, 1.0))
PLACEMENTS = (
    None,
    RollPitchYaw(0.4, -0.3, 1.1).ToRotationMatrix().matrix(),
    RotationMatrix.MakeXRotation(1.0).matrix(),
)


def beam(modes: tuple[int, int, int] = (2, 2, 1), stiffer: float = 1.0, damping: float = 0.0) -> RayleighBeam:
    bending = (400.0 * stiffer, 700.0 * stiffer)
    return RayleighBeam(1.2, 3.0, bending, 90.0 * stiffer, (0.03, 0.05), modes, damping)


def spatial(bodies: list[ModalBody], gravity: np.ndarray = GRAVITY, terms=NOMINAL) -> SpatialArm:
    links = [SpatialLink(*each, LOAD) for each in zip(bodies, AXES, PLACEMENTS, strict=False)]
    return SpatialArm(links, terms, tuple(gravity))


def random_state(arm: SpatialArm, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    is_angle = np.isin(np.arange(arm.size), arm.joints)
    x, v = rng.normal(size=(2, arm.size)) * np.where(is_angle, 1.0, [[0.02], [0.3]])
    return x, v


def accelerations(arm: SpatialArm, x: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return np.linalg.solve(np.asarray(arm.mass(x)), arm.B @ tau - np.asarray(arm.bias(x, v))[:, 0])


@pytest.mark.parametrize("kind", ["beam", "file"])
def test_what_the_torques_do_is_what_the_energy_gains(kind: str):
    """In random states, without damping; the rate of the energy by central differences, 1e-7 s apart."""
    rng = np.random.default_rng(0)
    second = beam().body() if kind == "beam" else body_of_file(beam_body(1.2, 3.0, 400.0, 12, 3))
    arm = spatial([beam().body(), second])
    for _ in range(4):
        (x, v), tau = random_state(arm, rng), rng.normal(scale=20.0, size=2)
        a = accelerations(arm, x, v, tau)
        ends = [float(arm.energy(x + t * v + 0.5 * t * t * a, v + t * a)) for t in (1e-7, -1e-7)]
        assert (ends[0] - ends[1]) / 2e-7 == pytest.approx(float(tau @ arm.B.T @ v), abs=3e-3)  # W of some 20


def test_the_mass_matrix_is_symmetric_and_twice_the_kinetic_energy():
    arm, rng = spatial([beam().body()] * 2, gravity=np.zeros(3)), np.random.default_rng(1)
    x, v = random_state(arm, rng)
    M = np.asarray(arm.mass(x))
    np.testing.assert_allclose(M, M.T, atol=1e-12)
    kinetic = float(arm.energy(x, v)) - float(arm.energy(x, np.zeros(arm.size)))
    assert kinetic == pytest.approx(0.5 * v @ M @ v, rel=1e-12)


def test_a_damped_arm_only_loses_energy():
    body = beam(damping=0.01).body()
    arm = spatial([body])
    v = np.array([0.0, 0.1, -0.2, 0.05, 0.3, -0.1])
    a = accelerations(arm, np.zeros(arm.size), v, np.zeros(1))
    ends = [float(arm.energy(t * v + 0.5 * t * t * a, v + t * a)) for t in (1e-7, -1e-7)]
    assert (ends[0] - ends[1]) / 2e-7 == pytest.approx(-v[1:] @ body.De @ v[1:], rel=1e-3)


@pytest.mark.slow
def test_on_a_free_ball_joint_energy_and_angular_momentum_stay_with_the_fourth_power_of_the_step():
    """Three joints through one point hold no moment; without gravity all three components stay."""
    nothing = rigid_body(0.0, (0.0, 0.0, 0.0), np.zeros((3, 3)))
    soft = beam((1, 1, 1), stiffer=0.2).body()
    links = [
        SpatialLink(nothing, (0.0, 0.0, 1.0)),
        SpatialLink(nothing, (0.0, 1.0, 0.0)),
        SpatialLink(soft, (1.0, 0.0, 0.0), None, LOAD),
        SpatialLink(soft, (0.0, 1.0, 1.0), PLACEMENTS[1], LOAD),
    ]
    arm = SpatialArm(links, gravity=(0.0, 0.0, 0.0))
    state = ca.SX.sym("state", 2 * arm.size)
    x, v = ca.vertsplit(state, arm.size)
    rate = ca.vertcat(v, -ca.solve(arm.mass(x), arm.bias(x, v)))
    start = np.zeros(2 * arm.size)
    start[arm.joints] = 0.3, 0.4, -0.5, 0.8
    start[arm.size + arm.joints] = 1.0, -0.7, 1.5, -1.2
    times, worst = np.linspace(0.0, 0.5, 51), []
    for steps in (10, 20):
        options = {"number_of_finite_elements": 50 * steps}
        march = ca.integrator("march", "rk", {"x": state, "ode": rate}, 0.0, times, options)
        parts = np.split(np.asarray(march(x0=start)["xf"]), 2)
        energy = np.asarray(arm.energy.map(51)(*parts))[0]
        angular = np.asarray(arm.momentum.map(51)(*parts)[1]).T
        worst.append([np.ptp(energy) / energy[0], np.ptp(angular, axis=0).max() / np.abs(angular[0]).max()])
    coarse, fine = worst
    assert max(fine) < 1e-5
    assert all(after < before / 10.0 for before, after in zip(coarse, fine, strict=True))


def drake_chain() -> MultibodyPlant:
    """The same links without modes."""
    plant, socket = MultibodyPlant(0.0), None
    plant.mutable_gravity_field().set_gravity_vector(GRAVITY)
    link, end = beam().body(), RigidTransform(np.array([1.2, 0.0, 0.0]))
    for number, (axis, placement) in enumerate(zip(AXES, PLACEMENTS, strict=True)):
        about_center = link.inertia - 3.0 * np.diag([0.0, 0.36, 0.36])
        inertia = SpatialInertia.MakeFromCentralInertia(
            3.0, np.array([0.6, 0.0, 0.0]), RotationalInertia(*np.diag(about_center))
        )
        inertia += SpatialInertia.MakeFromCentralInertia(
            0.7, np.array([1.25, 0.1, -0.08]), RotationalInertia(0.01, 0.02, 0.025)
        )
        body = plant.AddRigidBody(f"link_{number}", inertia)
        X = RigidTransform(RotationMatrix(np.eye(3) if placement is None else placement))
        before = plant.world_frame() if socket is None else socket
        hinge = plant.AddFrame(FixedOffsetFrame(f"hinge_{number}", before, X))
        plant.AddJoint(RevoluteJoint(f"joint_{number}", hinge, body.body_frame(), np.array(axis)))
        socket = plant.AddFrame(FixedOffsetFrame(f"end_{number}", body.body_frame(), end))
    plant.Finalize()
    return plant


def inverse_dynamics(plant: MultibodyPlant, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    plant.SetPositionsAndVelocities(context, np.concatenate([x, v]))
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcInverseDynamics(context, a, forces)


def test_without_modes_it_is_the_chain_of_drake():
    rng, plant = np.random.default_rng(2), drake_chain()
    arm = spatial([beam().body().rigid] * 3)
    for _ in range(5):
        x, v, a = rng.normal(scale=2.0, size=(3, 3))
        found = arm.torques(x[None], v[None], a[None])[0]
        np.testing.assert_allclose(found, inverse_dynamics(plant, x, v, a), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_stiff_beams_under_their_load_go_to_the_chain_of_drake():
    """Modes at what the motion bends them by; the torques differ as the compliance does."""
    x, v, a = np.random.default_rng(3).normal(size=(3, 3))
    expected = inverse_dynamics(drake_chain(), x, v, a)
    errors = []
    for stiffer in (1e4, 1e6):
        arm = spatial([beam(stiffer=stiffer).body()] * 3)
        state, rate, acceleration = np.zeros((3, arm.size))
        state[arm.joints], rate[arm.joints], acceleration[arm.joints] = x, v, a
        for _ in range(5):
            lack = arm.torques(state[None], rate[None], acceleration[None])[0][arm.modes]
            K = np.asarray(arm.tangent(state))[np.ix_(arm.modes, arm.modes)]
            state[arm.modes] -= np.linalg.solve(K, lack)
        found = arm.torques(state[None], rate[None], acceleration[None])[0][arm.joints]
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert errors[1] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)


def test_in_a_plane_it_is_the_plane_arm():
    flat = RayleighBeam(1.2, 3.0, (400.0, 400.0), radii=(0.0, 0.0), modes=(3, 0, 0), damping=0.02).body()
    point = rigid_body(0.7, (0.0, 0.0, 0.0), np.zeros((3, 3)))
    arm = SpatialArm([SpatialLink(flat, load=point)] * 2, gravity=(0.0, -9.81, 0.0))
    plane = ModalArm([beam_link(ModalBeam(1.2, 3.0, 400.0, 0.7, 3), damping=0.02)] * 2)
    x, v = random_state(arm, np.random.default_rng(4))
    for name, arguments in (("mass", (x,)), ("bias", (x, v)), ("tangent", (x,)), ("energy", (x, v))):
        found, expected = (np.asarray(getattr(each, name)(*arguments)) for each in (arm, plane))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9, err_msg=name)
    for found, expected in zip(arm.end(x, v), plane.end(x, v), strict=True):
        np.testing.assert_allclose(np.asarray(found)[:2], expected, atol=1e-10)


def test_a_bracket_sags_as_two_cantilevers_and_a_shaft():
    """F l^3 (2 / 3 E I + 1 / G J) at the free end of two beams at a right angle, F square to both."""
    force, errors = 0.05, []
    for modes in (2, 4, 8):
        legs = [RayleighBeam(1.2, 3.0, (400.0, 700.0), 90.0, (0.03, 0.05), (0, modes, modes)).body()] * 2
        corner = RotationMatrix.MakeZRotation(0.5 * np.pi).matrix()
        arm = SpatialArm(
            [SpatialLink(legs[0]), SpatialLink(legs[1], (0.0, 0.0, 1.0), corner)], gravity=(0.0, 0.0, 0.0)
        )
        straight = np.zeros(arm.size)
        J, K = np.asarray(arm.end(straight, straight)[1])[2, arm.modes], np.asarray(arm.tangent(straight))
        sag = force * J @ np.linalg.solve(K[np.ix_(arm.modes, arm.modes)], J)
        exact = force * 1.2**3 * (2.0 / (3.0 * 700.0) + 1.0 / 90.0)
        errors.append(abs(sag / exact - 1.0))
    # A moment at the end is what modes of a free end are worst at: it falls like 1 / n.
    assert errors[-1] < 0.03
    assert all(after < 0.6 * before for before, after in pairwise(errors))


def test_the_clamp_carries_what_the_joint_does_and_the_weight():
    arm = spatial([beam().body()] * 2)
    x = arm.at_rest(np.array([0.3, -0.8]))
    still = np.zeros(arm.size)
    force, moment = (np.asarray(each)[:, 0] for each in arm.clamp(x, still, still))
    assert np.linalg.norm(force) == pytest.approx(3.7 * np.linalg.norm(GRAVITY), rel=1e-9)
    axis = np.array(AXES[1]) / np.linalg.norm(AXES[1])
    torque = arm.torques(x[None], still[None], still[None])[0][arm.joints[1]]
    assert moment @ axis == pytest.approx(torque, rel=1e-9)


def test_variants_leave_out_what_they_say():
    """Turning and bent, each differs from the one before it, the fifth from the whole in C_r alone."""
    body, v = beam().body(), np.linspace(-1.0, 2.0, 6)
    x = np.array([0.2, 0.02, -0.004, 0.01, 0.003, 0.02])
    models = {**VARIANTS, "whole": NOMINAL}
    arms = {name: spatial([body], terms=terms) for name, terms in models.items()}
    bias = {name: np.asarray(arm.bias(x, v))[:, 0] for name, arm in arms.items()}
    for first, second in (("1", "2"), ("2", "3"), ("3", "4")):
        assert np.abs(bias[first] - bias[second]).max() > 1e-3  # N m or N
    np.testing.assert_allclose(bias["5"], bias["whole"], atol=1e-12)
    axis = np.array(AXES[0]) / np.linalg.norm(AXES[0])
    coupling = np.asarray(arms["5"].mass(x)) - np.asarray(arms["4"].mass(x))
    np.testing.assert_allclose(coupling[0, 1:], body.Cr @ axis, atol=1e-12)
    assert np.abs(np.asarray(arms["whole"].mass(x)) - np.asarray(arms["5"].mass(x))).max() > 1e-4  # kg m


REFUSED = {
    "no link": (lambda: SpatialArm([]), "needs at least one link"),
    "axis": (lambda: SpatialArm([SpatialLink(LOAD, (0.0, 0.0, 0.0))]), "the axis of joint 1 is zero"),
    "placement": (
        lambda: SpatialArm([SpatialLink(LOAD, placement=-np.eye(3))]),
        "the placement of link 1 is no rotation",
    ),
    "load": (
        lambda: SpatialArm([SpatialLink(LOAD, load=beam().body())]),
        "the load of link 1 must not have modes",
    ),
}


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED)
def test_links_that_cannot_be_are_refused(call, message: str):
    with pytest.raises(ValueError, match=message):
        call()
