"""An approximate inverse, corrected by what a simulation of the believed robot says that it leaves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues
from scipy.interpolate import BPoly, BSpline

from robots.description.model import NUM_JOINTS
from robots.description.variation import Factors, varied
from robots.kinematics.analytic_inverse import JointLimitError, UnreachableError
from systems.controller_model import ControllerModel
from systems.feedforward.arm_correction import reach
from systems.feedforward.config import FeedforwardConfig
from systems.feedforward.corrected_inverse.believed_arm import BelievedArm
from systems.feedforward.corrected_inverse.resting_places import ANYWHERE, MIDDLE, Resting, WorstOf
from systems.feedforward.elastic_structure import ElasticStructureFeedforward
from systems.feedforward.joint_motion import JointReference, Standing
from systems.feedforward.predictive.correction import smoothness
from systems.reference.paths import CartesianPath

_STEP = 1e-3  # s, at most, of the simulation
_KNOT = 0.016  # s, between knots of what is added to the motion of a motor
_BEFORE, _AFTER, _SEEN = 0.1, 0.05, 0.3  # s: it begins before the motion, ends after it, and is seen so long
_AT_REST = 1e-6  # rad/s, of the links
_ROUNDING = 1e-6  # ticks, by which a sum of times may miss one
_LONGEST = 10.0  # s: what is simulated again and again takes a minute or more then
_WINDOW, _AHEAD = 1.5, 1.0  # s: corrected at once, and from one window to the next
_SMOOTHER = 3.0  # times what is smooth enough for one motor
_ITERATIONS, _SHARES = 12, (1.0, 0.5, 0.25, 0.125, 0.0625)
_ENOUGH, _ENOUGH_ANYWHERE = 1e-3, 1e-2  # of the cost, by which it still falls
_MOVED, _TINY = 3, 1e-12  # axes whose motors are corrected; share of the squares that counts for nothing
_SPLINE, _FIXED = 3, 3  # degree; coefficients that are alike at the beginning, and at the end

_Case = tuple[np.ndarray, np.ndarray]  # in m, (n, 3), and by the unknowns, (n, 3, u)


class CorrectedFeedforward(ElasticStructureFeedforward):
    """The motion is simulated before it is made, and corrected until the simulated tip stays on its path.

    R (2010), eqs. (5.11), (5.12): the first solution is the approximate inverse, smoothed, and the forward
    model has what an inverse can only approximate, gears with play and hysteresis and the masses along a
    structure that yields. What is found are turns of the motors of axes 1 to 3 and, from the simulated load
    of the gears, their torques. The sum of squares of the simulated tip's distances from its path and of the
    changes of what is added is least, by Gauss and Newton's method, with the nonlinear simulation as the
    judge of every step; a long motion window after window, each a second after the last.

    The motors are taken to move as they are told: friction is left to the drives and to
    `PredictiveCorrection`. It is computed once, from the whole path; then it is played.

    A gear without load may rest anywhere within its play before the motion, and no encoder tells where. Then
    the motion is simulated from both ends of the play, wider and narrower, and from its middle, and what is
    least is a smooth worst case of all of them (`WorstOf`), of the distances and of the ringing at the end.
    A camera tells, if it sees the tip at rest: then it is simulated from about there (`seen_places`).
    """

    title = "corrected"
    colour = "#7a4fb5"
    is_computed_beforehand = True

    def __init__(self, model: ControllerModel, config: FeedforwardConfig) -> None:
        """Builds the models.

        Raises:
            ValueError: as `ElasticStructureFeedforward`; also with a prefilter, or as `BelievedArm`.
        """
        super().__init__(model, config)
        if config.prefilter.kind != "none":
            raise ValueError("feedforward corrected: it takes a path as it is; prefilter.kind must be none")
        # Masses that are all too large by a share move as springs do that are too soft.
        factor = (1.0 + config.stiffness_error) / self._inertia
        gears, bearings, beams = (np.full(shape, factor) for shape in (6, (6, 2), (6, 3)))
        self._period, self._preview = model.period, model.preview
        self._every = int(np.ceil(model.period / _STEP - 1e-9))
        believed = varied(model.robot, Factors(gears, bearings, beams))
        self._believed = BelievedArm(believed, model.payload, model.period / self._every, self._every)
        yielding = replace(model, elasticity="structure")
        self._smoothness = _SMOOTHER * reach(model.robot) * smoothness(yielding)  # m s^2
        self._played: tuple[np.ndarray, np.ndarray] | None = None
        self._standing: Standing | None = None
        self.history: list[float] = []  # m, the simulated tip's effective distance, before each iteration

    def prepare(self, path: CartesianPath, home: np.ndarray, standing: Standing | None = None) -> None:
        """Simulates and corrects the motion along a path; see `Feedforward.prepare`.

        Raises:
            ValueError: also if the path is out of reach, the robot stands elsewhere than is believed, or as
                `play`.
        """
        super().prepare(path, home, standing)
        self._standing = standing
        T = self._period
        # As the ticks ask for it; of 36 ms, 4 ms are left by % and not nothing, as both are rounded.
        first = max(0.0, self._preview - T * int(self._preview / T + _ROUNDING))
        times = np.arange(first, path.duration + T, T)
        references, last = [], home
        for time, X, V, A in zip(times, *path.sample(times), strict=True):
            try:
                last = self._link_positions(RigidTransform.MakeUnchecked(X[:3]), last)
            except (UnreachableError, JointLimitError) as error:
                raise ValueError(f"feedforward corrected: path at {time:.3f} s: {error}") from error
            references.append(self.moving_reference(last, V, A))
        links = np.array([[each.position, each.velocity] for each in references])
        self._played = self.play(references), links

    def play(self, references: Sequence[JointReference]) -> np.ndarray:
        """Commands at ticks from rest to rest, see `Feedforward.play`.

        Raises:
            ValueError: if the motion takes longer than 10 s.
        """
        links = np.array([[each.position, each.velocity, each.acceleration] for each in references])
        moving = np.flatnonzero(np.abs(links[:, 1]).max(axis=1) > _AT_REST)
        T = self._period
        if not len(moving):
            return super().play(references)
        duration = (moving[-1] - moving[0]) * T
        if duration > _LONGEST:
            raise ValueError(
                f"feedforward corrected: the motion takes {duration:.1f} s, more than the {_LONGEST:g} s "
                "that are simulated beforehand; elastic_structure follows any"
            )
        told = super().play(references)
        begin, end = max(0, moving[0] - round(_BEFORE / T)), moving[-1] + round(_SEEN / T)
        # At rest longer than it is asked for, to see it ring.
        seen = np.minimum(np.arange(begin, end + 1), len(links) - 1)
        corrected = self._corrected(links[seen], told[seen, 0], (moving[-1] - begin) * T + _AFTER)
        told[begin:] = corrected[np.minimum(np.arange(len(told) - begin), len(corrected) - 1)]
        return told

    def _corrected(self, links: np.ndarray, motors: np.ndarray, last: float) -> np.ndarray:
        """Commands for a motion from rest, (n, 3, 6).

        Args:
            links: positions, velocities and accelerations at ticks, (n, 3, 6).
            motors: positions in rad as the approximate inverse has them, (n, 6).
            last: in s, the last correction after the first tick.
        """
        ticks = self._period * np.arange(len(links))
        times = np.linspace(0.0, ticks[-1], (len(ticks) - 1) * self._every + 1)
        shapes = _shapes(times, last)
        # By what motors lead the links, smooth enough for drives that are told only so often.
        lead = motors - links[:, 0]
        smooth = np.linalg.lstsq(shapes[:: self._every, 0], lead - lead[0], rcond=None)[0]
        rigid = BPoly.from_derivatives(ticks, links)
        motion = np.stack([rigid(times, order) for order in range(3)], axis=1)  # (N, 3, 6)
        motion += np.einsum("nds,sj->ndj", shapes, smooth)
        motion[:, 0] += lead[0]
        self._believed.set_motion(motion[:, 0], motion[:, 1])
        wanted = np.array([self._kinematics.forward(q)[:3, 3] for q in links[:, 0]])
        added = np.einsum("nds,sj->ndj", shapes, self._found(shapes, wanted, last))
        courses = [self._believed.course(added[:, 0], added[:, 1], None, each) for each in self._restings()]
        load = np.mean([course.torque for course in courses], axis=0)
        motion += added
        return self._told(motion, load)

    def _restings(self) -> Sequence[Resting]:
        if not self._believed.unloaded.any():
            return (MIDDLE,)
        return self._believed.seen_resting(self._standing) if self._standing else ANYWHERE

    def _found(self, shapes: np.ndarray, wanted: np.ndarray, last: float) -> np.ndarray:
        """How much of each shape is to be added to each motor in rad, (c, 6).

        Args:
            shapes: at all steps, with two derivatives, (N, 3, c).
            wanted: where the tip shall be at the ticks in m, (n, 3).
            last: in s, the last correction.
        """
        end = round((last - _AFTER) / self._period)
        count, width, ahead = shapes.shape[2], round(_WINDOW / _KNOT), round(_AHEAD / _KNOT)
        share = np.zeros((count, NUM_JOINTS))
        self.history = []
        for first in range(0, max(1, count - width + ahead), ahead):
            until = wanted.shape[0]
            if first + width < count:
                until = min(until, round(((first + width) * _KNOT + _SEEN) / self._period))
            steps = (until - 1) * self._every + 1
            window = slice(first, min(first + width, count))
            share = self._improved(share, window, shapes[:steps], wanted[:until], end)
        return share

    def _improved(
        self, share: np.ndarray, window: slice, shapes: np.ndarray, wanted: np.ndarray, end: int
    ) -> np.ndarray:
        """The same with better shares of the shapes in a window; see `_found`, up to the window's end.

        The motion ends at a tick: from there on the arm should only rest.
        """
        unknown = np.ascontiguousarray(shapes[:, :2, window])
        count = unknown.shape[2]
        rough = self._smoothness * np.diff(shapes[:: self._every, 2], axis=0)
        weight = np.kron(rough[:, window].T @ rough, np.eye(_MOVED))
        restings = self._restings()
        is_anywhere = len(restings) > 1
        enough = _ENOUGH_ANYWHERE if is_anywhere else _ENOUGH

        def simulated(share: np.ndarray, unknown: np.ndarray | None = None) -> list[_Case]:
            """What is to be small, and by the unknowns: the gap, and apart from it what rings at the end."""
            offset = np.einsum("nds,sj->dnj", shapes[:, :2], share)
            cases = []
            for resting in restings:
                course = self._believed.course(offset[0], offset[1], unknown, resting)
                case = course.tip - wanted, course.derived
                cases.append(case)
                if is_anywhere and end < len(wanted) - 1:
                    gap, derived = (each[end:] - each[end:].mean(axis=0) for each in case)
                    cases.append((gap, derived))
            return cases

        def squares(cases: list[_Case]) -> np.ndarray:
            return np.array([(gap**2).sum() for gap, _ in cases])

        worst = WorstOf.than(squares(simulated(share)))

        def cost(cases: list[_Case], share: np.ndarray) -> float:
            return worst.cost(squares(cases)) + float(((rough @ share) ** 2).sum())

        own = np.arange(_MOVED * window.start, _MOVED * window.stop)
        for _ in range(_ITERATIONS):
            cases = simulated(share, unknown)
            before = cost(cases, share)
            self.history.append(float(np.sqrt(worst.cost(squares(cases)) / len(wanted))))
            slope, normal = weight @ share[:, :_MOVED].ravel(), weight[:, own].copy()
            for factor, (gap, derived) in zip(worst.slopes(squares(cases)), cases, strict=True):
                J = derived.reshape(-1, derived.shape[2])
                slope += factor * (J.T @ gap.ravel())
                normal += factor * (J.T @ J)
            # What nothing shows, such as a motor within its gear's play, stays as it is.
            normal += _TINY * np.trace(normal) / len(normal) * np.eye(len(normal))
            step = np.zeros_like(share)
            step[window, :_MOVED] = np.linalg.solve(normal, -slope).reshape(count, _MOVED)
            trials = (share + part * step for part in _SHARES)
            costs = ((cost(simulated(trial), trial), trial) for trial in trials)
            better = next(((after, trial) for after, trial in costs if after < before), None)
            if better is None:
                return share
            after, share = better
            if after > (1.0 - enough) * before:
                return share
        return share

    def _told(self, motion: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Commands at the ticks, (n, 3, 6), from motors at all steps, (N, 3, 6), and loads in N m, (N, 6)."""
        every = self._every
        torque = np.array(
            [
                self.motor_torque(velocity, acceleration, self._inertia * of_gear)
                for (_, velocity, acceleration), of_gear in zip(motion, load, strict=True)
            ]
        )
        # Held for a tick: the mean over it.
        starts = np.arange(0, len(torque) - 1, every)
        held = np.array([torque[k : k + every + 1].mean(axis=0) for k in starts])
        if self._trains is not None:
            held = held + self._trains.motor_lag * np.gradient(held, self._period, axis=0)
        held -= [self._gravity_compensation(motion[k + every // 2, 0]) for k in starts]
        held = np.append(held, held[-1:], axis=0)
        return np.stack([motion[::every, 0], motion[::every, 1], held], axis=1)

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        if self._played is None:
            raise RuntimeError("feedforward corrected: prepare() has to be called before the run")
        told, links = self._played
        tick = int((context.get_time() + self._preview) / self._period + _ROUNDING)
        theta, rate, torque = told[min(tick, len(told) - 1)]
        q, q_rate = links[min(tick, len(links) - 1)]
        sag, sag_rate = self._known_sag(JointReference(q, q_rate, np.zeros(NUM_JOINTS)))
        for index, value in enumerate((theta, rate, torque, sag + theta - q, sag_rate + rate - q_rate)):
            discrete_state.set_value(index, value)


def _shapes(times: np.ndarray, last: float) -> np.ndarray:
    """Of which what is added to a motor's motion consists, with two derivatives, (N, 3, c).

    B-splines, zero at the beginning; what is there at the last time in s stays.
    """
    knots = _KNOT * np.arange(-_SPLINE, np.ceil(last / _KNOT) + _SPLINE + 1)
    splines = BSpline(knots, np.eye(len(knots) - _SPLINE - 1), _SPLINE)
    end = knots[-_SPLINE - 1]
    values = np.stack([splines(np.minimum(times, end), order) for order in range(3)], axis=1)
    values[times >= end, 1:] = 0.0
    stays = values[:, :, -_FIXED:].sum(axis=2, keepdims=True)
    return np.concatenate([values[:, :, _FIXED:-_FIXED], stays], axis=2)
