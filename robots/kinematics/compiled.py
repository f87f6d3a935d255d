"""The kinematics of a robot, compiled: for who needs one configuration in every tick."""

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics import kernels
from robots.kinematics.forward import Kinematics
from robots.kinematics.kinematics_codegen import z_to


class CompiledKinematics(Kinematics):
    """`Kinematics`; one configuration takes 1 us. To make it takes as long as numba takes to be imported."""

    def __init__(self, robot: RobotModel) -> None:
        """Takes the geometry of a robot."""
        super().__init__(robot)
        self._placements = _placements(robot)
        self.rows_and_jacobian(np.zeros(NUM_JOINTS))  # compiles, or reads what was compiled

    def rows_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first three rows of X_WE, (3, 4), and the geometric Jacobian, (6, 6), of q (6,) in rad."""
        X, J = np.empty((3, 4)), np.empty((6, NUM_JOINTS))
        kernels.pose_and_jacobian(q, self._placements, X, J)
        return X, J


def _placements(robot: RobotModel) -> np.ndarray:
    """Each joint in the one before, with z along its axis, then the tool in the last one, (7, 3, 4)."""
    found = [robot.base.pose().GetAsMatrix4()]
    for joint, axis in zip(robot.joints, robot.axes, strict=True):
        turn = np.eye(4)
        turn[:3, :3] = z_to(axis)
        found[-1] = found[-1] @ joint.placement.pose().GetAsMatrix4() @ turn
        found.append(turn.T)  # back to the axes of the link
    found[-1] = found[-1] @ robot.tool.pose().GetAsMatrix4()
    return np.ascontiguousarray(np.array(found)[:, :3])
