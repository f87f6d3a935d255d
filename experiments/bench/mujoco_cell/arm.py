"""An elastic six-axis robot as a MuJoCo model, from nothing of ours but the numbers of its file."""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

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
            data.qpos[self.sprung] = -data.qfrc_bias[self.sprung] / self.model.jnt_stiffness[self.sprung]
        mujoco.mj_forward(self.model, data)
        return data

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
        ValueError: if the robot has what is not in the model: a counterbalance, or links that are beams.
    """
    if robot.counterbalance or any(link.beam for link in robot.links):
        raise ValueError(f"{robot.name} has a counterbalance or links that bend, which this model has not")
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
    return Arm(_model(robot, payload, robot.payload.center_of_mass, zero, zero, joints, 0.0))


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
    bending: float,
) -> mujoco.MjModel:
    """The model of frames that are off by shifts (8, 3) in m and turns (8, 3) in rad, with six joints."""
    open_bodies, xml = 1, [f'<body name="base" {_frame(robot.base, shifts[0], turns[0])}>']
    for number, (joint, link, text) in enumerate(zip(robot.joints, robot.links, joints, strict=True), 1):
        xml.append(f'<body name="link_{number}" {_frame(joint.placement, shifts[number], turns[number])}>')
        xml += [text, _inertial(link)]
        open_bodies += 1
        if bending and number in (2, 3) and joint.tilting is not None:
            # All that follows hangs on two hinges in the middle of the link.
            middle = 0.5 * robot.joints[number].placement.translation
            springs = np.asarray(joint.tilting.stiffness) / bending, joint.tilting.damping
            across = _across(middle if middle.any() else joint.axis)
            hinges = (
                _spring(f"bend_{number}_{k}", axis, stiffness, damping, middle)
                for k, (axis, stiffness, damping) in enumerate(zip(across, *springs, strict=True))
            )
            tiny = f'<inertial pos="{_text(middle)}" mass="1e-3" diaginertia="1e-3 1e-3 1e-3"/>'
            xml.append(f'<body name="far_{number}">{"".join(hinges)}{tiny}')
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
        f"<mujoco model={name}>{option}<worldbody>{text}</worldbody></mujoco>"
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
