"""The stable inverse of a robot whose gears, bearings and links yield, of a path that is known to its end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues
from scipy.interpolate import BPoly, CubicSpline, interp1d

from robots.description.model import NUM_JOINTS
from robots.description.variation import Factors, varied
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from systems.controller_model import ControllerModel
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.feedforward import Feedforward
from systems.feedforward.joint_motion import JointReference, Standing
from systems.feedforward.stable_inverse.bounded_inverse import (
    BoundedMotion,
    Motion,
    NoBoundedMotionError,
    bounded_motion,
    derivatives,
)
from systems.feedforward.stable_inverse.flexible_arm import FlexibleArm, Pencil
from systems.feedforward.stable_inverse.relaxed_inverse import relaxed_motion
from systems.reference.paths import CartesianPath

_SAMPLE = 2e-3  # s; at 30 Hz differences of fourth order err by some hundredths of a percent
_MARGIN = 0.8  # s at rest before and after: what a motion needs there dies away by some 5 1/s
_LINEARISED = 5  # samples from one linearisation to the next; they change as slowly as the arm turns
_ENOUGH = 5e-5  # m, what the point may be off its path where an exact motion does not exist
_EFFORT = 1e-6  # m per rad/s^2 of the motors beyond a motion that is nearly right; costs some micrometres
_MATRICES = ("mass", "damping", "stiffness")
_HARDLY = 0.02  # of the best direction: how well axes 1 to 3 move the point where its path may be refused
_AT_REST = 1e-3  # rad/s; where the structure rings at some 10 Hz that is a hundredth of a millirad


@dataclass(frozen=True)
class Plan:
    """What motors do over the time, as functions of it in s; shape (6,) each."""

    position: CubicSpline  # rad
    velocity: CubicSpline  # rad/s
    torque: CubicSpline  # N m, beyond the drives' gravity compensation
    rigid: CubicSpline  # rad, the links of the rigid robot
    first: float  # s, the motors begin to move
    last: float  # s, they are at rest again
    history: list[float]  # m, the largest error of the point before each iteration, and at the end


class StableFeedforward(Feedforward):
    """Motors that begin to move before the tip shall: no causal inverse of an elastic structure is exact.

    Computed once, before the run, from the whole path; then it is played. The position of the tip (or of the
    wrist, `FeedforwardConfig.point`) and the links of the wrist are exact, or nearly so where no exact motion
    exists (see `plan`); the orientation is off by what bearings and beams turn the wrist. It starts at rest,
    so there must be time before the path.
    """

    title = "stable"
    colour = "#2a9d5c"
    derivatives = 4
    is_computed_beforehand = True

    def __init__(self, model: ControllerModel, config: FeedforwardConfig) -> None:
        """Builds the models.

        Raises:
            ValueError: as `Feedforward`; also with a prefilter, or if drive trains have parts that it cannot
                invert.
        """
        super().__init__(model, config)
        if config.prefilter.kind != "none":
            raise ValueError("feedforward stable: it takes a path as it is; prefilter.kind must be none")
        # Masses that are all too large by a share move as springs do that are too soft.
        factor = (1.0 + config.stiffness_error) / (1.0 + config.inertia_error)
        gears, bearings, beams = (np.full(shape, factor) for shape in (6, (6, 2), (6, 3)))
        robot = varied(model.robot, Factors(gears, bearings, beams))
        self._arm = FlexibleArm(robot, model.payload, config.point)
        self._period, self._preview = model.period, model.preview
        self._plan: Plan | None = None

    def prepare(self, path: CartesianPath, home: np.ndarray, standing: Standing | None = None) -> None:
        """Computes the motion for a path; see `Feedforward.prepare`.

        Raises:
            ValueError: also if the path is out of reach, or as `plan`.
        """
        super().prepare(path, home, standing)
        times = np.arange(0.0, path.duration + 0.5 * _SAMPLE, _SAMPLE)
        q, last = np.empty((len(times), NUM_JOINTS)), home
        for row, X, time in zip(q, path.sample(times)[0], times, strict=True):
            try:
                last = row[:] = self._link_positions(RigidTransform.MakeUnchecked(X[:3]), last)
            except (UnreachableError, JointLimitError) as error:
                raise ValueError(f"feedforward stable: path at {time:.3f} s: {error}") from error
        self._plan = self.plan(times, q)

    def plan(self, times: np.ndarray, q: np.ndarray) -> Plan:
        """The motion of the motors for links of a rigid robot that go from rest to rest.

        It is exact where such a motion exists and begins within these times. Where zeros change sides on the
        path, or nearly do, it is the one within these times that leaves the path least.

        Args:
            times: s, evenly spaced, shape (n,).
            q: rad, shape (n, 6).

        Raises:
            NoBoundedMotionError: if it is off the path by more than 0.05 mm, or the iteration does not end;
                it says when the arm is stretched on the way, or the point on axis 1.
        """
        try:
            return self._bounded_plan(times, q)
        except NoBoundedMotionError as error:
            mobility = [self._arm.mobility(row) for row in q]
            worst = int(np.argmin(mobility))
            if mobility[worst] > _HARDLY:
                raise
            raise NoBoundedMotionError(
                f"feedforward stable: {times[worst]:.3f} s from the start the arm is stretched, or its wrist "
                "near axis 1: its joints cannot move the point in every direction there"
            ) from error

    def _bounded_plan(self, times: np.ndarray, q: np.ndarray) -> Plan:
        step = times[1] - times[0]
        margin = round(_MARGIN / step)
        try:
            plan = self._plan_with(times, q, (margin, margin), bounded_motion)
            if plan.first >= times[0]:
                return plan
        except NoBoundedMotionError:
            pass
        relaxed = partial(relaxed_motion, motors=self._arm.motors, effort=_EFFORT)
        plan = self._plan_with(times, q, (0, margin), relaxed)
        if plan.history[-1] > _ENOUGH:
            raise NoBoundedMotionError(
                f"feedforward stable: off the path by {1e3 * plan.history[-1]:.3g} mm with motors at rest "
                f"at its beginning, more than {1e3 * _ENOUGH:g}: more time before the motion helps "
                "(reference.settle)"
            )
        return plan

    def _plan_with(
        self,
        times: np.ndarray,
        q: np.ndarray,
        margins: tuple[int, int],
        solver: Callable[..., BoundedMotion],
    ) -> Plan:
        """The same by one method, with so many samples at rest before and after."""
        before, after = margins
        step = times[1] - times[0]
        q = np.concatenate([np.tile(q[0], (before, 1)), q, np.tile(q[-1], (after, 1))])
        times = times[0] + step * (np.arange(len(q)) - before)
        wanted = np.array([self._arm.rigid_place(row) for row in q])

        def residuals(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
            return self._arm.residuals(motion, q, wanted)

        start, linear = self._linearised(q, step)
        found = solver(start, step, linear, residuals)
        theta, rate, acceleration = (part[:, self._arm.motors] for part in found.motion)
        load = self._inertia * (found.others - self._rotor * acceleration - self._viscous * rate)
        torque = [
            self.motor_torque(v, a, tau) - self._gravity_compensation(position)
            for position, v, a, tau in zip(theta, rate, acceleration, load, strict=True)
        ]
        # Where the circle of samples closes, what is left of the end dies away.
        moving = times[(np.abs(rate).max(axis=1) > _AT_REST) & (times >= times[before // 2])]
        first, last = (moving[0], moving[-1]) if len(moving) else (times[-1], times[0])
        return Plan(
            CubicSpline(times, theta),
            CubicSpline(times, rate),
            CubicSpline(times, np.array(torque)),
            CubicSpline(times, q),
            float(first),
            float(last),
            found.history,
        )

    def _linearised(self, q: np.ndarray, step: float) -> tuple[np.ndarray, Pencil]:
        """A motion that is exact where it rests, and the equations about it, linear between some samples."""
        some = np.unique(np.append(np.arange(0, len(q), _LINEARISED), len(q) - 1))
        samples = np.arange(len(q))
        rests = _once_each(self._arm.at_rest_with_point, [(q[i],) for i in some])
        start = CubicSpline(some, rests)(samples)
        moments = zip(*(part[some] for part in (start, *derivatives(start, step))), strict=True)
        pencils = _once_each(self._arm.pencil, list(moments))
        of = (
            interp1d(some, [getattr(each, name) for each in pencils], axis=0)(samples) for name in _MATRICES
        )
        return start, Pencil(*of)

    def play(self, references: Sequence[JointReference]) -> np.ndarray:
        """Commands at ticks from rest to rest, see `Feedforward.play`.

        Raises:
            ValueError: as `plan`.
        """
        ticks = self._period * np.arange(len(references))
        moments = np.array([[each.position, each.velocity, each.acceleration] for each in references])
        times = np.arange(0.0, ticks[-1] + 0.5 * _SAMPLE, _SAMPLE)
        plan = self.plan(times, BPoly.from_derivatives(ticks, moments)(np.minimum(times, ticks[-1])))
        middles = ticks + 0.5 * self._period
        return np.stack([plan.position(ticks), plan.velocity(ticks), plan.torque(middles)], axis=1)

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        plan = self._plan
        if plan is None:
            raise RuntimeError("feedforward stable: prepare() has to be called before the run")
        # At rest before the path and after it; the plan goes on for a while there.
        time = min(context.get_time() + self._preview, float(plan.rigid.x[-1]) - self._period)
        theta, rate, q, q_rate = (
            function(time) for function in (plan.position, plan.velocity, plan.rigid, plan.rigid.derivative())
        )
        sag, sag_rate = self._known_sag(JointReference(q, q_rate, np.zeros(NUM_JOINTS)))
        torque = plan.torque(time + 0.5 * self._period)
        for index, value in enumerate((theta, rate, torque, sag + theta - q, sag_rate + rate - q_rate)):
            discrete_state.set_value(index, value)


def _once_each(function: Callable[..., Any], arguments: list[tuple[np.ndarray, ...]]) -> list[Any]:
    """What a function says to each of a row of arguments; at rest the same again is not computed again."""
    found: list[Any] = []
    for last, now in zip([None, *arguments[:-1]], arguments, strict=True):
        is_same = last is not None and all(
            np.allclose(a, b, atol=1e-10) for a, b in zip(last, now, strict=True)
        )
        found.append(found[-1] if is_same else function(*now))
    return found
