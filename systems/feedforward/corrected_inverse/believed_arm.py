"""The forward model that is believed: gears with play and hysteresis, a structure that yields, a tip."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.motion import BETA, GAMMA, MotionCase, SensorPlace
from systems.feedforward.corrected_inverse.resting_places import MIDDLE, Resting, seen_places
from systems.feedforward.joint_motion import Standing

_UNLOADED = 1e-6  # rad: a gear that its load winds up by less has no load that holds it in its play
_CLOSE = 2  # steps from one inverse of the mass matrix to the next, for the hand is light and turns
_MOVING = 3  # axes whose play moves the tip noticeably
_PASSES = 6  # of a contraction: what load adds to springs is some hundredths of them


@dataclass(frozen=True)
class Course:
    """What an arm does in a motion; m samples of the tip, n unknowns."""

    tip: np.ndarray  # m, in the world, (m, 3)
    torque: np.ndarray  # N m, what motors have to hold, at all steps, (N, 6)
    derived: np.ndarray  # d(tip) / d(unknowns), (m, 3, n)


class BelievedArm:
    """An arm about one motion of its motors, which then move a little otherwise.

    Linear about the motion but for its gears, as `robots.identification.arm_along_motion` has it, and
    integrated as there. Motors move exactly as they are told: what drives and friction make of that is not
    in it.

    Attributes:
        unloaded: gears of axes 1 to 3 that may rest anywhere within their play before the motion, (6,).
    """

    def __init__(self, robot: RobotModel, payload: float, step: float, every: int) -> None:
        """Builds the arm.

        Args:
            robot: as it is believed.
            payload: mass at the flange in kg.
            step: of the integration in s.
            every: steps from one sample of the tip to the next.

        Raises:
            ValueError: if a spring is not linear, or a gear has a soft branch or more than one hysteresis.
        """
        trains = robot.drive_trains
        unused = SensorPlace("hand", "gyro", f"link_{NUM_JOINTS}", np.zeros(3), np.eye(3), 1.0, 1.0)
        self._arm = ElasticArm(robot, payload, [unused])
        parts = self._arm.parts
        hystereses = [train.hysteresis for train in trains.trains] if trains else []
        if (
            parts.stiffening_structure is not None
            or robot.stiffening_gears is not None
            or any(each is not None and len(each.stiffness) > 1 for each in hystereses)
            or (trains is not None and any(train.soft for train in trains.trains))
        ):
            raise ValueError(
                "feedforward corrected: its forward model knows linear springs, play and one hysteresis a "
                f"gear; {robot.name} has a stiffening or visco-elastic part, or several hystereses"
            )
        self._step, self._every, self._trains = step, every, trains
        self._springs = np.stack(
            [parts.sprung_stiffness, [joint.default_damping() for joint in parts.sprung]]
        )
        self._springs[:, :NUM_JOINTS] = robot.joint_stiffness, robot.joint_damping
        self._gears = np.zeros((NUM_JOINTS, 6))
        self._gears[:, :2], self._gears[:, 5] = self._springs[:, :NUM_JOINTS].T, 1.0
        if trains:
            self._gears[:, 2] = trains.half_gap
            self._gears[:, 3] = [train.lubricant for train in trains.trains]
        for gear, hysteresis in zip(self._gears, hystereses, strict=False):
            if hysteresis is not None:
                gear[4:] = hysteresis.stiffness[0], hysteresis.width[0]
        self._plant = parts.plant
        self.unloaded = np.zeros(NUM_JOINTS, dtype=bool)
        self._context = self._plant.CreateDefaultContext()  # scratch memory only: written before every use

    def set_motion(self, theta: np.ndarray, rate: np.ndarray) -> None:
        """Linearises about motors at theta (rad) with their rates (rad/s) at all steps, (N, 6) each."""
        h = self._step
        case = MotionCase("", h, theta, rate, np.zeros((len(theta), 1, 3)))
        motion = self._arm.along(case)
        knots = motion.knots
        close = np.union1d(knots, np.arange(knots[1], knots[-2], _CLOSE))
        whole = motion.mass + GAMMA * h * motion.coriolis + BETA * h * h * motion.stiffness
        own = np.diag(GAMMA * h * self._springs[1] + BETA * h * h * self._springs[0])
        knot = np.clip(np.searchsorted(knots, close, side="right") - 1, 0, len(knots) - 2)
        share = ((close - knots[knot]) / np.diff(knots)[knot])[:, None, None]
        inverse = np.linalg.inv((1.0 - share) * whole[knot] + share * whole[knot + 1] + own)
        levers = np.array([self._tip(theta[k], x, True)[1] for k, x in zip(knots, motion.rest, strict=True)])
        held = np.concatenate([motion.stiffness, motion.coriolis], axis=2)
        self._posture = knots, held, np.ascontiguousarray(motion.rest[:, None]), levers, close, inverse
        self._theta, self._load = theta, motion.load
        # Of the ratio, as if a turned motor were an uneven one: by how much the gears are ahead.
        ahead = np.zeros_like(theta)
        if self._trains is not None:
            ahead = np.array([self._trains.ratio_error(each) for each in theta])
        self._uneven = ahead, np.gradient(ahead, h, axis=0)
        carried, x = -motion.load[0], np.zeros(motion.load.shape[1])
        for _ in range(_PASSES):
            x = carried / self._springs[0]
            wound = x[:NUM_JOINTS]
            x[:NUM_JOINTS] += np.where(np.abs(wound) < _UNLOADED, 0.0, np.sign(wound)) * self._gears[:, 2]
            carried = -motion.load[0] - motion.stiffness[0] @ (x - motion.rest[0])
        self._at_rest = x
        self.unloaded = (np.abs(carried[:NUM_JOINTS] / self._springs[0, :NUM_JOINTS]) < _UNLOADED) & (
            self._gears[:, 2] > 0.0
        )
        self.unloaded[_MOVING:] = False

    def seen_resting(self, standing: Standing) -> tuple[Resting, ...]:
        """Where gears without load may rest before the motion, if the tip is seen there; `seen_places`."""
        x = self._at_rest.copy()
        x[:NUM_JOINTS] += self._uneven[0][0]
        p_WE, J = self._tip(standing.theta, x, True)
        half_gaps = np.where(self.unloaded, self._gears[:, 2], 0.0)
        return seen_places(standing.p_WE - p_WE, J[:, :NUM_JOINTS], half_gaps)

    def course(
        self,
        offset: np.ndarray,
        rate: np.ndarray,
        shapes: np.ndarray | None = None,
        resting: Resting = MIDDLE,
    ) -> Course:
        """What the arm does when the motors are off the motion.

        Args:
            offset, rate: of the motors in rad and rad/s at the first N steps, (N, 6) each.
            shapes: of which unknown shares are in the motions of motors 1 to 3, and their rates, (N, 2, c);
                None: nothing is unknown. Number 3 i + j of the unknowns belongs to shape i and motor j.
            resting: where gears without load begin, and how wide their play is.
        """
        from systems.feedforward.corrected_inverse import arm_kernel  # imports numba

        steps = len(offset)
        offset, rate = (own + each[:steps] for own, each in zip((offset, rate), self._uneven, strict=True))
        if shapes is None:
            shapes = np.zeros((steps, 2, 0))
        samples = np.arange(0, steps, self._every)
        moved, torque = np.empty((steps, len(self._at_rest))), np.zeros((steps, NUM_JOINTS))
        derived = np.zeros((len(samples), 3, arm_kernel.MOVED * shapes.shape[2]))
        start = self._at_rest.copy()
        start[:NUM_JOINTS] += offset[0]
        gears = self._gears.copy()
        gears[self.unloaded, 2] *= resting.play
        start[:NUM_JOINTS] += np.where(self.unloaded, np.multiply(resting.place, gears[:, 2]), 0.0)
        arm_kernel.go_through(
            self._step,
            self._posture,
            self._load[:steps],
            np.ascontiguousarray(np.stack([offset, rate], axis=1)),
            self._springs,
            gears,
            start,
            shapes,
            self._every,
            moved,
            torque,
            derived,
        )
        tip = np.array([self._tip(self._theta[k], moved[k])[0] for k in samples])
        return Course(tip, -torque, derived)

    def _tip(
        self, theta: np.ndarray, x: np.ndarray, is_moving: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where the tip is in m, (3,), and if it is asked for, d(tip) / d(turns of the sprung joints)."""
        q = np.zeros(self._arm.size)
        q[self._arm.motors] = theta
        q[self._arm.sprung] += x
        self._plant.SetPositions(self._context, q)
        frame, world = self._arm.parts.tool, self._plant.world_frame()
        p_WE = frame.CalcPoseInWorld(self._context).translation()
        if not is_moving:
            return p_WE, np.empty((3, 0))
        J = self._plant.CalcJacobianTranslationalVelocity(
            self._context, JacobianWrtVariable.kV, frame, np.zeros(3), world, world
        )
        return p_WE, J[:, self._arm.sprung]
