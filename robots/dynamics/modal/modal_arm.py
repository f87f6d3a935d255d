"""An arm in a vertical plane whose links bend as fields: modes in moving frames, one joint behind the other.

Reiner (2010), section 2.4.2 and eqs. (3.72), (3.73), for bodies along x that bend across it. Drake's
continuous MultibodyPlant has no such body, so the equations stand here, in casadi. What is of second order in
the deformation (the end of a bent beam is nearer) is left out, so rates are to be far below the first mode.
Gravity acts against y.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from robots.dynamics.modal.arm_equations import (
    GRAVITY,
    NOMINAL,
    ArmEquations,
    Motion,
    Terms,
    motion_symbols,
)
from robots.dynamics.modal.flexible_body import FlexibleBody
from robots.dynamics.modal.modal_beam import ModalBeam


@dataclass(frozen=True)
class ModalLink:
    """What the equations need of a body with n modes, and a point mass at its end.

    Attributes:
        length: from the joint to the end in m.
        mass: in kg, without the load.
        first_moment: mass times the centre's distance from the joint in kg m.
        inertia: about the joint in kg m^2.
        Ct, Cr: of the modes in kg and kg m, shape (n,).
        Me, Ke, De: mass, stiffness and damping of the modes, shape (n, n).
        root_turn: how far the modes turn the body's start in rad, shape (n,); zero for clamped ones.
        end_shift, end_turn: how far they move (m) and turn (rad) its end, shape (n,).
        load: in kg.
    """

    length: float
    mass: float
    first_moment: float
    inertia: float
    Ct: np.ndarray
    Cr: np.ndarray
    Me: np.ndarray
    Ke: np.ndarray
    De: np.ndarray
    root_turn: np.ndarray
    end_shift: np.ndarray
    end_turn: np.ndarray
    load: float = 0.0

    @property
    def rigid(self) -> "ModalLink":
        """The same without modes."""
        none, empty = np.zeros(0), np.zeros((0, 0))
        own = self.length, self.mass, self.first_moment, self.inertia
        return ModalLink(*own, none, none, empty, empty, empty, none, none, none, self.load)


def beam_link(beam: ModalBeam, damping: float = 0.0) -> ModalLink:
    """The link that a uniform beam is; each mode damped by a share of the critical."""
    nodes, weights = np.polynomial.legendre.leggauss(96)
    rows = beam.displacement(0.5 * (nodes + 1.0))
    dm = 0.5 * beam.mass * weights[:, None]
    Me, Ke = (dm * rows).T @ rows, beam.stiffness_matrix()[1:, 1:]
    first = float((dm[:, 0] * rows[:, 0]).sum())
    De = np.diag(2.0 * damping * np.sqrt(np.diag(Ke) * np.diag(Me)[1:]))
    return ModalLink(
        beam.length,
        beam.mass,
        first,
        float(Me[0, 0]),
        (dm * rows).sum(axis=0)[1:],
        Me[0, 1:],
        Me[1:, 1:],
        Ke,
        De,
        beam.input_column()[1:, 0],
        beam.displacement(1.0)[1:],
        beam.slope(1.0),
        beam.load,
    )


def body_link(body: FlexibleBody, load: float = 0.0) -> ModalLink:
    """The link that a body of standard input data is, its last node the end.

    Raises:
        ValueError: if its nodes are not along x, it does not say how far the modes turn them, or its modes
            move the end along x or out of the plane.
    """
    if body.turns is None:
        raise ValueError("modal arm: the body does not say how far its modes turn its nodes (psi)")
    length = float(body.places[-1, 0])
    others = np.abs(body.shapes[:, [0, 2]]).max() > 1e-9 * np.abs(body.shapes).max()
    if others or not length > 0.0 or np.abs(body.places[:, 1:]).max() > 1e-9 * length:
        raise ValueError("modal arm: a body must be along x and bend along y, got one that does not")
    return ModalLink(
        length,
        body.mass,
        float(body.first_moment[0]),
        float(body.inertia[2, 2]),
        body.Ct[:, 1],
        body.Cr[:, 2],
        body.Me,
        body.Ke,
        body.De,
        body.turns[0, 2],
        body.shapes[-1, 1],
        body.turns[-1, 2],
        load,
    )


class ModalArm(ArmEquations):
    """An arm in a plane; x has each joint's angle (rad), then its link's modes.

    The angle is that of the link's frame against the end of the link before it; of the first, against x.
    """

    def __init__(self, links: Sequence[ModalLink], terms: Terms = NOMINAL, gravity: float = GRAVITY) -> None:
        """Derives the equations.

        Raises:
            ValueError: if there is no link.
        """
        if not links:
            raise ValueError("modal arm: needs at least one link")
        sizes = [1 + len(link.Ct) for link in links]
        starts = np.cumsum([0, *sizes[:-1]])
        motion = motion_symbols(sum(sizes))
        x = motion.x
        p, angle, energy = ca.SX.zeros(2), ca.SX(0), ca.SX(0)
        forces, root_turns = ca.SX.zeros(x.numel()), np.zeros((x.numel(), len(links)))
        for number, (link, start, size) in enumerate(zip(links, starts, sizes, strict=True)):
            own = slice(int(start) + 1, int(start) + size)
            root_turns[own, number] = link.root_turn
            angle = angle + x[int(start)]
            added, held = _body(link, terms, motion, own, (p, angle), gravity)
            forces, energy = forces + added, energy + held
            e1, e2 = _axes(angle)
            p = p + link.length * e1 + ca.dot(ca.DM(link.end_shift), x[own]) * e2
            added, held = _point(link.load, motion, p, gravity)
            forces, energy = forces + added, energy + held
            angle = angle + ca.dot(ca.DM(link.end_turn), x[own])
        super().__init__(motion, forces, energy, p, starts, root_turns)


def _axes(angle: ca.SX) -> tuple[ca.SX, ca.SX]:
    return ca.vertcat(ca.cos(angle), ca.sin(angle)), ca.vertcat(-ca.sin(angle), ca.cos(angle))


def _point(mass: float, motion: Motion, p: ca.SX, gravity: float) -> tuple[ca.SX, ca.SX]:
    """Generalised inertia force and weight of a point mass, and its energy."""
    rate = motion.rate(p)
    lifted = motion.rate(rate) + ca.vertcat(0.0, gravity)
    energy = mass * (0.5 * ca.dot(rate, rate) + gravity * p[1])
    return mass * ca.jacobian(p, motion.x).T @ lifted, energy


def _body(
    link: ModalLink,
    terms: Terms,
    motion: Motion,
    own: slice,
    frame: tuple[ca.SX, ca.SX],
    gravity: float,
) -> tuple[ca.SX, ca.SX]:
    """Generalised forces of a body, (3.72) in the plane, and its energy."""
    (x, v, a), (p, angle) = motion, frame
    q, dq, ddq = x[own], v[own], a[own]
    e1, e2 = _axes(angle)
    v0, w = motion.rate(p), motion.rate(angle)
    a0, alpha = motion.rate(v0), motion.rate(w)
    weight = ca.vertcat(0.0, gravity)
    lifted = a0 + weight
    Ct, Cr, Me, Ke, De = (ca.DM(each) for each in (link.Ct, link.Cr, link.Me, link.Ke, link.De))
    across = ca.dot(Ct, q) * terms.bent_inertia
    spread = ca.dot(q, Me @ q) * terms.bent_inertia
    S = link.first_moment
    force = link.mass * lifted + alpha * (S * e2 - across * e1) - w**2 * (S * e1 + across * e2)
    moment = S * ca.dot(lifted, e2) - across * ca.dot(lifted, e1) + alpha * (link.inertia + spread)
    modal = Me @ ddq + Ke @ q + De @ dq
    if terms.coupling:
        force += ca.dot(Ct, ddq) * e2 - 2.0 * w * ca.dot(Ct, dq) * e1
        moment += ca.dot(Cr, ddq)
        modal += Ct * ca.dot(a0, e2) + Cr * alpha
    if terms.modal_weight:
        modal += Ct * ca.dot(weight, e2)
    if terms.gyroscopic:
        moment += 2.0 * w * ca.dot(q, Me @ dq)
        modal -= w**2 * (Me @ q)
    forces = ca.jacobian(p, x).T @ force + ca.jacobian(angle, x).T * moment
    forces[own] += modal
    bent = ca.dot(Ct, q)
    moving = w * ca.dot(v0, S * e2 - bent * e1) + ca.dot(Ct, dq) * ca.dot(v0, e2)
    turning = 0.5 * w**2 * (link.inertia + ca.dot(q, Me @ q)) + w * ca.dot(Cr, dq)
    held = gravity * (link.mass * p[1] + S * e1[1] + bent * e2[1]) + 0.5 * ca.dot(q, Ke @ q)
    energy = 0.5 * link.mass * ca.dot(v0, v0) + moving + turning + 0.5 * ca.dot(dq, Me @ dq) + held
    return forces, energy
