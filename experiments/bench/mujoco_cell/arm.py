"""An elastic six-axis robot as a MuJoCo model, from nothing of ours but the numbers of its file."""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from robots.description.counterbalance_spring import free_length
from robots.description.model import Link, Placement, RobotModel

STEP = 2.5e-4  # s, of the physics
JOINTS = range(1, 7)
_FRAMES = 8  # base, six joints, tool


@dataclass(frozen=True)
class Wrong:
    """By how much a true robot differs from its file; bounds of uniform draws."""

    translation: float = 6e-3  # m, of each frame, along each axis
    rotation: float = np.deg2rad(0.9)  # rad, of each frame, about each axis
    springs: float = 0.2  # share of gears and bearings
    friction: float = 0.2  # share of viscous and Coulomb friction
    payload_centre: float = 5.8e-3  # m, along each axis
    bending: float = 0.0  # of upper arm and forearm, over what their bearings yield: no belief knows of it
    # s, in which friction that holds brakes a motor: the shorter the harder it sticks, no less than two steps
    friction_time: float = 2e-3


@dataclass(frozen=True)
class Arm:
    """A MuJoCo model and where its parts are."""

    model: mujoco.MjModel
    motors: np.ndarray = field(init=False)  # degrees of freedom of the six motors
    sprung: np.ndarray = field(init=False)  # of gears, bearings and links that bend

    def __post_init__(self) -> None:
        model = self.model
        names = [model.joint(k).name for k in range(model.njnt)]
        motors = np.array([k for k, name in enumerate(names) if name.startswith("motor")])
        sprung = np.array([k for k, name in enumerate(names) if not name.startswith("motor")], dtype=int)
        object.__setattr__(self, "motors", motors)
        object.__setattr__(self, "sprung", sprung)

    def data_at_rest(self, theta: np.ndarray) -> mujoco.MjData:
        """Motors at theta (rad, (6,)), springs where gravity holds them, nothing moves."""
        data = mujoco.MjData(self.model)
        data.qpos[self.motors] = theta
        for _ in range(10):
            mujoco.mj_forward(self.model, data)
            left = data.qfrc_passive[self.sprung] - data.qfrc_bias[self.sprung]
            data.qpos[self.sprung] += left / self.model.jnt_stiffness[self.sprung]
        mujoco.mj_forward(self.model, data)
        return data

    def holding(self, data: mujoco.MjData, theta: np.ndarray) -> np.ndarray:
        """The torques in N m, (6,), that hold a rigid arm still at theta (rad, (6,)); data is overwritten."""
        data.qpos[self.motors] = theta
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        return (data.qfrc_bias - data.qfrc_passive)[self.motors]

    def tip(self, data: mujoco.MjData) -> np.ndarray:
        """The pose of the tool in the world, (4, 4)."""
        X, site = np.eye(4), data.site("tip")
        X[:3, :3], X[:3, 3] = site.xmat.reshape(3, 3), site.xpos
        return X


def true_arm(robot: RobotModel, payload: float, wrong: Wrong, seed: int) -> Arm:
    """A robot with everything wrong, elastic in gears and bearings.

    Args:
        robot: as it is drawn.
        payload: at the flange in kg.
        wrong: how far things are off.
        seed: of the draw.

    Raises:
        ValueError: if a link bends otherwise than in proportion to its load, which is not in the model.
    """
    if any(stiffening for link in robot.links if link.beam for stiffening in link.beam.stiffening):
        raise ValueError(f"{robot.name} has links that stiffen as they bend, which this model has not")
    rng = np.random.default_rng(seed)

    def off(bound: float, *shape: int) -> np.ndarray:
        return bound * rng.uniform(-1.0, 1.0, shape)

    shifts, turns = off(wrong.translation, _FRAMES, 3), off(wrong.rotation, _FRAMES, 3)
    springs, friction = 1.0 + off(wrong.springs, 6, 3), 1.0 + off(wrong.friction, 6, 2)
    return Arm(
        _model(
            robot,
            payload,
            robot.payload.center_of_mass + off(wrong.payload_centre, 3),
            shifts,
            turns,
            [_elastic(robot, k + 1, springs[k], friction[k], wrong.friction_time) for k in range(6)],
            wrong.bending,
        )
    )


def drawn_arm(robot: RobotModel, payload: float) -> Arm:
    """The rigid robot of the drawing, which a robot's controller knows."""
    joints = [
        f'<joint name="motor_{number}" axis="{_text(robot.axes[number - 1])}" '
        f'armature="{_text([robot.reflected_inertia[number - 1]])}"/>'
        for number in JOINTS
    ]
    zero = np.zeros((_FRAMES, 3))
    return Arm(_model(robot, payload, robot.payload.center_of_mass, zero, zero, joints, None))


def _elastic(
    robot: RobotModel, number: int, springs: np.ndarray, friction: np.ndarray, friction_time: float
) -> str:
    """Motor, gear and bearing of a joint, one behind the other between the same two links."""
    i = number - 1
    axis, joint = robot.axes[i], robot.joints[i]
    motor = (
        f'<joint name="motor_{number}" axis="{_text(axis)}" armature="{_text([robot.reflected_inertia[i]])}" '
        f'damping="{_text([friction[0] * robot.joint_viscous_friction[i]])}" '
        f'frictionloss="{_text([friction[1] * robot.joint_coulomb_friction[i]])}" '
        f'solreffriction="{friction_time} 1"/>'
    )
    gear = _spring(f"gear_{number}", axis, springs[0] * robot.joint_stiffness[i], robot.joint_damping[i])
    if joint.tilting is None:
        return motor + gear
    a, b = _across(axis)
    stiffness, damping = joint.tilting.stiffness, joint.tilting.damping
    tilts = (
        _spring(f"tilt_{number}_{k}", each, springs[1 + k] * stiffness[k], damping[k])
        for k, each in enumerate((a, b))
    )
    return motor + gear + "".join(tilts)


def _model(
    robot: RobotModel,
    payload: float,
    centre: np.ndarray,
    shifts: np.ndarray,
    turns: np.ndarray,
    joints: list[str],
    bending: float | None,
) -> mujoco.MjModel:
    """The model of frames that are off by shifts (8, 3) in m and turns (8, 3) in rad, with six joints.

    Args:
        bending: as of `Wrong`, beside the beams of the robot's file; None: links are rigid.
    """
    open_bodies, xml = 1, [f'<body name="base" {_frame(robot.base, shifts[0], turns[0])}>']
    for number, (joint, link, text) in enumerate(zip(robot.joints, robot.links, joints, strict=True), 1):
        xml.append(f'<body name="link_{number}" {_frame(joint.placement, shifts[number], turns[number])}>')
        xml += [text, _inertial(link), _pivot(robot, number)]
        open_bodies += 1
        place, hinges = _hinges(robot, number, bending)
        if hinges:  # all that follows hangs on them
            tiny = f'<inertial pos="{_text(place)}" mass="1e-3" diaginertia="1e-3 1e-3 1e-3"/>'
            xml.append(f'<body name="far_{number}">{hinges}{tiny}')
            open_bodies += 1
    if payload > 0.0:
        share = payload / robot.payload.largest_mass
        moments = _text(np.append(share * robot.payload.inertia, np.zeros(3)))
        inertial = f'<inertial pos="{_text(centre)}" mass="{_text([payload])}" fullinertia="{moments}"/>'
        xml.append(f'<body name="payload">{inertial}</body>')
    xml.append(f'<site name="tip" {_frame(robot.tool, shifts[7], turns[7])}/>')
    xml.append("</body>" * open_bodies)
    option = f'<compiler angle="radian"/><option timestep="{STEP}" integrator="implicitfast"/>'
    text = "".join(xml)
    name = quoteattr(robot.name)
    return mujoco.MjModel.from_xml_string(
        f"<mujoco model={name}>{option}<worldbody>{text}</worldbody>{_balancer(robot)}</mujoco>"
    )


def _hinges(robot: RobotModel, number: int, bending: float | None) -> tuple[np.ndarray, str]:
    """Where a link bends, in its frame, and on which sprung hinges; none if it does not."""
    joint, beam = robot.joints[number - 1], robot.links[number - 1].beam
    if bending is None:
        return np.zeros(3), ""
    if beam is not None:
        # Under a force at its end a cantilever bends by F L^3 / (3 EI) and turns by F L^2 / (2 EI).
        u = "xyz".index(beam.along)
        place = (beam.start + beam.length / 3.0) * np.eye(3)[u]
        springs = beam.stiffness * np.where(np.arange(3) == u, 1.0, 4.0 / 3.0) / beam.length
        axes, dampers = np.eye(3), beam.retardation_time * springs
    elif bending and number in (2, 3) and joint.tilting is not None:
        place = 0.5 * robot.joints[number].placement.translation
        axes = np.array(_across(place if place.any() else joint.axis))
        springs, dampers = np.asarray(joint.tilting.stiffness) / bending, joint.tilting.damping
    else:
        return np.zeros(3), ""
    parts = enumerate(zip(axes, springs, dampers, strict=True))
    return place, "".join(_spring(f"bend_{number}_{k}", *part, place) for k, part in parts)


def _pivot(robot: RobotModel, number: int) -> str:
    """Where the counterbalance takes hold of a link."""
    spring = robot.counterbalance
    if spring is None or number > 2:
        return ""
    place = spring.base_pivot if number == 1 else spring.arm_pivot
    return f'<site name="pivot_{number}" pos="{_text(place)}"/>'


def _balancer(robot: RobotModel) -> str:
    """The counterbalance, a spring between its two pivots."""
    spring, part = robot.counterbalance, robot.counterbalance_at_axis_2
    if spring is None or part is None:
        return ""
    length = free_length(part)
    return (
        f'<tendon><spatial stiffness="{_text([spring.stiffness])}" damping="{_text([spring.damping])}" '
        f'springlength="{_text([length])}"><site site="pivot_1"/><site site="pivot_2"/></spatial></tendon>'
    )


def _frame(placement: Placement, shift: np.ndarray, turn: np.ndarray) -> str:
    R = Rotation.from_euler("ZYX", placement.zyx_deg, degrees=True) * Rotation.from_rotvec(turn)
    quaternion = R.as_quat(scalar_first=True)
    return f'pos="{_text(placement.translation + shift)}" quat="{_text(quaternion)}"'


def _inertial(link: Link) -> str:
    moments = _text([*link.inertia, *link.products])  # xx yy zz xy xz yz
    pos = _text(link.center_of_mass)
    return f'<inertial pos="{pos}" mass="{_text([link.mass])}" fullinertia="{moments}"/>'


def _spring(
    name: str, axis: np.ndarray, stiffness: float, damping: float, place: Iterable[float] = (0.0, 0.0, 0.0)
) -> str:
    return (
        f'<joint name="{name}" axis="{_text(axis)}" pos="{_text(place)}" stiffness="{_text([stiffness])}" '
        f'damping="{_text([damping])}"/>'
    )


def _across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across an axis and each other."""
    unit = axis / np.linalg.norm(axis)
    a = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    a /= np.linalg.norm(a)
    return a, np.cross(unit, a)


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
