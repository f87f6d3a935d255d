"""Where the motors have to be so that the tip of the robot as it is known now is on the path."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from robots.pose import pose_error
from systems.estimation import kernels
from systems.estimation.arm_geometry import Arm, Constants
from systems.estimation.arm_loads import NUM_SETS
from systems.estimation.gears.gear_errors import BEFORE, NUM_MODELS, NUM_STATES
from systems.estimation.kernels.arrays import FollowerState, PathInstant, Planned
from systems.estimation.memory import Layout
from systems.estimation.tip_model import TipModel
from systems.reference.cartesian_path import OutOfReachError

_BLEND = 1.5  # s, in which the robot is led from where it starts onto the path
_NEWTON_STEP = 1e-5  # rad; what a step of this size leaves is its square
# m or rad, by which parameters move until the geometry is worked out anew. As it is, velocities go on by a
# share of this size, and torques are made of their differences in a tick: of 1e-4 drives felt each.
_GEOMETRY_STEP = 1e-6
_LOST = 0.02  # rad, a last step of Newton's method on an arm that is not on the path


class Wanted(NamedTuple):
    """The path at one instant, and a motion of the joints beside it."""

    X_WE: np.ndarray  # (4, 4)
    V_WE: np.ndarray  # (6,)
    aside: np.ndarray  # (3, 6), rad and its derivatives


class MotorPlan(NamedTuple):
    """Motion of the motors at one instant, and what it loads."""

    theta: np.ndarray  # (6,) rad
    velocity: np.ndarray  # (6,)
    acceleration: np.ndarray  # (6,)
    loads: np.ndarray  # (5, 18), as `ArmLoads.at` gives them
    motion: np.ndarray  # (12,), velocity and acceleration of the links
    twist: np.ndarray  # (6,), of the tip
    columns: np.ndarray  # (6, 18 + g), as `ArmGeometry.arm` gives them
    states: np.ndarray  # (18,), of the gears, see `GearErrors`
    others: np.ndarray  # (6, 6) rad, by how much links would be further ahead with each model of their gears
    ratios: np.ndarray  # (6,), speed of each joint for that of its motor, 1 but for the waves of its gear

    @property
    def on_motors(self) -> np.ndarray:
        """The loads of the gears as motors feel them, (5, 6): what turns faster takes more torque."""
        return self.loads[:, : len(self.ratios)] * self.ratios


class PreviewPlanner:
    """Inverts the estimated compliant robot on the path.

    Newton's method gives the joints q behind the gears at which a stiff arm of the estimated geometry would
    be on the path, from a prediction so close that one step mostly does. The motors are then at
    theta = q - J^-1 T phi - delta, less the errors of the gears, and ahead of that by what the damping of
    the gears holds back. Rates contain the motion of the parameters that are led in; loads do not, or they
    would feed back on themselves through the deflections: an algebraic loop, and an unstable one.
    """

    def __init__(self, model: TipModel, period: float) -> None:
        """Lays out the memory."""
        self._model, self._period = model, period
        self._gears = model.gear_errors.parts(model.lag[:6])
        self.layout = Layout(
            started=(1,),
            x_geometry=(model.size,),
            q=(6,),
            rates=(2, 6),  # of the last two instants, newest first
            wander=(6,),
            yields=(4, 6),  # newest first
            start_error=(6,),
            start_yield=(6,),
            gears=model.gear_errors.layout,
        )
        self._constants: Constants | None = None

    def constants(self, memory: SimpleNamespace, x: np.ndarray) -> Constants:
        """The geometry near x; a function of the memory alone, kept to save time."""
        self._constants = self._model.constants_near(x, memory.x_geometry, _GEOMETRY_STEP, self._constants)
        return self._constants

    def start(
        self, memory: SimpleNamespace, x: np.ndarray, theta: np.ndarray, X_WE: np.ndarray
    ) -> np.ndarray:
        """Takes note of where the robot stands; returns the Jacobian of the tip, (6, 6).

        Args:
            memory: of the layout.
            x: parameters that the plan begins with.
            theta: measured, rad, (6,).
            X_WE: where the path begins, (4, 4).
        """
        model, still = self._model, np.zeros((1, 6))
        memory.x_geometry[:] = x
        constants = self.constants(memory, x)
        frames = model.forward(constants, x, theta[None])[1].frames
        loads = model.loads.at(frames, theta[None], still, still)
        memory.q[:] = theta + model.deflections(x, loads)[0, :6]
        X, arm = model.forward(constants, x, memory.q[None])
        memory.start_error[:] = pose_error(X_WE, X[0])
        memory.start_yield[:] = 0.0
        yields, _ = self._yields(memory, arm, x, memory.q, loads)
        memory.start_yield[:] = theta - memory.q - yields
        memory.yields[:] = theta - memory.q
        memory.rates[:] = memory.wander[:] = 0.0
        memory.started[0] = 1.0
        return arm.columns[0, :, :6]

    def _yields(
        self, memory: SimpleNamespace, arm: Arm, x: np.ndarray, q: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """By how much motors have to be ahead of links at q, rad, (6,); and the gears' states, (18,)."""
        columns = arm.columns[0]
        deflection = self._model.deflections(x, loads)[0]
        tilt = columns[:, 6:18] @ deflection[6:]
        yields = -np.linalg.solve(columns[:, :6], tilt) - deflection[:6]
        return self._with_gear_errors(memory, x, q, yields, loads[0])

    def _with_gear_errors(
        self, memory: SimpleNamespace, x: np.ndarray, q: np.ndarray, yields: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """By how much motors are ahead at first, rad, and the states of gears, from the yields of springs."""
        model = self._model
        if not model.has_gear_errors:
            return yields, np.zeros(NUM_STATES)
        springs = model.gear_errors.springs(x[model.K][:6], x[model.E].reshape(-1, 6))
        states = model.gear_errors.step(memory.gears, springs, model.total_load(x, loads)[:6], 0.0)
        shapes = model.gear_shapes(q + yields, states)
        return yields - model.gear_error(x, shapes), states

    def step(
        self,
        memory: SimpleNamespace,
        parameters: tuple[np.ndarray, np.ndarray],
        wanted: Wanted,
        since_start: float,
        step: float,
        likely: np.ndarray = BEFORE,
    ) -> MotorPlan:
        """Plans one instant.

        Args:
            memory: of the layout, after `start`.
            parameters: in use now, and their rates.
            wanted: the path at this instant.
            since_start: s.
            step: s since the last instant that was planned.
            likely: how likely each model of the gears is, (6, 6).

        Raises:
            OutOfReachError: if the robot as it is known does not reach the path there.
        """
        x, rate = parameters
        model = self._model
        constants = self.constants(memory, x)
        moment = wanted.X_WE, wanted.V_WE, *_blend(since_start), rate[model.G], wanted.aside
        instant = PathInstant(*moment, float(step), _NEWTON_STEP, likely)
        state = FollowerState(
            memory.q,
            memory.rates,
            memory.wander,
            memory.start_error,
            memory.start_yield,
            memory.yields,
            memory.gears.state,
            memory.gears.shares,
        )
        motion, moving, loads = np.empty((4, 6)), np.empty((3, 6)), np.empty((NUM_SETS, 18))
        columns, states = np.empty((6, len(constants.frame))), np.zeros(NUM_STATES)
        ratios, others = np.empty(6), np.zeros((NUM_MODELS, 6))
        planned = Planned(motion, moving, loads, columns, states, others, ratios)
        arm = constants, model.loads.masses, model.unknowns(x), self._gears
        if not kernels.plan.plan(*arm, instant, state, planned) < _LOST:
            raise OutOfReachError(
                "the robot as it is known now does not reach its path here: the arm is stretched"
            )
        theta, velocity, acceleration, twist = motion
        links = moving[1:].ravel()
        return MotorPlan(theta, velocity, acceleration, loads, links, twist, columns, states, others, ratios)


def _blend(since_start: float) -> tuple[float, float]:
    """What is left of the way from the start onto the path, and how fast it goes away, per s."""
    s = min(1.0, max(0.0, since_start / _BLEND))
    return 1.0 - s**3 * (10.0 - s * (15.0 - 6.0 * s)), -30.0 * s * s * (1.0 - s) ** 2 / _BLEND
