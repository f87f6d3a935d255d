"""From pairs of encoder positions and camera poses of one instant to the parameters of the robot."""

import math
from types import SimpleNamespace

import numpy as np

from systems.estimation import kernels
from systems.estimation.arm_geometry import Constants
from systems.estimation.camera.camera_moves import CameraMoves
from systems.estimation.camera.camera_noise import CameraNoise
from systems.estimation.camera.displacement import Displacement
from systems.estimation.events import (
    CAMERA_MOVED,
    JOINTS_SHIFTED,
    LOAD_CHANGED,
    TOOL_DISPLACED,
    TOOL_OR_CAMERA,
    Event,
    Innovations,
)
from systems.estimation.gears.gear_errors import NUM_MODELS, NUM_SHAPES
from systems.estimation.gears.gear_feedback import GearFeedback, samples_alike
from systems.estimation.keyframes import Keyframes, forget_open, open_keyframe
from systems.estimation.memory import Layout
from systems.estimation.suppositions import Suppositions
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from systems.estimation.tip_model import NO_SHAPES, Pair, Prediction, TipModel
from systems.estimation.unmodelled import Doubts, Unmodelled, doubts

_AGAIN = 500  # samples, in which a second event says that the first was explained wrongly
_OF_THE_LOAD = 0.1  # of its spread, when a tool was displaced
_A_LITTLE = 0.2  # of its spread, by which something may be displaced unseen
_DOUBT = 3.0  # times wider, what is known of everything, where it does not hold
_TRUST = 0.02  # m or rad, the largest step from where the past was read
_KEEP_EVERY = 10  # samples, between two notes of what is known
_INVERT_AFTER = 500  # samples, if no pass through the keyframes gives reason to
_LOOK_EVERY = 50  # samples, between two looks at what is supposed, halfway between two such notes
_CALM_WEIGHT = 0.2  # of a sample, below which it says nothing of events or of the camera
_STEP_WEIGHT = 0.01  # likewise of a step, which may have begun to be led in before it is called one
_CLOSE_AT = (5, 20, 60)  # samples: the first linearisations are poor


class TipEstimator:
    """Recursive least squares in information form, on keyframes that are linearised again.

    With A = A_0 + sum w H^T W H and b = sum w H^T W (r + H xi) the estimate is P b, in units of the spreads;
    A_0 is what is known before, and the covariance P = A^-1 is kept up to date, sample by sample.
    """

    def __init__(self, model: TipModel, config: TipEstimatorConfig) -> None:
        """Lays out the memory."""
        self.model, self._config = model, config
        variances = np.repeat([config.rotation_sigma, config.position_sigma], 3) ** 2
        self.weights = 1.0 / variances
        self._keyframes, self._camera = Keyframes(model), CameraMoves(model.world_directions())
        self._suppositions = Suppositions(model)
        self._noise, self._innovations = CameraNoise(variances), Innovations(variances)
        self._unmodelled = Unmodelled(joints=6 if model.has_gear_errors else 0)
        self._displacement = Displacement(model.size, model.M)
        self.gear_feedback = GearFeedback(config.gear_feedback if model.has_gear_errors else 0.0)
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
            P=(n, n),
            taken=(1,),  # samples into P since it was inverted
            A_open=(n, n),  # its lower half
            b_open=(n,),
            samples=(1,),
            weight=(1,),
            first_theta=(6,),
            # theta, gears, motion, twist, time, shapes, by gears
            sums=(31 + 6 * (NUM_SHAPES + 1) * model.has_gear_errors,),
            first_time=(1,),  # of the camera's clock
            last_time=(1,),
            sum_y=(6,),
            sum_H=(6, n),
            supposed=self._suppositions.layout,
            keyframes=self._keyframes.layout,
            noise=self._noise.layout,
            innovations=self._innovations.layout,
            unmodelled=self._unmodelled.layout,
            camera=self._camera.layout,
            after_step=self._displacement.layout,
            against=(NUM_MODELS, 6),  # models of each gear, see `GearErrors.weigh`
            loose=self.gear_feedback.layout,
        )
        self._constants: Constants | None = None

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is known before the first sample."""
        memory.x_geometry[:] = self.model.mean
        memory.event_at[0] = -np.inf
        memory.first_time[0] = memory.last_time[0] = np.nan
        self._begin_from(memory, self.model.prior, memory.xi)
        self._suppositions.start(memory.supposed)
        self._noise.start(memory.noise)
        self.gear_feedback.rest(memory.loose)
        self._innovations.start(memory.innovations)

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
        """The measured variance of the camera in units of the one by which samples are weighted."""
        return self._innovations.noise_factor(memory.innovations)

    def covariance(self, memory: SimpleNamespace) -> np.ndarray:
        """Covariance of the unknowns in units of their spreads, shape (n, n).

        With f times the noise by which samples are weighted, as the camera shows it, P (A_0 + f (A - A_0)) P
        is the covariance of what they give, P = A^-1. An f above 1 casts doubt on what was known before, too:
        then it is f P. Where A_0 has been taken back since, after an event, it is not counted below 1.
        """
        P, factor = memory.P, self.variance_factor(memory)
        if factor >= 1.0:
            return factor * P
        by_prior = P @ self.model.prior @ P
        is_taken_back = (np.diag(by_prior) > np.diag(P)).any()
        return P.copy() if is_taken_back else factor * P + (1.0 - factor) * by_prior

    def sigma(self, memory: SimpleNamespace, rows: np.ndarray) -> float:
        """The largest standard deviation of n vectors that are linear in the unknowns, rows (n, k, size)."""
        H = rows.reshape(-1, self.model.size)
        variances = (H @ memory.P * H).sum(axis=1).reshape(rows.shape[:2]).sum(axis=1)
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
        constants, since_first = self._constants_at(memory, x), self._since_first(memory, pair.time)
        rows = pair.theta[None], pair.loads[None], pair.twist[None], None if shapes is None else shapes[None]
        return self.model.predict(constants, x, *rows, since_first)

    def tip_covariance(self, memory: SimpleNamespace, pair: Pair) -> np.ndarray:
        """Covariance of the predicted tip, rotation (rad^2) first, shape (6, 6).

        To what the unknowns may be wrong by, H P H^T, the steps of the encoders and what gears are seen to
        be off by add J S J^T, and the camera what it sees beyond all that. As long as nothing tells a
        displaced tool from a camera that was moved, the tip is where it is seen or, as likely, where it
        would be without the step: with the way d from there, that adds d d^T / 2.
        """
        H, x = self.predict(memory, pair).H[0], self.x_robot(memory)
        covariance = H @ self.covariance_of_robot(memory) @ H.T
        J = self.model.jacobian(self._constants_at(memory, x), x, pair.theta)
        by_gears = self.model.gear_variances(x, memory.P, pair.loads, pair.states)
        angles = self._unmodelled.joint_variances(memory.unmodelled, by_gears) + pair.rounding**2
        covariance += (J * angles) @ J.T + np.diag(self._unmodelled.variances(memory.unmodelled))
        if memory.after_step.is_open[0]:
            d = H @ (memory.xi - memory.after_step.xi_before)
            covariance += 0.5 * np.outer(d, d)
        return covariance

    def add(self, memory: SimpleNamespace, pair: Pair) -> Event | None:
        """Learns from one pair; says if something happened to the robot."""
        config = self._config
        if math.isnan(memory.first_time[0]):
            memory.first_time[0] = pair.time
        period, memory.last_time[0] = pair.time - float(memory.last_time[0]), pair.time
        if memory.is_foreign[0]:
            return None
        model, x, since_first = self.model, self.x(memory), self._since_first(memory, pair.time)
        shapes = model.gear_shapes(pair.theta, pair.states)
        seen = pair.theta, pair.loads, pair.twist, pair.X_WE
        r, H, gears, J = model.innovation(self._constants_at(memory, x), x, seen, shapes, since_first)
        by_gears = model.gear_variances(x, memory.P, pair.loads, pair.states)
        weight, event, innovations = 1.0 / (1.0 + (pair.unrest / config.calm) ** 2), None, memory.innovations
        if memory.count[0] <= config.test_after and since_first <= config.test_at_latest:
            if self._innovations.is_false_start(innovations, r, H, lambda: memory.P @ H.T):
                return self._look_for_foreign(memory, H)
        else:
            verdict = self._innovations.judge(innovations, r, H, lambda: memory.P @ H.T)
            if verdict.is_outlier:
                return None
            if weight > _CALM_WEIGHT and self._innovations.measure_noise(innovations, r):
                self._unmodelled.add(memory.unmodelled, r, lambda: self._doubts(memory, H, J, by_gears))
            if verdict.has_jumped or verdict.has_drifted:
                self._unmodelled.rest(memory.unmodelled)
            if verdict.is_calm:
                memory.was_settled[0] = self._keyframes.is_settled(memory.keyframes, memory.xi)
            if verdict.is_doubtful and memory.was_settled[0]:
                return None  # a few samples later it is known what they mean
            if verdict.has_jumped and weight > (_STEP_WEIGHT if memory.was_settled[0] else _CALM_WEIGHT):
                event = self._innovations.explain(innovations, H, self.model)
                is_open = self._displacement.begin(memory.after_step, is_load=event.kind == LOAD_CHANGED)
                if event.kind == TOOL_DISPLACED and is_open:
                    event, memory.after_step.is_event[0] = event._replace(kind=TOOL_OR_CAMERA), 1.0
                self._widen(memory, event)
            elif verdict.has_drifted and weight > _CALM_WEIGHT:
                self._innovations.forget(innovations)
                self._displacement.begin(memory.after_step)
                if memory.was_settled[0]:
                    self._doubt(memory)
            elif verdict.is_calm and not memory.after_step.samples[0] and memory.count[0] % _KEEP_EVERY == 0:
                self._displacement.keep(memory.after_step, memory.P, memory.xi)
            elif memory.after_step.samples[0]:
                before = r + H @ (memory.xi - memory.after_step.xi_before)
                at = (H, J), pair.X_WE, memory.noise.weights
                found = self._displacement.found(memory.after_step, before, *at)
                if found in (CAMERA_MOVED, JOINTS_SHIFTED):
                    return self._take_back(memory, found, pair.X_WE)
                if found == TOOL_DISPLACED and memory.after_step.is_event[0]:
                    size = self._displacement.size(memory.after_step, found, pair.X_WE[:3, 3])
                    event = Event(found, size, size)
        if model.has_gear_errors and weight > _CALM_WEIGHT:
            shown = J, r, memory.noise.weights
            model.gear_errors.weigh(memory.against, *shown, pair.others)
            if self.gear_feedback.acts:
                unsure = H @ memory.P @ H.T, by_gears
                self.gear_feedback.hear(memory.loose, *shown, *unsure, pair.motion[:6], pair.time)
        if self._noise.hear(memory.noise, r, H, memory.xi, pair):
            self._weigh_anew(memory)
        seen_of_gears = self._unmodelled.joint_variances(memory.unmodelled, by_gears)[: len(by_gears)]
        noise = memory.noise.weights, J, samples_alike(period) * seen_of_gears
        self._take(memory, (r, gears, H), noise, pair, shapes, weight)
        if event is None and memory.count[0] % _LOOK_EVERY == _LOOK_EVERY // 2:
            event = self._look_at_suppositions(memory)
        return event

    def _take(
        self,
        memory: SimpleNamespace,
        innovation: tuple[np.ndarray, np.ndarray, np.ndarray],
        noise: tuple[np.ndarray, np.ndarray, np.ndarray],
        pair: Pair,
        shapes: np.ndarray | None,
        weight: float,
    ) -> None:
        """Adds a sample to the open keyframe, closes that if the robot has gone far enough, and solves.

        ``innovation`` is the error, the deflections of the gears and the columns; ``noise`` as of the kernel.
        """
        memory.count[0] += 1.0
        is_long = memory.samples[0] + 1.0 >= self._config.keyframe_samples
        since_first = self._since_first(memory, pair.time)
        seen = pair.theta, pair.motion, pair.twist, since_first, NO_SHAPES if shapes is None else shapes
        past, model = memory.keyframes, self.model
        known = memory.P, memory.taken, past.b, past.xi_sum, model.sigma, model.K.start
        limits = -1.0 if is_long or memory.count[0] in _CLOSE_AT else self._config.keyframe_step, _TRUST
        sample = *innovation, memory.xi, seen, noise, weight
        if kernels.information.take(*sample, open_keyframe(memory), known, limits):
            self._close(memory)

    def _look_for_foreign(self, memory: SimpleNamespace, H: np.ndarray) -> Event | None:
        """Finds out early that a camera of another frame teaches nothing."""
        if memory.count[0] > 0.0:
            return None
        event = self._innovations.foreign(memory.innovations, H)
        memory.is_foreign[0] = event is not None
        return event

    def _look_at_suppositions(self, memory: SimpleNamespace) -> Event | None:
        """Gives up what samples speak against."""
        memory.is_busy[0] = 1.0
        keyframes, is_settled = memory.keyframes, self._keyframes.is_settled(memory.keyframes, memory.xi)
        found = self._suppositions.look(memory.supposed, memory.P, keyframes.b + memory.b_open, is_settled)
        if found:
            self._keyframes.add(keyframes, found[1])
            self._solve(memory)
        return found and found[0]

    def work(self, memory: SimpleNamespace) -> None:
        """What can be done in a tick without a sample, or after its command is out: relinearise.

        A tick whose sample took long is left in peace, unless the one before was.
        """
        is_put_off = bool(memory.is_busy[0]) and not memory.is_behind[0]
        memory.is_busy[0], memory.is_behind[0] = 0.0, float(is_put_off)
        if is_put_off:
            return
        keyframes, tolerance = memory.keyframes, self._config.relinearise
        at = lambda: self.constants(memory), memory.xi, memory.noise.weights
        if self._keyframes.work(keyframes, *at, tolerance, lambda: self._suppositions.prior(memory.supposed)):
            self._solve(memory)
        elif memory.taken[0] > _INVERT_AFTER and keyframes.position[0] < 0.0:
            self._invert(memory)

    def _weigh_anew(self, memory: SimpleNamespace) -> None:
        """The camera turns out to be noisier or better: what it has shown so far weighs less or more."""
        self._innovations.use(memory.innovations, memory.noise.variances)
        self._unmodelled.rest(memory.unmodelled)
        if memory.samples[0]:
            self._close(memory)
        self._keyframes.begin_again(memory.keyframes)

    def _close(self, memory: SimpleNamespace) -> None:
        """Makes the open samples a keyframe."""
        if self._keyframes.close(memory.keyframes, self.constants(memory), memory.xi, open_keyframe(memory)):
            forget_open(memory)

    def _solve(self, memory: SimpleNamespace) -> None:
        """Finds the estimate that belongs to sums that are other ones than before."""
        # Half of the square of a step is what it leaves of samples that are known far better: small steps
        # from where the past was read keep to the curved set of parameters that explain it.
        self._invert(memory)
        sums, model = (memory.keyframes.b, memory.b_open, memory.keyframes.xi_sum), self.model
        kernels.information.estimate(memory.P, *sums, model.sigma, model.K.start, _TRUST, memory.xi)

    def _invert(self, memory: SimpleNamespace) -> None:
        """Works P out anew: each sample leaves a rounding error in it."""
        if self._keyframes.invert(memory.keyframes, memory.A_open, memory.P):
            memory.taken[0] = 0.0

    def _doubts(self, memory: SimpleNamespace, H: np.ndarray, J: np.ndarray, by_gears: np.ndarray) -> Doubts:
        memory.is_busy[0] = 1.0
        factor, by_model = self.variance_factor(memory), H @ memory.P @ H.T
        noise, by_model = factor * memory.noise.variances, max(1.0, factor) * by_model
        return doubts(noise, by_model, J, by_gears)

    def _doubt(self, memory: SimpleNamespace) -> None:
        """What was learnt does not hold where the robot is now: it weighs less, but no less than priors."""
        self._innovations.forget(memory.innovations)
        A = (np.linalg.inv(memory.P) + (_DOUBT**2 - 1.0) * self.model.prior) / _DOUBT**2
        P = np.linalg.inv(A) + self.model.displacement(_A_LITTLE, _A_LITTLE)
        self._begin_from(memory, np.linalg.inv(P), memory.xi)

    def _widen(self, memory: SimpleNamespace, event: Event) -> None:
        """Something happened: what was known stays, but for what may be displaced, and the load.

        A displaced tool leaves the load alone, unless that has not explained what came soon after it.
        """
        again = memory.count[0] - memory.event_at[0] < _AGAIN
        memory.event_at[0] = memory.count[0]
        is_load = event.kind == LOAD_CHANGED
        others = self.model.displacement(1.0, 0.0 if is_load else _A_LITTLE)
        self._open(memory, 1.0 if again or is_load else _OF_THE_LOAD, others)

    def open_load(self, memory: SimpleNamespace) -> None:
        """Takes what is known of the load back, and nothing else: the motors say that it may have changed."""
        self._innovations.forget(memory.innovations)
        self._unmodelled.rest(memory.unmodelled)
        memory.after_step.samples[0] = 0.0
        self._open(memory, 1.0, 0.0)

    def _open(self, memory: SimpleNamespace, share: float, others: np.ndarray | float) -> None:
        """Adds to the covariance of the unknowns: a share of the load's spread, and others, (n, n)."""
        model, load = self.model, np.zeros(self.model.size)
        P = memory.P + others
        load[model.M] = share * model.changed_load
        self._begin_from(memory, np.linalg.inv(P + np.diag(load**2)), memory.xi)

    def _take_back(self, memory: SimpleNamespace, found: str, X_WE: np.ndarray) -> Event:
        """It was not the tool: what was known before the step holds, but for the camera or for joints' zeros.

        The unknowns follow what a camera sees that was moved, as after a move of the base; see `CameraMoves`.
        """
        before, zeros = memory.after_step, self.model.joint_directions()
        if found == CAMERA_MOVED:
            A = self._camera.begin(memory.camera, before.A_before, before.xi_before)
        else:
            A = np.linalg.inv(np.linalg.inv(before.A_before) + zeros @ zeros.T)
        self._innovations.rest(memory.innovations)
        self._begin_from(memory, A, before.xi_before)
        return Event(found, self._displacement.size(before, found, X_WE[:3, 3]), 0.0)

    def _begin_from(self, memory: SimpleNamespace, A: np.ndarray, xi: np.ndarray) -> None:
        """Goes on with the information A about xi, and without keyframes."""
        memory.xi[:] = xi
        self._keyframes.reset(memory.keyframes, 0.5 * (A + A.T), memory.xi)
        memory.supposed.load[0] = 0.0
        forget_open(memory)
        self._invert(memory)
