"""Two beams, one turned at the end of the other, and an inverse with one mode each and outputs at 0.9.

Reiner (2010), section 3.5.1, figures 3.6 and 3.7: beams that are supported at their joints, a load at the end
of each, in the field of gravity. No controller: what the plant, with three modes each, makes of the torques.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from experiments.zeros.end_path import EndPath
from experiments.zeros.runge_kutta import march
from robots.dynamics.modal.modal_arm import ModalArm, beam_link
from robots.dynamics.modal.modal_beam import ModalBeam
from robots.dynamics.transmission_zeros import Zeros, transmission_zeros

STEP = 5e-4  # s
TIMES = STEP * np.arange(3001)
PATH = EndPath((1.0, 0.2), (1.4, 0.6), start=0.3, duration=0.8)  # of the load at the end
OUTPUT = 0.9  # where on each beam the output of the inverse is
DAMPING, INVERSE_DAMPING = 0.01, 0.05  # of the modes, relative to the critical one; larger as in (3.73)
_LOAD = 0.45  # of the beam's mass


@dataclass(frozen=True)
class TwoBeamRun:
    """What came out; n times, the torques at the middles between them, too."""

    path: np.ndarray  # (n, 2) m, where the end shall be
    reached: np.ndarray  # (n, 2) m
    torques: np.ndarray  # (2 n - 1, 2) N m

    @property
    def deviation(self) -> np.ndarray:
        """Of the end from its path in m, shape (n,)."""
        return np.linalg.norm(self.reached - self.path, axis=1)


def beam(modes: int) -> ModalBeam:
    """One of the two."""
    return ModalBeam(1.0, 3.0, 4000.0, 3.0 * _LOAD, modes, "supported")


def two_beam_arm(modes: int, damping: float) -> ModalArm:
    """Both with so many modes; none makes them rigid."""
    link = beam_link(beam(max(modes, 1)), damping)
    return ModalArm([link if modes else link.rigid] * 2)


def output_zeros(modes: int, xi: float) -> Zeros:
    """From the torques to the outputs at xi of both beams, about the stretched arm without gravity."""
    one = beam(modes)
    arm = ModalArm([beam_link(one)] * 2, gravity=0.0)
    M = np.asarray(arm.mass(np.zeros(arm.size)))
    K = np.kron(np.eye(2), one.stiffness_matrix())
    outputs = np.kron(np.eye(2), one.displacement(xi)[None])
    return transmission_zeros(M, np.zeros_like(M), K, arm.B, outputs)


def run(inverse_modes: int, xi: float = OUTPUT) -> TwoBeamRun:
    """Torques of an inverse with so many modes (0: rigid, 1 as in figure 3.7) on the plant with three."""
    angles = PATH.angles(0.25 * STEP * np.arange(4 * len(TIMES) - 3))
    model, plant = two_beam_arm(inverse_modes, INVERSE_DAMPING), two_beam_arm(3, DAMPING)
    torques, first = _inverse(model, inverse_modes, angles, xi)
    begin = plant.at_rest(first)
    x, v, tau = ca.SX.sym("x", plant.size), ca.SX.sym("v", plant.size), ca.SX.sym("tau", 2)
    acceleration = ca.solve(plant.mass(x), ca.DM(plant.B) @ tau - plant.bias(x, v))
    rates = ca.Function("rates", [ca.vertcat(x, v), tau], [ca.vertcat(v, acceleration)], {"cse": True})
    states = march(rates, np.concatenate([begin, np.zeros(plant.size)]), torques, STEP)
    reached = plant.end.map(len(states))(*(part.T for part in np.split(states, 2, axis=1)))[0]
    return TwoBeamRun(PATH.at(TIMES)[0], np.asarray(reached).T, torques)


def _inverse(model: ModalArm, modes: int, angles: np.ndarray, xi: float) -> tuple[np.ndarray, np.ndarray]:
    """Torques at times and middles, and the joints' angles at the start.

    Args:
        angles: wanted ones with their derivatives, at quarters of steps.
    """
    joints = np.eye(model.size)[:, model.joints]
    every_second = angles[::2]
    if not modes:
        return model.torques(*np.split(every_second, 3, axis=1)), angles[0, :2]
    output = beam(modes).displacement(xi)
    # The frame turns back by what the modes move the output, so that the output is where it shall be.
    S = np.eye(model.size)[:, model.modes] - joints @ np.kron(np.eye(2), output[1:][None] / output[0])
    q, dq, wanted = ca.SX.sym("q", 2 * modes), ca.SX.sym("dq", 2 * modes), ca.SX.sym("wanted", 6)
    angle, rate, acceleration = ca.vertsplit(wanted, 2)
    place, S = ca.DM(joints), ca.DM(S)
    x, v = place @ angle + S @ q, place @ rate + S @ dq
    M, h, free = model.mass(x), model.bias(x, v), ca.DM(model.held).T
    ddq = ca.solve(free @ M @ S, -free @ (M @ (place @ acceleration) + h))
    torque = place.T @ (M @ (place @ acceleration + S @ ddq) + h)
    rates = ca.Function("rates", [ca.vertcat(q, dq), wanted], [ca.vertcat(dq, ddq)], {"cse": True})
    torques = ca.Function("torques", [ca.vertcat(q, dq), wanted], [torque], {"cse": True})
    begin = _at_rest(rates, angles[0], modes)
    states = march(rates, begin, angles, 0.5 * STEP)  # the plant asks for torques at the middles, too
    found = np.asarray(torques.map(len(states))(states.T, every_second.T)).T
    turn = beam_link(beam(modes)).root_turn
    start = angles[0, :2] - begin[: 2 * modes].reshape(2, modes) @ (output[1:] / output[0] - turn)
    return found, start


def _at_rest(rates: ca.Function, wanted: np.ndarray, modes: int) -> np.ndarray:
    """The deflection of the inverse that does not move."""
    n = 2 * modes
    q, still = ca.SX.sym("q", n), ca.DM.zeros(n)
    pull = rates(ca.vertcat(q, still), wanted)[n:]
    step = ca.Function("step", [q], [q - ca.solve(ca.jacobian(pull, q), pull)])
    found = ca.DM.zeros(n)
    for _ in range(8):
        found = step(found)
    return np.concatenate([np.asarray(found)[:, 0], np.zeros(n)])
