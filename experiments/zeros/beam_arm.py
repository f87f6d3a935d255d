"""An arm of two bodies that bend behind elastic gears: three inverse models of it, and what may be left out.

As the example of Reiner (2010), section 3.7, figures 3.19 and 3.20, in a plane: the first body is one of
standard input data, the second a beam with a load. The motors have a controller, the same for all inverses.
"""

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.linalg import eig

from experiments.zeros.end_path import EndPath
from experiments.zeros.runge_kutta import march
from robots.dynamics.modal.arm_equations import VARIANTS, Terms
from robots.dynamics.modal.flexible_body import beam_body
from robots.dynamics.modal.modal_arm import ModalArm, ModalLink, beam_link, body_link
from robots.dynamics.modal.modal_beam import ModalBeam
from systems.feedforward.sprung_deflection import SprungDeflection

STEP = 1e-4  # s; the fastest pole of the plant is at some 1e4 1/s
TIMES = STEP * np.arange(9001)
PATH = EndPath((1.0, 0.3), (1.4, 0.7), start=0.1, duration=0.5)  # of the load
CONFIGURATIONS = ("gears and structure", "gears", "rigid")  # 1, 2 and 3 of figure 3.20
MOTOR, FRICTION = np.array([8.0, 3.0]), np.array([40.0, 20.0])  # kg m^2, N m s / rad, behind the gear
GEAR, GEAR_DAMPING = np.array([6e4, 2.5e4]), np.array([60.0, 25.0])  # N m / rad, N m s / rad
GAINS = np.array([4e4, 1.5e4]), np.array([1.2e3, 450.0])  # N m / rad, N m s / rad
DAMPING, INVERSE_DAMPING = 0.02, 0.1  # of the modes, relative to the critical one; D_e* of (3.73)
_NEWTON_STEPS = 4


@dataclass(frozen=True)
class Commands:
    """What an inverse tells the motors at times and middles, shape (2 n - 1, 2) each."""

    angle: np.ndarray  # rad
    rate: np.ndarray  # rad/s
    torque: np.ndarray  # N m


def links(damping: float, modes: tuple[int, int]) -> list[ModalLink]:
    """Lever and beam with so many modes each; 0 for rigid."""
    lever = body_link(beam_body(1.0, 30.0, 1.5e5, 12, max(modes[0], 1), damping))
    beam = beam_link(ModalBeam(1.0, 6.0, 2e4, 5.0, max(modes[1], 1)), damping)
    return [link if count else link.rigid for link, count in zip((lever, beam), modes, strict=True)]


def deviation(told: Commands) -> np.ndarray:
    """How far the load is from its path in m at `TIMES`, with the plant that has all modes."""
    plant = ModalArm(links(DAMPING, (3, 3)))
    x, v, theta, omega = (
        ca.SX.sym(n, size) for n, size in zip("xvto", (plant.size,) * 2 + (2, 2), strict=True)
    )
    wanted = ca.SX.sym("wanted", 6)
    angle, rate, torque = ca.vertsplit(wanted, 2)
    B = ca.DM(plant.B)
    gear = GEAR * (theta - B.T @ x) + GEAR_DAMPING * (omega - B.T @ v)
    motor = torque + GAINS[0] * (angle - theta) + GAINS[1] * (rate - omega)
    turning = (motor - gear - FRICTION * omega) / MOTOR
    moving = ca.solve(plant.mass(x), B @ gear - plant.bias(x, v))
    state = ca.vertcat(theta, omega, x, v)
    rates = ca.Function("rates", [state, wanted], [ca.vertcat(omega, turning, v, moving)], {"cse": True})
    begin = np.concatenate([_start(plant, told), np.zeros(plant.size)])
    inputs = np.hstack([told.angle, told.rate, told.torque])
    states = march(rates, begin, inputs, STEP)
    x_and_v = np.split(states[:, 4:], 2, axis=1)
    reached = np.asarray(plant.end.map(len(states))(*(part.T for part in x_and_v))[0]).T
    return np.linalg.norm(reached - PATH.at(TIMES)[0], axis=1)


def _start(plant: ModalArm, told: Commands) -> np.ndarray:
    """Motors and arm at rest where the controller holds them under the first command; (4 + size,)."""
    theta = told.angle[0]
    angles = theta
    for _ in range(20):
        x = plant.at_rest(angles)
        load = np.asarray(plant.bias(x, np.zeros(plant.size)))[plant.joints, 0]
        theta = told.angle[0] + (told.torque[0] - load) / GAINS[0]
        angles = theta - load / GEAR
    return np.concatenate([theta, np.zeros(2), plant.at_rest(angles)])


def configuration(name: str, terms: Terms = VARIANTS["1"]) -> Commands:
    """The commands of one of `CONFIGURATIONS`; of the first with the terms of a variant.

    Raises:
        ValueError: if there is no such configuration.
    """
    if name not in CONFIGURATIONS:
        raise ValueError(f"configuration must be one of {', '.join(CONFIGURATIONS)}, got '{name}'")
    times = 0.5 * STEP * np.arange(2 * len(TIMES) - 1)
    if name == CONFIGURATIONS[0]:
        angle, rate, load = StructureInverse(terms).motion(times)
    else:
        rigid = ModalArm(links(DAMPING, (0, 0)))
        angle, rate, acceleration = np.split(PATH.angles(times), 3, axis=1)
        load = rigid.torques(angle, rate, acceleration)
    if name != CONFIGURATIONS[2]:
        gears = SprungDeflection(GEAR, GEAR_DAMPING, times[1])
        wound = [gears.at_rest(load[0])]
        for before, now in pairwise(load):
            wound.append(gears.step(wound[-1], before, now))
        angle = angle - np.array(wound)
        rate = np.gradient(angle, times, axis=0, edge_order=2)
    acceleration = np.gradient(rate, times, axis=0, edge_order=2)
    return Commands(angle, rate, MOTOR * acceleration + FRICTION * rate + load)


class StructureInverse:
    """The load is on its path; the modes follow from what acts on them, by the equations of a variant.

    Joints make up for what the modes move the load: J_theta theta'' = p'' - J_q q'' - dJ/dt x'. Put into the
    rows of the modes this leaves (M_qq - M_q,theta J_theta^-1 J_q) q'' = ..., whose eigenvalues tell whether
    it can be integrated.
    """

    def __init__(self, terms: Terms, modes: tuple[int, int] = (2, 1)) -> None:
        """Derives the equations of the inverse."""
        self._arm = arm = ModalArm(links(INVERSE_DAMPING, modes), terms)
        n = len(arm.modes)
        theta_row, q_row = np.eye(arm.size)[arm.joints], np.eye(arm.size)[arm.modes]
        state, wanted, near = ca.SX.sym("state", 2 * n), ca.SX.sym("wanted", 6), ca.SX.sym("near", 2)
        q, dq = ca.vertsplit(state, n)
        place, rate, acceleration = ca.vertsplit(wanted, 2)
        angles = near
        for _ in range(_NEWTON_STEPS):
            x = theta_row.T @ angles + q_row.T @ q
            p, J, _ = arm.end(x, ca.DM.zeros(arm.size))
            angles = angles + ca.solve(J @ theta_row.T, place - p)
        x = theta_row.T @ angles + q_row.T @ q
        J = arm.end(x, ca.DM.zeros(arm.size))[1]
        J_theta, J_q = J @ theta_row.T, J @ q_row.T
        turning = ca.solve(J_theta, rate - J_q @ dq)
        v = theta_row.T @ turning + q_row.T @ dq
        M, h, bent = arm.mass(x), arm.bias(x, v), arm.end(x, v)[2]
        per_theta = ca.solve(J_theta, ca.horzcat(J_q, acceleration - bent))
        M_theta, M_q = q_row @ M @ theta_row.T, q_row @ M @ q_row.T
        inertia = M_q - M_theta @ per_theta[:, :n]
        ddq = ca.solve(inertia, -q_row @ h - M_theta @ per_theta[:, n])
        whole = theta_row.T @ (per_theta[:, n] - per_theta[:, :n] @ ddq) + q_row.T @ ddq
        load = theta_row @ (M @ whole + h)
        inputs = ca.vertcat(wanted, near)
        self._rates = ca.Function("rates", [state, inputs], [ca.vertcat(dq, ddq)], {"cse": True})
        self._outputs = ca.Function("outputs", [state, inputs], [angles, turning, load], {"cse": True})
        self._inertia = ca.Function("inertia", [state, inputs], [inertia])
        self._pull = ca.Function(
            "pull", [state, inputs], [ca.jacobian(q_row @ h + M_theta @ per_theta[:, n], q)]
        )
        self.size = n

    def motion(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles of the joints, their rates and the load of the gears at evenly spaced times, (n, 2) each.

        Raises:
            ValueError: if the inverse is unstable where the path begins.
        """
        if self.fastest_growth() > 0.0:
            raise ValueError(
                f"this inverse is unstable: it grows by {self.fastest_growth():.0f} 1/s where the path begins"
            )
        step = times[1] - times[0]
        fine = times[0] + 0.5 * step * np.arange(2 * len(times) - 1)
        inputs = np.hstack([*PATH.at(fine), PATH.angles(fine)[:, :2]])
        states = march(self._rates, self._at_rest(inputs[0]), inputs, step)
        found = self._outputs.map(len(states))(states.T, inputs[::2].T)
        angle, rate, load = (np.asarray(each).T for each in found)
        return angle, rate, load

    def fastest_growth(self) -> float:
        """The largest real part in 1/s of what is free in the inverse at first, zero if nothing grows."""
        wanted = np.concatenate([*(part[0] for part in PATH.at(TIMES[:1])), PATH.angles(TIMES[:1])[0, :2]])
        state = self._at_rest(wanted)
        inertia, pull = (np.asarray(f(state, wanted)) for f in (self._inertia, self._pull))
        roots = np.sqrt(np.asarray(eig(-pull, inertia, right=False), dtype=complex))
        growing = np.abs(np.real(roots))
        # Of undamped pairs rounding leaves a real part.
        return float(np.max(np.where(growing > 1e-6 * np.abs(roots), growing, 0.0)))

    def _at_rest(self, inputs: np.ndarray) -> np.ndarray:
        state = np.zeros(2 * self.size)
        for _ in range(8):
            missing = (
                -np.asarray(self._inertia(state, inputs))
                @ np.asarray(self._rates(state, inputs))[self.size :, 0]
            )
            state[: self.size] -= np.linalg.solve(np.asarray(self._pull(state, inputs)), missing)
        return state
