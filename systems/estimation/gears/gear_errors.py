"""What gears add to the angle of a joint beyond their springs, as linear columns: waves, gap, hysteresis."""

from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel
from systems.estimation import kernels
from systems.estimation.kernels.arrays import Gap, Gears
from systems.estimation.memory import Layout

# Of each joint: two waves with sine and cosine each, hysteresis, an open gap, and one that it holds.
SHAPE_NAMES = "sine_1", "cosine_1", "sine_2", "cosine_2", "hysteresis", "gap", "held_gap"
NUM_SHAPES = len(SHAPE_NAMES)
NUM_STATES = 3 * NUM_JOINTS  # the last three shapes of each joint
# All assumed, as what gears have: a sixth of an arc minute of play at least; grease of 40 N m s/rad in it,
# and where the robot's is a quarter or four times as much, the tip is as near to its path to a hundredth of a
# millimetre; and beside the teeth a hysteresis of a tenth of the gear's stiffness. Where there is none the
# other column fits, where there is half of it the mean of both. Within how many rad it turns over differs:
# one of three is near, the least where gears shake, whose elements turn over sooner than those at rest. And
# play that is large for what loads bend, as half an arc minute is in wrists, is not found from a sixth.
_WIDTHS, _HALVES = (3.5e-4, 7e-4, 1.4e-3), (2.5e-5, 8e-5)  # rad
_GAP = Gap(
    least=0.2,
    grease=40.0,
    held=0.1,
    widths=np.tile(_WIDTHS, len(_HALVES)),
    halves=np.repeat(_HALVES, len(_WIDTHS)),
)
NUM_MODELS = len(_GAP.widths)
# How likely each model of each joint is before anything is seen, (6, 6), assumed.
BEFORE = np.outer([4.0, 2.0, 2.0, 2.0, 1.0, 1.0], np.full(NUM_JOINTS, 1.0 / 12.0))
# Of what a sample says about models: those of a crossing, some dozens, are off together when it comes early.
_ONE_IN = 10.0
USUAL = 4.0  # standard deviations of the camera; where it shows more, that is no gear's doing
_KEPT = 1.0 - 1.0 / 5000.0  # of what speaks against models, from one sample to the next
# Of the spread, how large an open gap may be. Until a load has turned over slowly nothing tells it from one
# that is held, and then a held one is the better guess.
OPEN = 0.3
_OTHERWISE = 0.1  # of the size of gear errors, what they have of other shapes than these; assumed


class GearErrors:
    """Shapes of which a gear's error is a sum, each between -1 and 1 or, of hysteresis, some times as much.

    Sine and cosine of one and of two turns of the motor for the uneven ratio; a state of Dahl's model, driven
    by how far the gear yields, for hysteresis; and where the teeth are in their gap, twice. A load pushes
    them through it against the grease until they lie against a side, and they stay there without one. But
    what makes the hysteresis stands beside the teeth and carries in the gap, too: where a load turns over
    slowly it decides when they cross, tenths of a second before or after an open gap. How much it carries is
    in the mixture of both.

    The turn within which hysteresis turns over and the play are no linear parameters. So models of each gear
    with several of both are carried along, and count by how likely they are after what a camera has shown.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Reads gear ratios and springs."""
        self._ratio = np.asarray(robot.gear_ratio, dtype=float)
        self._compliance = 1.0 / np.asarray(robot.joint_stiffness, dtype=float)
        models = (NUM_MODELS, NUM_JOINTS)
        self.layout = Layout(started=(1,), state=(1 + 3 * NUM_MODELS, NUM_JOINTS), shares=models)

    def parts(self, lag: np.ndarray) -> Gears:
        """Gears as compiled functions take them; ``lag`` is that of their damping in s, (6,)."""
        return Gears(self._ratio, self._compliance, lag, _GAP)

    def springs(self, factors: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Compliance in rad per N m and half of the play in rad of gears as they are known, (2, 6).

        Args:
            factors: of the compliance that the robot's file says, (6,).
            sizes: of the shapes in rad, (7, 6).
        """
        return kernels.gears.springs(self._compliance, _GAP, factors, sizes)

    def step(
        self, memory: SimpleNamespace, springs: np.ndarray, torque: np.ndarray, duration: float
    ) -> np.ndarray:
        """Loads the gears for a time; returns their states, (18,), the last three shapes of each joint.

        At first the teeth lie where the load has them, and the hysteresis is relaxed.

        Args:
            memory: of the layout. Its ``shares`` (6, 6) say how much models count, `BEFORE` if they are zero.
            springs: as of `springs`, (2, 6). How far they bend decides how far the hysteresis turns over.
            torque: in N m, (6,).
            duration: in s.
        """
        is_first = memory.started[0] == 0.0
        kernels.gears.step(springs, _GAP, torque, float(duration), is_first, memory.state)
        if not memory.shares.any():
            memory.shares[:] = BEFORE
        memory.started[0] = 1.0
        states = np.empty(NUM_STATES)
        kernels.gears.mix(_GAP, memory.state, memory.shares, states)
        return states

    @staticmethod
    def weigh(
        against: np.ndarray, J: np.ndarray, r: np.ndarray, weights: np.ndarray, others: np.ndarray
    ) -> None:
        """Renews what speaks against each model of each gear, after one sample of the camera.

        Args:
            against: half of the squared errors that it would have had more, in variances, (6, 6); is renewed.
            J: Jacobian of the tip, (6, 6), rotation first.
            r: how far the tip was seen from where it was predicted, (6,).
            weights: of the camera, one over variances, (6,).
            others: by how much links would be further ahead with each model, rad, (6, 6), see `MotorPlan`.
        """
        kernels.gears.weigh(J, r, weights, others, (USUAL, 1.0 / _ONE_IN, _KEPT), against)

    @staticmethod
    def likely(against: np.ndarray) -> np.ndarray:
        """How likely each model of each gear is, (6, 6), columns are joints, after what speaks against it."""
        likely = np.empty_like(BEFORE)
        kernels.gears.believe(BEFORE, against, likely)
        return likely

    def variances(
        self,
        sizes: tuple[np.ndarray, np.ndarray],
        states: np.ndarray,
        torque: tuple[np.ndarray, np.ndarray],
        spread: float,
    ) -> np.ndarray:
        """What the shapes may be off by, rad^2, (6,).

        Which side teeth lie against is as uncertain as what pushes them there: the load, as well as it is
        known, and half of what the hysteresis carries, give or take as much as it carries, since how much of
        it stands beside the teeth is not known, and what its spring takes up while they cross. Their
        position, between -1 and 1, is expected at e, with the variance 1 - e^2 about it, and is off by
        (s - e)^2 + 1 - e^2 from where the model has it, s. That times the square of half of the gap, which
        may be wide before teeth have crossed it, since nothing shows it until then.

        Args:
            sizes: of the shapes in rad, (7, 6), and their variances.
            states: as `step` gave them.
            torque: of the gears in N m, (6,), and its variances.
            spread: of the sizes, as it was believed before, rad.
        """
        least, out = (_OTHERWISE * spread) ** 2, np.empty(NUM_JOINTS)
        kernels.gears.variances(self._compliance, _GAP, sizes, states, torque, least, out)
        return out

    def shapes(self, theta: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The shapes at motor positions in rad (6,), shape (7, 6).

        Args:
            theta: motor positions on the link side of the gear.
            states: as `step` gave them.
        """
        out = np.empty((NUM_SHAPES, NUM_JOINTS))
        kernels.gears.shapes(self._ratio * theta, states, out)
        return out
