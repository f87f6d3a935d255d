"""From pairs of encoder positions and camera poses of one instant to the parameters of the robot."""

import math
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels
from systems.estimation.arm_geometry import Constants
from systems.estimation.camera_moves import CameraMoves
from systems.estimation.camera_or_tool import CameraOrTool
from systems.estimation.events import (
    CAMERA_MOVED,
    CLOCK_DRIFTS,
    LOAD_CHANGED,
    TOOL_DISPLACED,
    TOOL_OR_CAMERA,
    Event,
    Innovations,
)
from systems.estimation.gear_errors import NUM_SHAPES
from systems.estimation.keyframes import Keyframes, open_keyframe
from systems.estimation.memory import Layout
from systems.estimation.tip_model import NO_SHAPES, Pair, Prediction, Spread, TipModel
from systems.estimation.unmodelled import Doubts, Unmodelled

_AGAIN = 500  # samples, in which a second event says that the first was explained wrongly
_OF_THE_LOAD = 0.1  # of its spread, when a tool was displaced
_DOUBT = 3.0  # times wider, what is known of everything, where it does not hold
_TRUST = 0.02  # m or rad, the largest step from where the past was read
_KEEP_EVERY = 10  # samples, between two notes of what is known
_DRIFT_EVERY = 50  # samples, between two looks whether the clock drifts, halfway between two such notes
# s/s; and how sure it has to be, as what no parameter describes adds up.
_LEAST_DRIFT, _DRIFT_SIGMAS = 1e-4, 8.0
_CALM_WEIGHT = 0.2  # of a sample, below which it says nothing of events or of the camera
_CLOSE_AT = (5, 20, 60)  # samples: the first linearisations are poor


@dataclass
class TipEstimatorConfig:
    """What is known of robot and camera before anything is measured."""

    spread: Spread = field(default_factory=Spread)
    position_sigma: float = 60e-6  # m, of a camera sample and of what no parameter describes
    rotation_sigma: float = 2.1e-4  # rad
    keyframe_step: float = 0.012  # rad, samples nearer than this in every joint are merged
    keyframe_samples: int = 100  # the most samples in one
    relinearise: float = 3e-4  # m or rad, a change of a parameter after which the past is read anew
    geometry_step: float = 1e-4  # m or rad, within which poses are linear in the parameters
    calm: float = 0.05  # m/s^2, of the tip by parameters that are led in: more makes samples count less
    test_after: int = 250  # samples before events are looked for


class TipEstimator:
    """Recursive least squares in information form, on keyframes that are linearised again.

    With A = A_0 + sum w H^T W H and b = sum w H^T W (r + H xi) the estimate is A^-1 b, in units of the
    spreads; A_0 is what is known before.
    """

    def __init__(self, model: TipModel, config: TipEstimatorConfig) -> None:
        """Lays out the memory."""
        self.model, self._config = model, config
        variances = np.repeat([config.rotation_sigma, config.position_sigma], 3) ** 2
        self.weights = 1.0 / variances
        self._keyframes = Keyframes(model, self.weights)
        self._innovations, self._unmodelled = Innovations(variances), Unmodelled(variances)
        self._camera_or_tool = CameraOrTool(variances, model.size)
        self._camera = CameraMoves(model.world_directions())
        n = model.size
        self.layout = Layout(
            xi=(n,),
            x_geometry=(n,),  # the value that the constants are for
            count=(1,),
            event_at=(1,),  # the count at the last event
            is_foreign=(1,),  # whether the camera speaks of another frame: then nothing is learnt from it
            is_busy=(1,),  # whether the sample of this tick took longer than others
            is_behind=(1,),  # whether `work` was put off for that
            was_settled=(1,),  # whether the sum was linear enough when samples agreed with it last
            A_open=(n, n),
            b_open=(n,),
            samples=(1,),
            weight=(1,),
            first_theta=(6,),
            sums=(31 + 6 * NUM_SHAPES * model.has_gear_errors,),  # theta, gears, motion, twist, time, shapes
            first_time=(1,),  # of the camera's clock
            last_time=(1,),
            sum_y=(6,),
            sum_H=(6, n),
            keyframes=self._keyframes.layout,
            innovations=self._innovations.layout,
            unmodelled=self._unmodelled.layout,
            camera=self._camera.layout,
            after_step=self._camera_or_tool.layout,
        )
        self._constants: Constants | None = None

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is known before the first sample."""
        memory.x_geometry[:] = self.model.mean
        memory.event_at[0] = -np.inf
        memory.first_time[0] = memory.last_time[0] = np.nan
        memory.keyframes.held[0] = self.model.prior[self.model.D, self.model.D]
        self._keyframes.reset(memory.keyframes, self.model.prior, memory.xi)

    def x(self, memory: SimpleNamespace) -> np.ndarray:
        """The unknowns in their units, shape (n,)."""
        return self.model.full(memory.xi)

    def x_robot(self, memory: SimpleNamespace) -> np.ndarray:
        """The unknowns of the robot where it stands, (n,): without what only a moved camera sees."""
        return self.model.full(self._camera.robot(memory.camera, memory.xi))

    def clock_offset(self, memory: SimpleNamespace, time: float) -> float:
        """What is to be added to a stamp of the camera in s."""
        model, xi = self.model, memory.xi
        offset, drift = (float(model.mean[k] + model.sigma[k] * xi[k]) for k in (model.C, model.D))
        return offset + drift * self._since_first(memory, time)

    @staticmethod
    def _since_first(memory: SimpleNamespace, time: float) -> float:
        first = float(memory.first_time[0])
        return 0.0 if math.isnan(first) else time - first

    def variance_factor(self, memory: SimpleNamespace) -> float:
        """The measured variance of the camera in units of the one that is believed."""
        return self._innovations.noise_factor(memory.innovations)

    def covariance(self, memory: SimpleNamespace) -> np.ndarray:
        """Covariance of the unknowns in units of their spreads, shape (n, n).

        The camera's noise is measured: with f times the variance that is believed, weights stay what they
        are, and P (A_0 + f (A - A_0)) P is the covariance of what they give, P = A^-1. A noisier camera than
        is believed casts doubt on what was known before, too: then it is f P. Where A_0 has been taken back
        since, because something happened, f is not counted below 1.
        """
        P = np.linalg.inv(memory.keyframes.A + memory.A_open)
        factor = self.variance_factor(memory)
        if factor >= 1.0:
            return factor * P
        by_prior = P @ self.model.prior @ P
        is_taken_back = (np.diag(by_prior) > np.diag(P)).any()
        return P if is_taken_back else factor * P + (1.0 - factor) * by_prior

    def sigma(self, memory: SimpleNamespace, rows: np.ndarray) -> float:
        """The largest standard deviation of n vectors that are linear in the unknowns, rows (n, k, size)."""
        H = rows.reshape(-1, self.model.size)
        variances = (H * self._solve_columns(memory, H).T).sum(axis=1).reshape(rows.shape[:2]).sum(axis=1)
        return math.sqrt(max(1.0, self.variance_factor(memory)) * float(variances.max()))

    def covariance_of_robot(self, memory: SimpleNamespace) -> np.ndarray:
        """The same of `x_robot`."""
        return self._camera.covariance(memory.camera, self.covariance(memory))

    def constants(self, memory: SimpleNamespace) -> Constants:
        """The geometry near the estimate; a function of the memory alone, kept to save time."""
        return self._constants_at(memory, self.x(memory))

    def _constants_at(self, memory: SimpleNamespace, x: np.ndarray) -> Constants:
        self._constants = self.model.constants_near(
            x, memory.x_geometry, self._config.geometry_step, self._constants
        )
        return self._constants

    def predict(self, memory: SimpleNamespace, pair: Pair) -> Prediction:
        """The tip of one pair at the estimate, as a camera sees it that was not moved."""
        x = self.x_robot(memory)
        shapes = self.model.gear_shapes(pair.theta, pair.states)
        return self.model.predict(
            self._constants_at(memory, x),
            x,
            pair.theta[None],
            pair.loads[None],
            pair.twist[None],
            None if shapes is None else shapes[None],
            self._since_first(memory, pair.time),
        )

    def tip_covariance(self, memory: SimpleNamespace, pair: Pair) -> np.ndarray:
        """Covariance of the predicted tip, rotation (rad^2) first, shape (6, 6).

        To what the unknowns may be wrong by, H P H^T, the steps of the encoders and what gears may be off
        by add J S J^T, and the camera what it sees beyond all that. As long as nothing tells a displaced
        tool from a camera that was moved, the tip is where it is seen or, as likely, where it would be
        without the step: with the way d from there, that adds d d^T / 2.
        """
        H, x = self.predict(memory, pair).H[0], self.x_robot(memory)
        covariance = H @ self.covariance_of_robot(memory) @ H.T
        covariance += self._by_angles(memory, x, pair)
        covariance += np.diag(self._unmodelled.variances(memory.unmodelled))
        if memory.after_step.is_open[0]:
            d = H @ (memory.xi - memory.after_step.xi_before)
            covariance += 0.5 * np.outer(d, d)
        return covariance

    def _by_angles(self, memory: SimpleNamespace, x: np.ndarray, pair: Pair) -> np.ndarray:
        """Covariance of the tip, (6, 6), by what gears and readings of the joints may be off by."""
        angles = self.model.gear_variances(x, pair.loads, pair.states) + pair.rounding**2
        J = self.model.jacobian(self._constants_at(memory, x), x, pair.theta)
        return (J * angles) @ J.T

    def add(self, memory: SimpleNamespace, pair: Pair) -> Event | None:
        """Learns from one pair; says if something happened to the robot."""
        config = self._config
        if math.isnan(memory.first_time[0]):
            memory.first_time[0] = pair.time
        memory.last_time[0] = pair.time
        if memory.is_foreign[0]:
            return None
        model, x, since_first = self.model, self.x(memory), self._since_first(memory, pair.time)
        shapes = model.gear_shapes(pair.theta, pair.states)
        seen = pair.theta, pair.loads, pair.twist, pair.X_WE
        r, H, gears = model.innovation(self._constants_at(memory, x), x, seen, shapes, since_first)
        weight = 1.0 / (1.0 + (pair.unrest / config.calm) ** 2)
        event, innovations = None, memory.innovations
        if memory.count[0] <= config.test_after:
            if self._innovations.is_false_start(innovations, r, H, lambda: self._solve_columns(memory, H)):
                return self._look_for_foreign(memory, H)
        else:
            verdict = self._innovations.judge(innovations, r, H, lambda: self._solve_columns(memory, H))
            if verdict.is_outlier:
                return None
            if weight > _CALM_WEIGHT and self._innovations.measure_noise(innovations, r):
                self._unmodelled.add(memory.unmodelled, r, lambda: self._doubts(memory, H, pair))
            if verdict.has_jumped or verdict.has_drifted:
                self._unmodelled.rest(memory.unmodelled)
            if verdict.is_calm:
                memory.was_settled[0] = self._keyframes.is_settled(memory.keyframes, memory.xi)
            if verdict.is_doubtful and memory.was_settled[0]:
                return None  # a few samples later it is known what they mean
            if verdict.has_jumped and weight > _CALM_WEIGHT:
                event = self._innovations.explain(innovations, H, self.model)
                self._camera_or_tool.begin(memory.after_step, may_be_camera=event.kind != LOAD_CHANGED)
                if event.kind == TOOL_DISPLACED and memory.after_step.is_open[0]:
                    event, memory.after_step.is_event[0] = event._replace(kind=TOOL_OR_CAMERA), 1.0
                self._widen(memory, event)
            elif verdict.has_drifted and weight > _CALM_WEIGHT:
                self._innovations.forget(innovations)
                self._camera_or_tool.begin(memory.after_step)
                if memory.was_settled[0]:
                    self._doubt(memory)
            elif verdict.is_calm and not memory.after_step.samples[0] and memory.count[0] % _KEEP_EVERY == 0:
                known = memory.keyframes.A + memory.A_open
                self._camera_or_tool.keep(memory.after_step, known, memory.xi)
            elif memory.after_step.samples[0]:
                before = r + H @ (memory.xi - memory.after_step.xi_before)
                found = self._camera_or_tool.found(memory.after_step, before, pair.X_WE)
                if found == CAMERA_MOVED:
                    return self._take_back(memory, pair.X_WE)
                if found == TOOL_DISPLACED and memory.after_step.is_event[0]:
                    size = self._camera_or_tool.size(memory.after_step, found, pair.X_WE[:3, 3])
                    event = Event(found, size, size)
        self._take(memory, (r, gears, H), pair, shapes, weight)
        if event is None and memory.count[0] % _DRIFT_EVERY == _DRIFT_EVERY // 2:
            event = self._look_for_drift(memory)
            if event is not None:
                self._solve(memory)
        return event

    def _take(
        self,
        memory: SimpleNamespace,
        innovation: tuple[np.ndarray, np.ndarray, np.ndarray],
        pair: Pair,
        shapes: np.ndarray | None,
        weight: float,
    ) -> None:
        """Adds a sample to the open keyframe, closes that if the robot has gone far enough, and solves.

        ``innovation`` is the error, the deflections of the gears and the columns.
        """
        memory.count[0] += 1.0
        is_long = memory.samples[0] + 1.0 >= self._config.keyframe_samples
        is_closing = is_long or int(memory.count[0]) in _CLOSE_AT
        since_first = self._since_first(memory, pair.time)
        seen = pair.theta, pair.motion, pair.twist, since_first, NO_SHAPES if shapes is None else shapes
        keyframe = open_keyframe(memory)
        past, model = memory.keyframes, self.model
        sums = past.A, past.b, past.xi_sum, model.sigma, model.K.start
        limits = -1.0 if is_closing else self._config.keyframe_step, _TRUST
        r, gears, H = innovation
        take = kernels.information.take
        if take(r, gears, H, memory.xi, seen, self.weights, weight, keyframe, sums, limits):
            self._close(memory)
            self._solve(memory)

    def _look_for_foreign(self, memory: SimpleNamespace, H: np.ndarray) -> Event | None:
        """Finds out early that a camera of another frame teaches nothing."""
        if memory.count[0] > 0.0:
            return None
        event = self._innovations.foreign(memory.innovations, H)
        memory.is_foreign[0] = event is not None
        return event

    def _look_for_drift(self, memory: SimpleNamespace) -> Event | None:
        """Tells a clock that drifts from one that does not by what the drift would be if it were free."""
        if memory.keyframes.held[0] <= 1.0:
            return None
        memory.is_busy[0] = 1.0
        drift, deviation = self._keyframes.drift_if_free(memory.keyframes, memory.A_open, memory.b_open)
        size = drift * float(self.model.sigma[self.model.D])
        if abs(size) < _LEAST_DRIFT or abs(drift) < _DRIFT_SIGMAS * deviation:
            return None
        self._keyframes.free_drift(memory.keyframes)
        return Event(CLOCK_DRIFTS, size, 0.0)

    def work(self, memory: SimpleNamespace) -> None:
        """What can be done in a tick without a sample, or after its command is out: relinearise.

        A tick whose sample took long is left in peace, unless the one before was.
        """
        is_put_off = bool(memory.is_busy[0]) and not memory.is_behind[0]
        memory.is_busy[0], memory.is_behind[0] = 0.0, float(is_put_off)
        if is_put_off:
            return
        keyframes, tolerance = memory.keyframes, self._config.relinearise
        if self._keyframes.work(keyframes, lambda: self.constants(memory), memory.xi, tolerance):
            self._solve(memory)

    def _close(self, memory: SimpleNamespace) -> None:
        """Makes the open samples a keyframe."""
        constants = self.constants(memory)
        if self._keyframes.close(memory.keyframes, constants, memory.xi, open_keyframe(memory)):
            self._forget_open(memory)

    def _solve(self, memory: SimpleNamespace) -> None:
        # Half of the square of a step is what it leaves of samples that are known far better: small steps
        # from where the past was read keep to the curved set of parameters that explain it.
        past, model = memory.keyframes, self.model
        sums = past.A, memory.A_open, past.b, memory.b_open
        kernels.information.estimate(*sums, past.xi_sum, model.sigma, model.K.start, _TRUST, memory.xi)

    def _solve_columns(self, memory: SimpleNamespace, H: np.ndarray) -> np.ndarray:
        """P H^T with the covariance P of the estimate, (n, 6)."""
        out = np.empty((self.model.size, len(H)))
        columns = np.ascontiguousarray(H.T)
        if not kernels.information.solve(memory.keyframes.A, memory.A_open, columns, out):
            return np.linalg.solve(memory.keyframes.A + memory.A_open, columns)
        return out

    def _doubts(self, memory: SimpleNamespace, H: np.ndarray, pair: Pair) -> Doubts:
        memory.is_busy[0] = 1.0
        by_model, by_gears = (H * self._solve_columns(memory, H).T).sum(axis=1), np.zeros(6)
        if self.model.has_gear_errors:  # nothing is said of encoders here
            by_gears = np.diag(self._by_angles(memory, self.x(memory), pair))
        return Doubts(self.variance_factor(memory), by_model, by_gears)

    def _doubt(self, memory: SimpleNamespace) -> None:
        """What was learnt does not hold where the robot is now, though nothing happened: it weighs less."""
        self._innovations.forget(memory.innovations)
        self._keyframes.reset(memory.keyframes, (memory.keyframes.A + memory.A_open) / _DOUBT**2, memory.xi)
        self._forget_open(memory)

    def _widen(self, memory: SimpleNamespace, event: Event) -> None:
        """Something happened: what was known stays, but for the tool and the load.

        A displaced tool leaves the load alone, unless that has not explained what came soon after it.
        """
        again = memory.count[0] - memory.event_at[0] < _AGAIN
        memory.event_at[0] = memory.count[0]
        share = 1.0 if again or event.kind == LOAD_CHANGED else _OF_THE_LOAD
        tool = self.model.tool_directions()
        self._open(memory, share, tool @ tool.T)

    def open_load(self, memory: SimpleNamespace) -> None:
        """Takes what is known of the load back, and nothing else: the motors say that it may have changed."""
        self._innovations.forget(memory.innovations)
        self._unmodelled.rest(memory.unmodelled)
        self._open(memory, 1.0, 0.0)

    def _open(self, memory: SimpleNamespace, share: float, others: np.ndarray | float) -> None:
        """Adds to the covariance of the unknowns: a share of the load's spread, and others, (n, n)."""
        model = self.model
        P = np.linalg.inv(memory.keyframes.A + memory.A_open) + others
        load = np.zeros(model.size)
        load[model.M] = share * model.changed_load
        A = np.linalg.inv(P + np.diag(load**2))
        A = 0.5 * (A + A.T)
        self._keyframes.reset(memory.keyframes, A, memory.xi)
        self._forget_open(memory)

    def _take_back(self, memory: SimpleNamespace, X_WE: np.ndarray) -> Event:
        """It was the camera: what was known before it moved holds of the robot, but not of where it is seen.

        So the unknowns follow what is seen, as after a move of the base; see `CameraMoves`.
        """
        before = memory.after_step
        A = self._camera.begin(memory.camera, before.A_before, before.xi_before)
        self._innovations.rest(memory.innovations)
        memory.xi[:] = before.xi_before
        self._keyframes.reset(memory.keyframes, A, before.xi_before)
        self._forget_open(memory)
        return Event(CAMERA_MOVED, self._camera_or_tool.size(before, CAMERA_MOVED, X_WE[:3, 3]), 0.0)

    @staticmethod
    def _forget_open(memory: SimpleNamespace) -> None:
        opened = memory.A_open, memory.b_open, memory.samples, memory.weight, memory.sums
        for part in (*opened, memory.sum_y, memory.sum_H):
            part[:] = 0.0
