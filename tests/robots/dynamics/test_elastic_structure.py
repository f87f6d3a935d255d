"""Bearings that tilt and links that bend: the plant against the rigid robot, statics, energy and refusals."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

import robots.description.model
from robots.description.geometric_errors import GeometricErrors
from robots.description.model import RobotFileError, RobotModel, load_robot
from robots.dynamics.elastic_structure import tilting_axes
from robots.dynamics.plant import PlantRobot, add_robot
from robots.kinematics.forward import Kinematics

NAMES = ["irb1200", "kr16", "kr210"]  # bearings; bearings and a beam of 3; of 5 and a counterbalance
RNG = np.random.default_rng(4)
BENT = np.deg2rad([20.0, -40.0, 60.0, 40.0, 60.0, -25.0])  # away from every symmetry


def build(
    robot: RobotModel, elasticity: str = "structure", payload: float = 0.0, **options: Any
) -> tuple[PlantRobot, Context]:
    plant = MultibodyPlant(0.0)
    parts = add_robot(plant, robot, elasticity, payload, **options)
    plant.Finalize()
    return parts, plant.CreateDefaultContext()


def rows(parts: PlantRobot) -> tuple[list[int], list[int]]:
    """Where the motors and the sprung joints stand among the positions, and so among the velocities."""
    return [j.position_start() for j in parts.motors], [j.position_start() for j in parts.sprung]


def stiffened(name: str, factor: float, gears: bool) -> RobotModel:
    robot = load_robot(name)
    for joint in robot.joints:
        joint.drive_train.stiffness *= factor if gears else 1.0
        if joint.tilting is not None:
            joint.tilting.stiffness = [factor * c for c in joint.tilting.stiffness]
    for link in robot.links:
        if link.beam is not None:
            link.beam.stiffness = factor * link.beam.stiffness
    return robot


def tip(parts: PlantRobot, context: Context) -> np.ndarray:
    return parts.tool.CalcPoseInWorld(context).translation()


@given(arrays(float, 3, elements=st.floats(-1.0, 1.0)).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_a_bearing_tilts_about_two_axes_square_to_its_own(axis: np.ndarray):
    frame = np.vstack([tilting_axes(axis), axis / np.linalg.norm(axis)])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_axes_of_tilting_follow_in_cyclic_order():
    for i, axis in enumerate(np.eye(3)):
        np.testing.assert_array_equal(tilting_axes(axis), np.eye(3)[[(i + 1) % 3, (i + 2) % 3]])


def test_the_joints_stand_in_the_order_of_the_chain():
    parts, _ = build(load_robot("kr210"))
    names = [joint.name() for joint in parts.structure[:9]]
    tilts = [f"tilt_{letter}_{number}" for number in (1, 2) for letter in "ab"]
    beam = [f"beam_2_{name}" for name in ("y1", "z1", "x", "y2", "z2")]
    assert names == tilts + beam
    chain = [parts.motors[0], parts.deflections[0], *parts.structure[:2], parts.motors[1]]
    starts = [joint.position_start() for joint in chain]
    assert starts == list(range(5))


@pytest.mark.parametrize("name", NAMES)
def test_undeformed_it_is_the_rigid_robot(name: str):
    """Mass, inertia, gravity, Coriolis forces and the tool agree with all springs at zero."""
    robot = load_robot(name)
    payload = robot.payload.largest_mass
    elastic, context = build(robot, payload=payload)
    rigid, rigid_context = build(robot, "rigid", payload)
    motors, _ = rows(elastic)
    for _ in range(5):
        q, v = RNG.uniform(-2.0, 2.0, 6), RNG.normal(size=6)
        positions, velocities = np.zeros((2, elastic.plant.num_positions()))
        positions[motors], velocities[motors] = q, v
        elastic.plant.SetPositionsAndVelocities(context, np.concatenate([positions, velocities]))
        rigid.plant.SetPositionsAndVelocities(rigid_context, np.concatenate([q, v]))
        M = elastic.plant.CalcMassMatrix(context)[np.ix_(motors, motors)]
        M_rigid = rigid.plant.CalcMassMatrix(rigid_context)
        np.testing.assert_allclose(M, M_rigid, atol=1e-12 * np.abs(M_rigid).max())
        scale = 1e-8  # N m, rounding of torques up to 1e4
        np.testing.assert_allclose(elastic.load(context)[motors], rigid.load(rigid_context), atol=scale)
        bias, rigid_bias = elastic.plant.CalcBiasTerm(context), rigid.plant.CalcBiasTerm(rigid_context)
        np.testing.assert_allclose(bias[motors], rigid_bias, atol=scale)
        np.testing.assert_allclose(tip(elastic, context), tip(rigid, rigid_context), atol=1e-12)
    masses = [parts.plant.CalcTotalMass(at) for parts, at in ((elastic, context), (rigid, rigid_context))]
    assert masses[0] == pytest.approx(masses[1], rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_mass_matrix_is_symmetric_and_positive(name: str):
    parts, context = build(load_robot(name))
    for _ in range(20):
        positions = RNG.normal(scale=0.05, size=parts.plant.num_positions())
        positions[rows(parts)[0]] = RNG.uniform(-2.0, 2.0, 6)
        parts.plant.SetPositions(context, positions)
        M = parts.plant.CalcMassMatrix(context)
        np.testing.assert_allclose(M, M.T, atol=1e-12 * np.abs(M).max())
        assert np.linalg.eigvalsh(M).min() > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_with_a_stiff_structure_only_the_gears_are_left(name: str):
    """The distance to the robot with elastic joints falls in proportion to the compliance."""
    payload = load_robot(name).payload.largest_mass
    joints, context = build(load_robot(name), "joints", payload)
    joints.set_at_rest(context, BENT)
    away = []
    for factor in (1e3, 1e6):
        parts, at = build(stiffened(name, factor, gears=False), payload=payload)
        parts.set_at_rest(at, BENT)
        away.append(tip(parts, at) - tip(joints, context))
    assert np.linalg.norm(away[0]) > 1e-8
    np.testing.assert_allclose(1e3 * away[1], away[0], atol=0.01 * float(np.linalg.norm(away[0])))


@pytest.mark.parametrize("name", NAMES)
def test_the_tip_sags_by_compliance_times_load(name: str):
    """To first order J_e C^-1 tau, at a thousandth of the load so that the second order is far smaller."""
    robot = stiffened(name, 1e3, gears=True)
    parts, context = build(robot, payload=robot.payload.largest_mass)
    motors, sprung = rows(parts)
    positions = np.zeros(parts.plant.num_positions())
    positions[motors] = BENT
    parts.plant.SetPositions(context, positions)
    world = parts.plant.world_frame()
    J = parts.plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, parts.tool, np.zeros(3), world, world
    )[:, sprung]
    expected = J @ (parts.load(context)[sprung] / parts.sprung_stiffness)
    undeformed = Kinematics(robot).forward(BENT)[:3, 3]
    parts.set_at_rest(context, BENT)
    sag = tip(parts, context) - undeformed
    assert sag[2] < -1e-7
    np.testing.assert_allclose(sag, expected, atol=1e-4 * float(np.linalg.norm(expected)))


@pytest.mark.parametrize("name", NAMES)
def test_at_rest_nothing_accelerates(name: str):
    robot = load_robot(name)
    parts, context = build(robot, payload=robot.payload.largest_mass)
    parts.set_at_rest(context, BENT)
    motors, _ = rows(parts)
    parts.plant.get_actuation_input_port().FixValue(context, -parts.load(context)[motors])
    rates = parts.plant.EvalTimeDerivatives(context).CopyToVector()
    assert np.abs(rates).max() < 1e-6  # rad/s^2, what the last correction of the sag leaves


@pytest.mark.slow
def test_energy_is_conserved_in_free_vibration_without_losses():
    robot = load_robot("kr210")
    for joint in robot.joints:
        joint.drive_train.damping = joint.drive_train.viscous_friction = 0.0
        assert joint.tilting is not None
        joint.tilting.damping = [0.0, 0.0]
    beam = robot.links[1].beam
    assert beam is not None
    beam.retardation_time = 0.0
    parts, context = build(robot, payload=210.0)
    plant = parts.plant
    parts.set_at_rest(context, BENT)
    plant.SetVelocities(context, RNG.normal(scale=0.05, size=plant.num_velocities()))
    motors, _ = rows(parts)
    # The motors are held by constant torques, whose work is energy too.
    held, start = -parts.load(context)[motors], plant.GetPositions(context)[motors]
    plant.get_actuation_input_port().FixValue(context, held)
    config = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-8, max_step_size=1e-3)
    simulation = Simulator(plant, context)
    ApplySimulatorConfig(config, simulation)

    def energies() -> np.ndarray:
        work = held @ (plant.GetPositions(context)[motors] - start)
        return np.array([plant.EvalKineticEnergy(context), plant.EvalPotentialEnergy(context) - work])

    before = energies()
    simulation.AdvanceTo(0.05)
    after = energies()
    assert abs(after[1] - before[1]) > 1.0  # J, so there is something to conserve
    assert after.sum() == pytest.approx(before.sum(), abs=1e-3)


def test_geometric_errors_move_the_tool_as_without_elasticity():
    robot = load_robot("kr210")
    errors = GeometricErrors(
        np.linspace(-0.5, 0.5, 6), np.array([1.0, -2.0, 3.0]), np.array([0.1, 0.2, -0.1])
    )
    tips = []
    for elasticity in ("rigid", "structure"):
        parts, context = build(robot, elasticity, errors=errors)
        positions = np.zeros(parts.plant.num_positions())
        positions[rows(parts)[0]] = BENT
        parts.plant.SetPositions(context, positions)
        tips.append(tip(parts, context))
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-12)


def test_without_data_the_structure_is_stiff():
    robot = load_robot("irb1200")
    for joint in robot.joints:
        joint.tilting = None
    parts, _ = build(robot)
    assert not parts.structure
    assert parts.plant.num_positions() == 12


@pytest.mark.parametrize("elasticity", ["rigid", "structure"])
@pytest.mark.parametrize("q2", [-135.0, -90.0, -45.0, -5.0])
@pytest.mark.parametrize(("lateral", "damping"), [(0.0, 0.0), (0.2, 3e4)])
def test_the_counterbalance_turns_axis_2_as_its_formula_says(
    elasticity: str, q2: float, lateral: float, damping: float
):
    """Also beside the plane of the arm and with a damper, at 0.3 rad/s."""
    robot = load_robot("kr210")
    assert robot.counterbalance is not None
    robot.counterbalance.base_pivot += [0.0, lateral, 0.0]
    robot.counterbalance.damping = damping
    spring = robot.counterbalance_at_axis_2
    assert spring is not None
    parts, context = build(robot, elasticity)
    motors, _ = rows(parts)
    positions = np.zeros(parts.plant.num_positions())
    positions[motors[1]] = np.deg2rad(q2)
    parts.plant.SetPositions(context, positions)
    parts.plant.SetVelocities(context, np.where(positions != 0.0, 0.3, 0.0))
    other = parts.load(context) - parts.plant.CalcGravityGeneralizedForces(context)
    expected = np.zeros(6)
    expected[1] = spring.torque(np.deg2rad(q2), 0.3)
    np.testing.assert_allclose(other[motors], expected, atol=1e-8)  # of 7e3 N m


def edited(tmp_path: Path, *path: Any) -> str:
    """A copy of the KR 210's file with the last argument where the others lead."""
    *parents, key, value = path
    text = (Path(robots.description.model.__file__).parents[1] / "data" / "kr210.yaml").read_text()
    robot = part = yaml.safe_load(text)
    for parent in parents:
        part = part[parent]
    part[key] = value
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot))
    return str(tmp_path / "robot.yaml")


BEAM = ("links", 1, "beam")
BEAM_ON_BASE = {"length": 0.6, "stiffness": [1.0, 1.0, 1.0]}
REFUSED: dict[str, tuple] = {
    "tilting": (("joints", 2, "tilting", "stiffness", [1e6, 0]), "joints[2].tilting.stiffness[1] must be"),
    "one": (("joints", 2, "tilting", "stiffness", [1e6]), "joints[2].tilting.stiffness must be 2 numbers"),
    "damping": (("joints", 0, "tilting", "damping", [-1, 2]), "joints[0].tilting.damping[0] must be zero or"),
    "beam": ((*BEAM, "stiffness", [1e6, -1, 1e6]), "link 2: beam: stiffness must be positive"),
    "radius": (("links", 1, "inertia", [4.5, 15, 15]), "link 2: beam: the square of the substitute radius"),
    "vector": ((*BEAM, "stiffness", [1e6, 1e6]), "links[1].beam.stiffness must be 3 numbers, got"),
    "base": (("base_link", "beam", BEAM_ON_BASE), "base_link: stands still and takes no beam"),
    "spring": (("counterbalance", "stiffness", 0.0), "Counterbalance: stiffness must be positive, got 0.0"),
    "preload": (("counterbalance", "preload", 1e5), "counterbalance: preload must be below stiffness times"),
    "damper": (("counterbalance", "damping", -1.0), "damping must not be negative, got -1"),
    "loses": ((*BEAM, "retardation_time", -1e-3), "link 2: beam: retardation_time must not be negative"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "message"), REFUSED.values(), ids=REFUSED)
def test_an_impossible_structure_is_refused_in_one_line(tmp_path: Path, change: tuple, message: str):
    path = edited(tmp_path, *change)
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    text = str(refused.value)
    assert text.startswith(f"robot file {path}")
    assert message in text
    assert "\n" not in text


CALLS: dict[str, Callable[[], Any]] = {
    "payload": lambda: add_robot(MultibodyPlant(0.0), load_robot("kr210"), "structure", 211.0),
    "elasticity": lambda: add_robot(MultibodyPlant(0.0), load_robot("kr210"), "structural"),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_wrong_call_is_refused(call: Callable[[], Any]):
    with pytest.raises(
        ValueError, match=r"between 0 and 210.* got 211|rigid, joints, structure, got 'structural'"
    ):
        call()
