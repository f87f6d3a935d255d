"""The inverse dynamics of a rigid arm as an expression that casadi differentiates, by Newton and Euler.

Bodies, joints and inertias are taken from Drake's plant, so that both are the same arm; only the recursion is
written again, because derivatives of a third order are needed and Drake gives first ones.
"""

import casadi as ca
import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from robots.description.model import NUM_JOINTS, RobotModel
from robots.drivetrain.counterbalance import Counterbalance
from robots.dynamics.plant import add_robot


class ArmExpression:
    """A robot with its payload; ``load`` is what the gears carry."""

    def __init__(self, robot: RobotModel, payload: float) -> None:
        """Reads the plant.

        Args:
            robot: the robot as the planner knows it.
            payload: mass at the flange in kg.

        Raises:
            ValueError: if the robot may not carry it.
        """
        plant = MultibodyPlant(0.0)
        parts = add_robot(plant, robot, "rigid", payload)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        self._counterbalance: Counterbalance | None = robot.counterbalance_at_axis_2
        self._gravity = robot.base.pose().rotation().matrix().T @ plant.gravity_field().gravity_vector()
        self._axes = robot.axes
        self._placements, self._bodies = [], []
        for joint in parts.motors:
            before = joint.frame_on_parent().GetFixedPoseInBodyFrame()
            self._placements.append((before.rotation().matrix(), before.translation()))
            inertia = joint.child_body().CalcSpatialInertiaInBodyFrame(context)
            about_origin = inertia.CalcRotationalInertia().CopyToFullMatrix3()
            centre = inertia.get_com()
            shift = inertia.get_mass() * (centre @ centre * np.eye(3) - np.outer(centre, centre))
            self._bodies.append((inertia.get_mass(), centre, about_origin - shift))

    def load(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """Torques of the gears in N m, (6, 1), of positions, speeds and accelerations of the joints.

        Rotors and friction of the motors are not in it.
        """
        w, dw, acceleration = ca.SX.zeros(3), ca.SX.zeros(3), ca.SX(-self._gravity)
        rotations, forces, moments = [], [], []
        for i, ((R_PJ, p), (mass, centre, inertia)) in enumerate(
            zip(self._placements, self._bodies, strict=True)
        ):
            axis = ca.DM(self._axes[i])
            R = ca.mtimes(ca.DM(R_PJ), _turn(self._axes[i], q[i]))
            acceleration = R.T @ (acceleration + ca.cross(dw, p) + ca.cross(w, ca.cross(w, p)))
            w_before = R.T @ w
            w = w_before + axis * v[i]
            dw = R.T @ dw + axis * a[i] + ca.cross(w_before, axis * v[i])
            of_centre = acceleration + ca.cross(dw, centre) + ca.cross(w, ca.cross(w, centre))
            rotations.append(R)
            forces.append(mass * of_centre)
            moments.append(ca.DM(inertia) @ dw + ca.cross(w, ca.DM(inertia) @ w))
        force, moment, loads = ca.SX.zeros(3), ca.SX.zeros(3), [ca.SX(0.0)] * NUM_JOINTS
        for i in reversed(range(NUM_JOINTS)):
            own = forces[i]
            if i + 1 < NUM_JOINTS:
                arm = rotations[i + 1] @ force
                moment = rotations[i + 1] @ moment + ca.cross(self._placements[i + 1][1], arm)
                force = arm + own
            else:
                force = own
            moment = moment + moments[i] + ca.cross(self._bodies[i][1], own)
            loads[i] = ca.dot(ca.DM(self._axes[i]), moment)
        if self._counterbalance is not None:
            loads[1] = loads[1] - _pull(self._counterbalance, q[1], v[1])
        return ca.vertcat(*loads)


def _turn(axis: np.ndarray, angle: ca.SX) -> ca.SX:
    skew = np.cross(np.eye(3), axis)
    return ca.DM.eye(3) + ca.sin(angle) * ca.DM(skew) + (1.0 - ca.cos(angle)) * ca.DM(skew @ skew)


def _pull(spring: Counterbalance, q: ca.SX, velocity: ca.SX) -> ca.SX:
    """`Counterbalance.torque` as an expression."""
    angle, a, b = q - np.deg2rad(spring.dead_centre_deg), spring.base_radius, spring.arm_radius
    length = ca.sqrt(a * a + b * b - 2.0 * a * b * ca.cos(angle) + spring.lateral**2)
    lever = a * b * ca.sin(angle) / length
    pull = spring.preload + spring.stiffness * (length - spring.shortest)
    return -(pull + spring.damping * lever * velocity) * lever
