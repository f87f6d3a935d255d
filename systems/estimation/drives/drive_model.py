"""What the motors make of commands: known up to factors, which their encoders show."""

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from robots.description.error_parameters import NUM_PARAMETERS
from robots.dynamics.friction_line import friction_line
from systems.controller_model import ControllerModel
from systems.estimation import kernels
from systems.estimation.arm_geometry import ArmGeometry
from systems.estimation.arm_loads import ArmLoads
from systems.estimation.drives.drive_config import DriveModelConfig
from systems.estimation.drives.drive_gains import FACTORS, believed_gains, cascade_gains, straight_inertia
from systems.estimation.drives.gain_search import TORQUES, Gains, GainSearch
from systems.estimation.kernels import drive_columns as at
from systems.estimation.kernels.arrays import DriveMemory, Drives
from systems.estimation.memory import Layout

DEAD_TIME, MASS, SMOOTHED, SIZE = at.DEAD_TIME, at.MASS, at.SMOOTHED, at.SIZE
MOMENT, OTHER_GAINS = (slice(k, k + 3) for k in (at.MOMENT, at.OTHER_GAINS))
_ROTORS, _VISCOUS, _COULOMB, _HUMPS = (
    slice(at.FRICTION + k, at.CONSTANT, at.OF_FRICTION) for k in range(at.OF_FRICTION)
)
_CONSTANTS, SHARP, NOT_HELD, GIVING, THIRD = (
    slice(k, k + 6) for k in (at.CONSTANT, at.SHARP, at.NOT_HELD, at.GIVING, at.THIRD)
)
REGRESSORS = at.NUM_ROWS, 6  # the shape of what `DriveModel.features` takes
# Of these, how a planner smooths, and how fast commands leave the plan
LATE = slice(at.ROW_SMOOTHED, at.ROW_RATE + 1)
# Of Coulomb's friction, the spread of what there may be more of it; less where it is learnt early, or the
# first lap of robots without a hump is twisted more
_HUMP, _EARLY_HUMP = 0.3, 0.1
_SLOW = 0.05  # rad/s, of Stribeck's effect, exp(-|v| / _SLOW) as Tustin has it; assumed
# The spreads of how much of Coulomb friction turns over more sharply than believed, in all joints alike and
# in one beside the others: all have bearings and seals of a kind, and one stop of one shows it
_SHARPER, _SHARPER_ALONE = 6.0, 0.6
_WITHIN_A_THIRD = 0.7  # likewise of what turns over neither as gently as believed nor at once
# kg that the robot's controller may not hold, or hold too much, of a robot that carries 7 kg: of all joints
# alike, and of one beside the others, as it may have other gains for the load that it was told
_UNTOLD, _UNTOLD_ALONE = 5.0, 3.0
_GIVES = 1.0  # share by which drives may give way more or less for that reason
_OTHERWISE = 0.12  # share of what other gains would make of it, in all joints alike
_DOUBT = 30.0  # times what a motor was off by while it hung: by that its following error may be due to it
_ROTOR_SPREAD = 0.3  # of what a robot's file says of rotors
_VISCOUS_SPREAD, _COULOMB_SPREAD = 0.3, 0.5  # likewise of friction
_MOVED = 2e-4  # rad, slack of a joint whose motor is off by friction more than by all else; assumed
_BY_TORQUE = 1e-3  # rad, slack of a joint whose friction torques take over if it sticks
_SLACK = 0.3  # of Coulomb's friction, by which it may be off while little is known of it
_STEEPEST = 0.5  # rad/s, what learning may add to the speed of a joint
_RESTS = {"cascade": 1e-5, "velocity": 1e-5, "position": 3e-5}  # rad, where a motor rests beside its command
_OF_ACCELERATION = 0.9  # share of a joint's largest acceleration that commands may have
_LED_IN = 40.0  # rad/s, with which commands follow what was learnt, critically damped


class DriveCommand(NamedTuple):
    """What to tell the drives."""

    position: np.ndarray  # (6,) rad
    velocity: np.ndarray  # (6,) rad/s
    torque: np.ndarray  # (6,) N m, joint side, on top of what the drives do for gravity
    beside: np.ndarray  # (6,) rad, of the position what is beside the plan because of what was learnt
    regressors: np.ndarray  # (17, 6), what `DriveModel.features` needs of this instant
    torques: np.ndarray  # (9, 6) N m, what `GainSearch.follow` takes


class DriveModel:
    """Following errors of the motors as a linear model of the planned motion.

    A drive is e = G w: the torque w that a motion needs and nobody gives it leaves the motor behind by e,
    with k_d e' + k_p e + k_i int e dt = w. The model is e = Phi beta with columns for a shared dead time, a
    lag and an inertia of each joint, the torques of rotor, viscous and Coulomb friction, of its hump at low
    speeds and of how much more sharply it turns over through G, a constant, and the load of a kilogram and of
    its first moment through G; beta is learnt by recursive least squares.
    Without the moment friction is taken for what a payload whose centre is elsewhere weighs at the wrist:
    both turn over with the motion. Mass and moment in it make up for all that loads are wrong by. They are
    not those of the payload, and nobody else may take them for that. What load the robot's controller was
    told, and holds against gravity, may be another one than the robot carries and than anybody believes: a
    kilogram that is not held is a column of its own, of each joint, as the gains of drives follow that load.
    For the same reason they may give way more or less to all that a motion needs, where no torque is sent.
    Nor are the gains of a robot's controller known. A cascade makes G = s / (k_d (s + p) (s + i)) with the
    gain p of its position loop and the inverse i of its integral action time: columns of their own say by
    what e differs where that is i / 2, 2 i or 0.6 p, for the torques that nobody gives; where torques are
    taken also for what was learnt of rotors and friction. Where gains are far from what is believed,
    `GainSearch` finds others, see `prepare_gains` and `take_gains`.

    Where drives take torques, these are sent ahead by the dead time that was learnt, as positions are; of
    Coulomb friction, which turns over in an instant, its mean over the period that they will last. What was
    learnt of rotors and friction positions make up for, and torques after `give_by_torque`. Where they are
    not taken, commands run ahead of the plan by G w, which is late, too: to the speed of the plan belongs the
    rate of G w. And the planner of the robot's controller is between, which follows references with a gain
    and may smooth their speeds, by a time T, as that of EGM does: it is behind by T a / (s + gain).
    Cascades that take torques have the same column, with the gain p of their position loop: they may know
    their speed late, by a time -T, as encoders' steps are filtered, and push until p holds against it.
    """

    def __init__(
        self,
        model: ControllerModel,
        config: DriveModelConfig,
        kind: str = "cascade",
        has_play: bool = False,
    ) -> None:
        """Works out the gains of the drives and the filter G for one period.

        Args:
            model: what is believed.
            config: gains and spreads.
            kind: of the drives, ``"cascade"``, ``"position"`` or ``"velocity"``. Where they take no torques,
                a robot's own controller is between, and has a cascade.
            has_play: whether gears may have gaps: then links do not follow small motions of their motors.
        """
        robot, period = model.robot, model.period
        kind = kind if model.takes_torque else "cascade"
        self._config = config
        payload = min(model.payload, robot.payload.largest_mass)
        gains = believed_gains(robot, payload, config, kind, period)
        coulomb, viscous = friction_line(robot)
        self._drives = Drives(
            robot.reflected_inertia,
            robot.reflected_inertia if has_play else straight_inertia(robot, payload),
            viscous,
            coulomb,
            robot.coulomb_velocity,
            _SLACK * coulomb / gains.kp,
            _SLOW,
            *gains,
            period,
            payload,
            model.takes_torque,
            config.position if model.takes_torque else config.following,
            _OF_ACCELERATION * robot.acceleration,
        )
        self._found = self._drives  # kept to save time, see `_as_found`
        self._rings = kind == "position"
        self._gains = config.position, config.integral
        self.finds_gains = kind == "cascade"
        self.search = GainSearch(gains, *self._gains, model.load_scale, period, model.takes_torque)
        self._moved_by_friction = self._drives.slack > _MOVED
        self.is_fed_back = bool(self._moved_by_friction.any()) or not (model.takes_torque or has_play)
        # The arm as the drives know it, which hold it against gravity.
        drawn = ArmGeometry(robot, np.array([], dtype=int))
        self._held = drawn.constants(np.zeros(NUM_PARAMETERS)), ArmLoads(robot).masses
        spread = [config.dead_time_sigma, *[config.lag_sigma] * 6, *[1e-4] * 6]
        self._scale, self._moment = model.load_scale, config.moment_sigma * model.load_scale
        spread += [_ROTOR_SPREAD, _VISCOUS_SPREAD, _COULOMB_SPREAD, 0.0] * 6 + [_RESTS[kind]] * 6
        # Drives that take torques without a cascade are not known by such a time.
        of_cascade = config.speed_lag_sigma if model.takes_torque else config.smoothing_sigma
        late = of_cascade if kind == "cascade" else 0.0
        spread += [config.payload_sigma * self._scale] + [self._moment] * 3 + [late]
        spread += [0.0] * 12 + [0.0 if model.takes_torque else _GIVES] * 6 + [_OTHERWISE] * 3 + [0.0] * 6
        self._prior = np.diag(np.array(spread) ** 2)
        self._prior[NOT_HELD, NOT_HELD] = self._scale**2 * (_UNTOLD**2 + _UNTOLD_ALONE**2 * np.eye(6))
        sets = len(FACTORS)
        gains_layout = Layout(slack=(6,), kp=(6,), ki=(sets, 6), kd=(6,), step=(sets, 6, 2, 4), factors=(2,))
        self.layout = Layout(
            started=(1,),
            z=(len(FACTORS), at.NUM_TORQUES, 6, 2),  # integral of e, and e
            w=(at.NUM_TORQUES, 6),
            beta=(SIZE,),
            led=(2, SIZE),  # beta as commands use it, and its rate
            P=(SIZE, SIZE),
            correction=(6,),
            smoothed=(6,),
            misfit=(6,),  # rad^2, mean square of what is left of following errors beyond P, fading
            hung=(2, 6),  # rad, by which motors were off when they were slow, fading, and are if they are
            deviation=Layout(  # of `deviate`
                faster=(6,), accelerated=(6,), last=(6, 6), z=(6, 6, 2), out=(6, 6)
            ),
            wound=(3, 6),  # of what drives wound up meanwhile: integral and error; for how long, s
            aside=(3, 6),  # rad and rad/s, of commands what is beside the plan, see `DriveMemory`
            by_torque=(3, 6),  # likewise: of what was learnt what torques make up for
            gains=gains_layout,
            coming=gains_layout,  # gains that were found and not taken yet; factors of 0: there are none
        )

    def shares_fed_back(self, memory: SimpleNamespace) -> np.ndarray:
        """By which share what motors are off by may be fed back, (6,), see `MotorFeedback`.

        All of it where friction moves a motor first of all, and shows it. Where no torques are sent, what is
        commanded in their place goes through a controller that nobody knows well: as far as the rotor has
        become known, without which a motor rings with its drive, and feedback, late as it is, adds to it.
        Of other motors nothing: what was learnt leaves little, less than what gears with play err by.
        """
        shares = self._moved_by_friction.astype(float)
        if self.is_fed_back and not (self._drives.takes_torque or shares.any()):
            sigma = np.sqrt(memory.P[_DIAGONAL[_ROTORS], _DIAGONAL[_ROTORS]])
            shares = np.maximum(0.0, 1.0 - sigma / _ROTOR_SPREAD)
        return shares

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is believed before anything moves."""
        memory.P[:] = self._prior
        gains, drives = memory.gains, self._drives
        gains.slack[:], gains.kp[:], gains.ki[:], gains.kd[:] = drives.slack, drives.kp, drives.ki, drives.kd
        gains.step[:], gains.factors[:] = drives.step, 1.0

    def command(
        self,
        memory: SimpleNamespace,
        motion: tuple[np.ndarray, np.ndarray, np.ndarray],
        loads: np.ndarray,
        mass: float,
    ) -> DriveCommand:
        """What to command so that the motors move as planned.

        Args:
            memory: of the layout.
            motion: planned position, velocity and acceleration of the motors, (6,) each.
            loads: of the gears as motors feel them, (5, 6) or wider, in the order of `ArmLoads.at`.
            mass: of the payload as the drives' own gravity compensation has it in kg.
        """
        filters = memory.started, memory.z, memory.w
        known = DriveMemory(
            *filters,
            memory.beta,
            memory.led,
            memory.correction,
            memory.smoothed,
            memory.hung,
            memory.wound,
            memory.aside,
            memory.by_torque,
        )
        out, regressors = np.empty((4, 6)), np.empty(REGRESSORS)
        limits = _LED_IN, _STEEPEST
        drives = self._as_found(memory)
        kernels.drives.command(drives, *self._held, known, motion, loads, mass, limits, out, regressors)
        position, velocity, torque, beside = out
        searched = memory.w[_SEARCHED]
        if drives.takes_torque:
            searched[0] = 0.0  # all that is needed is sent
        return DriveCommand(position, velocity, torque, beside, regressors, searched)

    def features(self, v: np.ndarray, a: np.ndarray, regressors: np.ndarray) -> np.ndarray:
        """The equations of six joints, (6, 75), from motion and regressors (17, 6)."""
        Phi = np.zeros((6, SIZE))
        kernels.drives.features(v, a, regressors, Phi)
        return Phi

    def deviate(self, memory: SimpleNamespace, v: np.ndarray) -> None:
        """Goes on by a period to an instant at which motors moved otherwise than planned.

        Nothing is made of it for drives that follow positions alone, which ring faster than differences of
        positions show.

        Args:
            memory: of the layout, whose ``deviation`` says by how much motors were ``faster`` and
                ``accelerated`` more, rad/s and rad/s^2, (6,) each.
            v: planned speeds, rad/s, (6,).
        """
        parts = memory.deviation
        if not self._rings:
            of_motion = v, parts.faster, parts.accelerated
            kernels.drives.deviate(self._as_found(memory), *of_motion, parts.last, parts.z, parts.out)

    @staticmethod
    def needed_beyond(memory: SimpleNamespace) -> np.ndarray:
        """The torques in N m that this needed beyond those planned, in the order of `TORQUES`, (9, 6)."""
        needed = np.zeros((len(TORQUES), 6))
        needed[_DEVIATING] = memory.deviation.last[:4]
        return needed

    def look_back(
        self,
        memory: SimpleNamespace,
        planned: tuple[np.ndarray, np.ndarray, np.ndarray],
        regressors: np.ndarray,
        beside: np.ndarray,
        actual: np.ndarray,
        most: float = np.inf,
    ) -> float:
        """Learns what the motors have to say of an instant that was planned.

        Args:
            memory: of the layout.
            planned: position, velocity and acceleration, (6,) each.
            regressors, beside: of the command of that instant, (17, 6) and (6,) in rad.
            actual: where the motors were, rad, (6,).
            most: nothing is learnt if more than this is not explained yet, rad; of a joint with much friction
                for the stiffness of its drive that much more.

        Returns:
            The most that was not explained before, beyond what friction may do, in rad.
        """
        known = memory.hung, memory.misfit, memory.P, memory.beta
        weighing = self._config.following_sigma**2, _DOUBT, most
        then = planned, beside, regressors, actual, memory.deviation.out, memory.deviation.faster
        return kernels.drives.look_back(self._as_found(memory), *then, *known, weighing)

    def learn(self, memory: SimpleNamespace, Phi: np.ndarray, y: np.ndarray) -> None:
        """One step of recursive least squares: the motors were y behind a plan without correction, (6,)."""
        variances = np.full(len(y), self._config.following_sigma**2)
        fading = math.exp(-self._drives.period / kernels.drives.MATCHED)
        kernels.drives.learn(memory.P, memory.beta, Phi, y, variances, memory.misfit, fading)

    def open_low_speeds(self, memory: SimpleNamespace, is_early: bool = False) -> None:
        """From now on friction at low speeds may be another one than believed.

        It may have a hump, and it may turn over more sharply. Friction goes by the speed of a motor, and in
        the model by the planned one. As long as motors are far off their plan, it turns over at other times,
        and a hump would be what makes up for that.

        Args:
            memory: of the layout.
            is_early: whether motors have only come to their plan: then humps only of joints whose friction
                moves them by more than they are known to be off, where without a hump other parameters would
                have to make up for it.
        """
        P, humps, spread = memory.P, _DIAGONAL[_HUMPS], _HUMP
        if is_early:
            humps, spread = humps[self._drives.slack > self._config.following_sigma], _EARLY_HUMP
        humps = humps[P[humps, humps] == 0.0]
        P[humps, humps] = spread**2
        if not P[SHARP, SHARP].any():
            P[SHARP, SHARP] = _SHARPER**2 + _SHARPER_ALONE**2 * np.eye(6)
            P[THIRD, THIRD] = _WITHIN_A_THIRD**2 * (1.0 + np.eye(6))
            # Until now they had to make up for friction that turns over sharply.
            P[_DIAGONAL[_VISCOUS], _DIAGONAL[_VISCOUS]] += _VISCOUS_SPREAD**2
            P[_DIAGONAL[_COULOMB], _DIAGONAL[_COULOMB]] += _COULOMB_SPREAD**2

    def give_by_torque(self, memory: SimpleNamespace) -> None:
        """Has torques take over what was learnt of motors that friction moves by far, once they stick.

        Before, positions make up for it, which show gains. Drives that take no torques go on so.
        """
        begins = (self._drives.slack > _BY_TORQUE) & (memory.by_torque[0] == 0.0)
        memory.by_torque[0, begins & self._drives.takes_torque] = kernels.drives.WAITING

    def widen(
        self, memory: SimpleNamespace, is_told_otherwise: bool = False, is_on_path: bool = True
    ) -> None:
        """Load or dead time have changed: constants, payload and dead time are open again.

        Args:
            memory: of the layout.
            is_told_otherwise: whether the load that the drives hold may not be as believed either.
            is_on_path: whether commands must not leap: then they go on as they were learnt meanwhile.
        """
        P = memory.P
        if is_told_otherwise:
            # Motors were off their plan by that load, which stood in for gains, and friction turned over when
            # nobody thought it did: but for the dead time all that was learnt until now is in doubt.
            self._doubt(memory, keeps_beta=is_on_path)
        extra = np.zeros(SIZE)
        extra[_CONSTANTS], extra[MASS], extra[DEAD_TIME] = 3e-5, 5.0 * self._scale, 1e-3
        extra[MOMENT] = 5.0 * self._moment  # of 7 kg that are gripped 50 mm away
        P[_DIAGONAL, _DIAGONAL] += extra**2

    def prepare_gains(self, memory: SimpleNamespace, found: Gains) -> None:
        """Works out what `take_gains` takes."""
        coming, believed = memory.coming, self._drives
        position, integral = self._gains[0] * found.position, self._gains[1] * found.integral
        gains = cascade_gains(believed.kd / found.give, position, integral, believed.period)
        coming.kp[:], coming.ki[:], coming.kd[:], coming.step[:] = gains
        coming.slack[:] = believed.slack * believed.kp / gains.kp
        coming.factors[:] = found.position, found.integral

    def take_gains(self, memory: SimpleNamespace) -> float:
        """Goes on with other gains, and learns the rest anew. The robot is at rest, as motors then are.

        Returns:
            How many times as far as believed motors give way to a torque that changes slowly, their mean.
        """
        gains = memory.gains
        gains.all[:] = memory.coming.all
        memory.coming.factors[:] = 0.0
        # What motors are still behind by goes on from there, or commands would leap.
        memory.z[..., 0] = (memory.w - gains.kp * memory.z[..., 1]) / gains.ki[:, None]
        deviation = memory.deviation
        deviation.z[..., 0] = (deviation.last - gains.kp * deviation.z[..., 1]) / gains.ki[0]
        self._doubt(memory, keeps_beta=False)
        self.open_low_speeds(memory, is_early=True)
        return float((self._drives.ki[0] / gains.ki[0]).mean())

    def _doubt(self, memory: SimpleNamespace, keeps_beta: bool) -> None:
        """Takes back what was learnt but for the dead time, or only how well that is known."""
        late, variance = memory.beta[DEAD_TIME], memory.P[DEAD_TIME, DEAD_TIME]
        memory.P[:] = self._prior
        memory.P[DEAD_TIME, DEAD_TIME] = variance
        if not keeps_beta:
            memory.beta[:] = 0.0
            memory.beta[DEAD_TIME] = late

    def _as_found(self, memory: SimpleNamespace) -> Drives:
        """What is believed of the drives, with gains as they were found."""
        if not self.finds_gains:
            return self._drives
        gains = memory.gains
        if self._found.slack is not gains.slack:  # windows of the memory, as good as new in the next tick
            parts = {"slack": gains.slack, "kp": gains.kp, "ki": gains.ki, "kd": gains.kd, "step": gains.step}
            self._found = self._drives._replace(**parts)
        return self._found


_DIAGONAL, _SEARCHED = np.arange(SIZE), np.array(TORQUES)
# In all, of the rotor, of viscous and of Coulomb friction
_DEVIATING = [TORQUES.index(w) for w in (at.W_MISSING, at.W_ROTOR, at.W_VISCOUS, at.W_COULOMB)]
