"""Which error parameters a measurement of the tool can tell apart, and on which of these the others lie."""

from dataclasses import dataclass

import numpy as np

from robots.calibration.error_model import ErrorModel
from robots.calibration.prior import parameter_sizes
from robots.calibration.reduction import TOLERANCE, independent_columns
from robots.description.error_parameters import NUM_PARAMETERS, parameter_names
from robots.description.model import RobotModel
from robots.kinematics.error_kinematics import ErrorKinematics

_CONFIGURATIONS = 200  # random ones; 24 would do for 48 columns, the rest makes the gap wide
# What a column adds to those before it, as a share of its length, if it is independent of them. Less than
# that is added where axes miss each other by 0.1 mm, as in files made from drawings: it lies on columns that
# follow, or no measurement shows it, and of an error of 6 mm less than a micrometre is lost.
_INDEPENDENT = 1e-4
_NEGLIGIBLE = 1e-9  # a coefficient below this is rounding, and so is a column, as a share of the longest


@dataclass(frozen=True)
class IdentifiableParameters:
    """The error parameters, divided into those to identify and those that lie on them.

    To first order the columns of the regressor obey Theta[:, dependent] = Theta[:, independent] combination,
    so that an error in a dependent parameter looks like errors in independent ones, Probst (2024) eq. (2.55)
    and table 2.2, corrected: there Theta_un and Theta_ab have changed places.
    """

    names: tuple[str, ...]  # of all 48
    independent: np.ndarray  # (rank,) indices into the 48
    dependent: np.ndarray  # (48 - rank,) indices into the 48
    combination: np.ndarray  # (rank, 48 - rank), SI units

    @property
    def rank(self) -> int:
        """How many parameters can be identified."""
        return len(self.independent)

    def reduce(self, p: np.ndarray) -> np.ndarray:
        """Base parameters: the same tool to first order with the dependent parameters zero, shape (48,)."""
        reduced = np.zeros(NUM_PARAMETERS)
        reduced[self.independent] = p[self.independent] + self.combination @ p[self.dependent]
        return reduced

    def explain(self) -> dict[str, dict[str, float]]:
        """For each dependent parameter its share in independent ones, by name, in SI units."""
        shares = {}
        for column, index in enumerate(self.dependent):
            entries = zip(self.independent, self.combination[:, column], strict=True)
            shares[self.names[index]] = {
                self.names[i]: float(share) for i, share in entries if abs(share) > _NEGLIGIBLE
            }
        return shares


def identifiable_parameters(robot: RobotModel, position_only: bool = False) -> IdentifiableParameters:
    """Finds the independent parameters of a robot by an orthogonal decomposition of its regressor.

    The columns are taken in the order of the parameters, offsets before translations before rotations and the
    base before the tool, and one is independent if it adds something to those before it. That keeps what is
    easiest to correct in a controller, and for the IRB 1200 it gives the lists of Probst (2024), table 2.2.
    The rank is computed at random configurations within the joint limits.

    Args:
        robot: any robot; its tool counts.
        position_only: whether only the position of the tool is measured.

    Raises:
        ValueError: if the robot is a calibrated one: its axes are no longer exactly parallel, so dependent
            parameters become independent ones that no measurement can tell apart.
    """
    if robot.is_calibrated:
        raise ValueError(
            f"error parameters of {robot.name}: it is calibrated already; start from the nominal robot, "
            f"{robot.calibration.of or 'the one that was calibrated'}"
        )
    model = ErrorKinematics(robot)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_CONFIGURATIONS, len(robot.lower)))
    Theta = model.regressor(q, np.zeros(NUM_PARAMETERS))
    stacked = (Theta[:, 3:] if position_only else Theta).reshape(-1, NUM_PARAMETERS)
    names = parameter_names(robot)
    basis = np.empty((len(stacked), 0))
    independent, dependent = [], []
    rounding = _NEGLIGIBLE * float(np.linalg.norm(stacked, axis=0).max())
    for index, column in enumerate(stacked.T):
        size = float(np.linalg.norm(column))
        residual = column.copy()
        for _ in range(2):  # once more removes what rounding left of the first projection
            residual -= basis @ (basis.T @ residual)
        # A tool on axis 6 does not move with it, but for the last digits of a column of sines.
        share = float(np.linalg.norm(residual)) / size if size > rounding else 0.0
        if share >= _INDEPENDENT:
            independent.append(index)
            basis = np.column_stack([basis, residual / np.linalg.norm(residual)])
        else:
            dependent.append(index)
    combination = np.linalg.lstsq(stacked[:, independent], stacked[:, dependent], rcond=None)[0]
    combination[np.abs(combination) < _NEGLIGIBLE] = 0.0
    return IdentifiableParameters(names, np.array(independent), np.array(dependent), combination)


def unseen_parameters(Theta: np.ndarray, names: list[str], tolerance: float = 1e-7) -> list[str]:
    """The parameters that a set of measurements cannot see, or cannot tell from one another.

    Args:
        Theta: regressors of all measurements on top of each other, shape (rows, columns), in SI units.
        names: of the columns.
        tolerance: a direction is unseen if its singular value is smaller than this share of the largest one,
            with all columns scaled to the same length.

    Returns:
        The names that take part in unseen directions; none if the columns are independent.
    """
    lengths = np.linalg.norm(Theta, axis=0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    rows, columns = Theta.shape
    padded = np.vstack([Theta / scale, np.zeros((max(0, columns - rows), columns))])
    _, s, Vt = np.linalg.svd(padded, full_matrices=False)
    unseen = Vt[s < tolerance * s[0]]
    involved = np.abs(unseen).max(axis=0, initial=0.0) > 1e-3
    return [name for name, is_involved in zip(names, involved, strict=True) if is_involved]


@dataclass(frozen=True)
class Completeness:
    """How the 48 parameters of Probst (2024) compare with all small changes of a robot's geometry."""

    rank: int  # directions that poses, or positions, show
    covered: int  # of these by the 48 parameters
    missed: tuple[str, ...]  # names in the complete model that take part in what is missed
    effect_mm: float  # of what is missed at the tool, rms, for errors of the sizes that robots have

    @property
    def sentence(self) -> str:
        """What a person should know of it."""
        if self.covered == self.rank:
            return f"The 48 parameters of Probst (2024) span all {self.rank} directions of this robot."
        return (
            f"The 48 parameters of Probst (2024) span {self.covered} of the {self.rank} directions of this "
            f"robot as its frames are drawn; they would miss {', '.join(self.missed)}, some "
            f"{self.effect_mm:.1f} mm."
        )


def completeness(robot: RobotModel, position_only: bool = False) -> Completeness:
    """Compares the span of the 48 parameters with that of the complete error model, at zero errors.

    Args:
        robot: as drawn; the comparison depends on how its frames were chosen.
        position_only: whether only the position of the tool is measured.
    """
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_CONFIGURATIONS, len(robot.lower)))
    rows, complete = slice(3 if position_only else 0, 6), ErrorModel(robot)
    theirs = ErrorKinematics(robot).regressor(q, np.zeros(NUM_PARAMETERS))[:, rows]
    theirs = theirs.reshape(-1, NUM_PARAMETERS)
    every = complete.forward_and_regressor(q, np.zeros(len(complete)))[1][:, rows]
    every = every.reshape(-1, len(complete)) * parameter_sizes(complete.names)
    sizes = np.linalg.norm(theirs, axis=0)
    seen = sizes > _NEGLIGIBLE * sizes.max()
    U, s, _ = np.linalg.svd(theirs[:, seen] / sizes[seen], full_matrices=False)
    basis = U[:, s > TOLERANCE * s[0]]
    rest = every - basis @ (basis.T @ every)
    rest -= basis @ (basis.T @ rest)
    rank = len(independent_columns(every))
    lengths = np.linalg.norm(rest, axis=0) / np.sqrt(len(q))
    missing = lengths > TOLERANCE * np.linalg.norm(every, axis=0).max()
    missed = tuple(name for name, is_missed in zip(complete.names, missing, strict=True) if is_missed)
    positions = rest.reshape(len(q), -1, len(complete))[:, -3:]
    effect = 1e3 * float(np.sqrt(np.sum(positions**2) / len(q)))
    covered = rank - (len(independent_columns(rest[:, missing])) if missed else 0)
    return Completeness(rank, covered, missed, effect)
