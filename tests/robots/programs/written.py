"""Programs as a programming system writes them from joint positions, and a robot that is not as drawn."""

import numpy as np
from scipy.spatial.transform import Rotation

from robots.description.error_parameters import error_parameters
from robots.description.model import RobotModel
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics

WOBJ = np.eye(4)
WOBJ[:3, :3] = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
WOBJ[:3, 3] = [0.3, -0.1, 0.05]
_EXTERNAL = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def with_random_errors(robot: RobotModel, seed: int) -> RobotModel:
    """The robot with 48 errors of up to 6 mm and 0.9 degrees."""
    sizes = [6e-3 if parameter.unit == "m" else np.deg2rad(0.9) for parameter in error_parameters(robot)]
    p = np.array(sizes) * np.random.default_rng(seed).uniform(-1.0, 1.0, len(sizes))
    return ErrorKinematics(robot).robot_with_errors(p)


def configurations(count: int, seed: int) -> np.ndarray:
    """Of an IRB 1200, away from stretched arms and wrists and from axis 1, (count, 6) in rad."""
    rng = np.random.default_rng(seed)
    q = np.deg2rad(rng.uniform([-160, -10, -40, -170, 20, -300], [160, 60, 30, 170, 110, 300], (count, 6)))
    q[:, 4] *= rng.choice([-1.0, 1.0], count)
    return q


def flange(robot: RobotModel, q: np.ndarray, length: float = 0.0) -> np.ndarray:
    """tool0 in the world at joint positions (..., 6): at zero angles z looks ahead and x down, (..., 4, 4).

    With a length in m it is a tool that stands so far ahead.
    """
    kinematics = Kinematics(robot)
    X, X_zero = kinematics.forward(q), kinematics.forward(np.zeros(6))
    ahead = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    X[..., :3, :3] = X[..., :3, :3] @ X_zero[:3, :3].T @ ahead
    X[..., :3, 3] += length * X[..., :3, 2]
    return X


def rapid_pose(X: np.ndarray) -> str:
    """A pose as RAPID writes it, in mm and as a quaternion."""
    quaternion = Rotation.from_matrix(X[:3, :3]).as_quat(scalar_first=True)
    return f"[{_numbers(1e3 * X[:3, 3])}],[{_numbers(quaternion)}]"


def rapid_module(robot: RobotModel, q: np.ndarray, length: float = 0.0) -> str:
    """A module that moves the flange, or a tool of that length in m, through configurations (n, 6)."""
    lines = ["MODULE m", f'PERS wobjdata w:=[FALSE,TRUE,"",[{rapid_pose(WOBJ)}],[[0,0,0],[1,0,0,0]]];']
    for number, (each, X) in enumerate(zip(q, flange(robot, q, length), strict=True)):
        pose = rapid_pose(np.linalg.inv(WOBJ) @ X)
        cf1, cf4, cf6 = np.floor(np.rad2deg(each[[0, 3, 5]]) / 90.0).astype(int).tolist()
        lines.append(f"CONST robtarget p{number}:=[{pose},[{cf1},{cf4},{cf6},0],{_EXTERNAL}]; ! {number}")
    moves = [f"    MoveL p{number},v100,z10,tool0\\WObj:=w;" for number in range(len(q))]
    return "\r\n".join([*lines, "  PROC main()", *moves, "  ENDPROC", "ENDMODULE", ""])


def krl_list(robot: RobotModel, q: np.ndarray) -> str:
    """A data list of taught positions with status and turn."""
    lines = ["DEFDAT m"]
    for number, (each, X) in enumerate(zip(q, flange(robot, q), strict=True)):
        zyx = Rotation.from_matrix(X[:3, :3]).as_euler("ZYX", degrees=True)
        turn = sum(1 << joint for joint in range(6) if each[joint] < 0.0)
        pairs = zip("XYZABC", [*(1e3 * X[:3, 3]), *zyx], strict=True)
        pose = ",".join(f"{key} {value:.12g}" for key, value in pairs)
        lines.append(f"DECL E6POS XP{number}={{{pose},S {2 + 4 * (each[4] < 0)},T {turn},E1 0.0}}")
        lines.append(f"DECL FDAT FP{number}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}}")
    return "\n".join([*lines, "ENDDAT"])


def _numbers(values) -> str:
    return ",".join(f"{value:.12g}" for value in values)
