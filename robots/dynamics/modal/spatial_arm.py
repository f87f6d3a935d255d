"""An arm in space whose links bend and twist as fields: modes in moving frames, one joint behind the other.

Reiner (2010), section 2.6 and eqs. (2.22), (3.72), by projection (2.30). Drake's continuous MultibodyPlant
has no such body, so the equations stand here, in casadi. What is of second order in the deformation (the end
of a bent beam is nearer) is left out, so rates are to be far below the first mode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
from robots.dynamics.modal.modal_body import ModalBody


@dataclass(frozen=True)
class SpatialLink:
    """A body behind a revolute joint, and what is fixed to its end.

    Attributes:
        body: in the frame that the joint turns.
        axis: of the joint in this frame; of any length.
        placement: the frame against the end of the link before it where the angle is zero, a rotation of
            shape (3, 3).
        load: a body without modes in the frame of the end.
    """

    body: ModalBody
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    placement: np.ndarray | None = None
    load: ModalBody | None = None


class _Frame(NamedTuple):
    """Where a frame is in the world, and how it moves, in its own axes."""

    R: ca.SX
    p: ca.SX
    velocity: ca.SX
    rate: ca.SX

    def moved(self, offset: ca.SX, turn: ca.SX, motion: Motion) -> "_Frame":
        """A frame at an offset in this one, turned by a rotation against it; both depend on x."""
        spin = turn.T @ _rate(turn, motion)
        carried = self.velocity + ca.cross(self.rate, offset) + motion.rate(offset)
        rate = turn.T @ self.rate + ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
        return _Frame(self.R @ turn, self.p + self.R @ offset, turn.T @ carried, rate)


class _Contribution(NamedTuple):
    """Of one body."""

    force: ca.SX  # N, that its motion takes, in its frame
    moment: ca.SX  # N m, about the origin of its frame
    generalised: ca.SX  # by the coordinates of the arm
    energy: ca.SX  # J
    linear: ca.SX  # momentum in N s in the world
    angular: ca.SX  # N m s about the origin of the world


class SpatialArm(ArmEquations):
    """An arm in space; x has each joint's angle (rad), then its link's modes.

    Attributes:
        momentum: of x and v, linear in N s and angular about the origin of the world in N m s.
        clamp: of x, v and x'', force (N) and moment (N m) on the last link at its joint, in its frame.
    """

    def __init__(
        self,
        links: Sequence[SpatialLink],
        terms: Terms = NOMINAL,
        gravity: Sequence[float] = (0.0, 0.0, -GRAVITY),
        tip: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Derives the equations.

        Args:
            links: from the base on.
            terms: that the bodies have.
            gravity: in m/s^2 in the world.
            tip: the end of the arm in the frame of the last link's end, in m.

        Raises:
            ValueError: if there is no link, an axis is zero or a placement no rotation, or a load has modes.
        """
        _check(links)
        sizes = [1 + len(link.body.Ct) for link in links]
        starts = np.cumsum([0, *sizes[:-1]])
        motion, none = motion_symbols(sum(sizes)), slice(0, 0)
        still = ca.SX.zeros(3)
        frame = _Frame(ca.SX.eye(3), still, still, still)
        found: list[_Contribution] = []
        weight = -ca.DM(list(gravity))
        clamp = [still, still]
        for link, start, size in zip(links, starts, sizes, strict=True):
            joint, own = int(start), slice(int(start) + 1, int(start) + size)
            placement = np.eye(3) if link.placement is None else link.placement
            frame = frame.moved(still, ca.SX(ca.DM(placement)) @ _about(link.axis, motion.x[joint]), motion)
            found.append(_body(link.body, terms, motion, own, frame, weight))
            clamp = [found[-1].force, found[-1].moment]
            offset, turn = _end(link.body, motion.x[own])
            frame = frame.moved(offset, turn, motion)
            if link.load is not None:
                found.append(_body(link.load, terms, motion, none, frame, weight))
                carried = turn @ found[-1].force
                clamp = [
                    clamp[0] + carried,
                    clamp[1] + turn @ found[-1].moment + ca.cross(offset, carried),
                ]
        super().__init__(
            motion,
            _sum([each.generalised for each in found]),
            _sum([each.energy for each in found]),
            frame.p + frame.R @ ca.DM(list(tip)),
            starts,
            np.zeros((sum(sizes), len(links))),
        )
        momentum = [_sum([each.linear for each in found]), _sum([each.angular for each in found])]
        self.momentum = ca.Function("momentum", motion[:2], momentum, {"cse": True})
        self.clamp = ca.Function("clamp", list(motion), clamp, {"cse": True})


def _check(links: Sequence[SpatialLink]) -> None:
    if not links:
        raise ValueError("spatial arm: needs at least one link")
    for number, link in enumerate(links, 1):
        if not np.linalg.norm(link.axis) > 0.0:
            raise ValueError(f"spatial arm: the axis of joint {number} is zero")
        R = link.placement
        if R is not None and not (np.allclose(R @ R.T, np.eye(3), atol=1e-9) and np.linalg.det(R) > 0.0):
            raise ValueError(f"spatial arm: the placement of link {number} is no rotation")
        if link.load is not None and len(link.load.Ct):
            raise ValueError(f"spatial arm: the load of link {number} must not have modes")


def _body(
    body: ModalBody, terms: Terms, motion: Motion, own: slice, frame: _Frame, weight: ca.DM
) -> _Contribution:
    """What (3.72) says of a body; with weight the acceleration that gravity is like."""
    q, dq, ddq = (part[own] for part in motion)
    v, w = frame.velocity, frame.rate
    acceleration, alpha = motion.rate(v) + ca.cross(w, v), motion.rate(w)
    lift = frame.R.T @ weight
    Ct, Me, Ke, De = (ca.sparsify(ca.DM(each)) for each in (body.Ct, body.Me, body.Ke, body.De))
    # Of r phi_k^T, r = c + u, by order in the deformation.
    zeroth = [ca.SX(ca.sparsify(ca.DM(each))) for each in body.moments]
    first = [_weighted(q, body.modal_moments[:, k]) for k in range(len(body.Ct))]
    whole = [a + b for a, b in zip(zeroth, first, strict=True)]
    S = ca.DM(body.first_moment) + Ct.T @ q
    spread = [q[k] * (P0 + P0.T + P1) for k, (P0, P1) in enumerate(zip(zeroth, first, strict=True))]
    J = _inertia(ca.DM(body.second_moment) + _sum(spread, 3))
    pushed, turned = Ct.T @ dq, _sum([dq[k] * P for k, P in enumerate(whole)], 3)
    energy = (
        0.5 * body.mass * ca.dot(v, v)
        + ca.dot(v, ca.cross(w, S) + pushed)
        + 0.5 * ca.dot(w, J @ w)
        + ca.dot(w, _axial(turned))
        + 0.5 * ca.dot(dq, Me @ dq)
        + body.mass * ca.dot(weight, frame.p)
        + ca.dot(lift, S)
        + 0.5 * ca.dot(q, Ke @ q)
    )
    linear = body.mass * v + ca.cross(w, S) + pushed
    angular = ca.cross(S, v) + J @ w + _axial(turned)
    if not terms.bent_inertia:
        S, J = ca.SX(ca.DM(body.first_moment)), ca.SX(ca.DM(body.inertia))
    lifted = acceleration + lift
    force = body.mass * lifted + ca.cross(alpha, S) + ca.cross(w, ca.cross(w, S))
    moment = ca.cross(S, lifted) + J @ alpha + ca.cross(w, J @ w)
    modal = Me @ ddq + Ke @ q + De @ dq
    turning = whole if terms.gyroscopic else zeroth
    modal += _stack([ca.dot(w, P @ w) - ca.dot(w, w) * ca.trace(P) for P in turning])  # O_e
    if terms.coupling:
        coupled = whole if terms.bent_coupling else zeroth
        force += Ct.T @ ddq + 2.0 * ca.cross(w, pushed)
        moment += _axial(_sum([ddq[k] * P for k, P in enumerate(coupled)], 3))
        modal += Ct @ acceleration + _stack([ca.dot(_axial(P), alpha) for P in coupled])
    if terms.modal_weight:
        modal += Ct @ lift
    if terms.gyroscopic:
        moment += 2.0 * (ca.trace(turned) * w - turned.T @ w)
        changing = [_weighted(dq, body.modal_moments[:, k]) for k in range(len(body.Ct))]
        modal += _stack([2.0 * ca.dot(w, _axial(P)) for P in changing])
    generalised = ca.jacobian(v, motion.v).T @ force + ca.jacobian(w, motion.v).T @ moment
    generalised[own] += modal
    linear, about_frame = frame.R @ linear, frame.R @ angular
    return _Contribution(force, moment, generalised, energy, linear, about_frame + ca.cross(frame.p, linear))


def _end(body: ModalBody, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Where the end of a bent body is in its frame, and how it is turned: about z, y and x in this order.

    To first order that is any order; so it is a rotation, and one in a plane turns by its angle.
    """
    offset = ca.DM(body.end) + ca.sparsify(ca.DM(body.end_shift)) @ q
    turns = ca.sparsify(ca.DM(body.end_turn)) @ q
    turn = ca.SX.eye(3)
    for axis in (2, 1, 0):
        turn = turn @ _about(np.eye(3)[axis], turns[axis])
    return ca.SX(offset), turn


def _about(axis: Sequence[float] | np.ndarray, angle: ca.SX) -> ca.SX:
    """The rotation about an axis, by Rodrigues."""
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    N = ca.sparsify(ca.DM(np.cross(np.eye(3), n)))
    return ca.SX.eye(3) + ca.sin(angle) * N + (1.0 - ca.cos(angle)) * (N @ N)


def _rate(turn: ca.SX, motion: Motion) -> ca.SX:
    return ca.reshape(motion.rate(ca.vec(turn)), 3, 3)


def _axial(P: ca.SX) -> ca.SX:
    """Of a matrix that is the integral of a b^T, that of a x b."""
    return ca.vertcat(P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0])


def _inertia(P: ca.SX) -> ca.SX:
    return ca.trace(P) * ca.SX.eye(3) - P


def _weighted(q: ca.SX, matrices: np.ndarray) -> ca.SX:
    return _sum([q[k] * ca.sparsify(ca.DM(each)) for k, each in enumerate(matrices)], 3)


def _stack(values: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*values) if values else ca.SX.zeros(0, 1)


def _sum(values: list[ca.SX], size: int = 0) -> ca.SX:
    """Of matrices; size x size if there is none."""
    total = values[0] if values else ca.SX.zeros(size, size)
    for value in values[1:]:
        total = total + value
    return total
