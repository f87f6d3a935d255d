"""Lines that were not used for an adjustment: what it predicts of them."""

from dataclasses import dataclass, replace

import numpy as np

from robots.calibration.instruments.identify import InstrumentCalibration
from robots.calibration.instruments.noise import JOINT
from robots.calibration.instruments.observations import MeasuringCell, Observations
from robots.calibration.instruments.problem import InstrumentProblem, Setting, Start
from robots.calibration.validation import explained_by_noise, refuse_what_cannot_be

_ROUNDING = 1e-6  # m, below which nothing is a gross error


@dataclass(frozen=True)
class FreshLines:
    """Predictions of m lines; targets, frames and anchors are those that fit best in the calibration."""

    observations: Observations
    before: np.ndarray  # (m, 3) m, measured less predicted with the nominal robot, NaN where nothing was
    after: np.ndarray  # (m, 3) m, with the calibrated one
    used: np.ndarray  # (m,) bool, those without gross errors

    @property
    def outliers(self) -> tuple[int, ...]:
        """The lines with gross errors."""
        return tuple(map(int, self.observations.lines[~self.used]))

    def distances(self, instrument: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """How far the used lines of an instrument are off before and after, in m; None for all of them."""
        chosen = self.used & (True if instrument is None else self.observations.instrument == instrument)
        before, after = (np.sqrt(np.nansum(e[chosen] ** 2, axis=1)) for e in (self.before, self.after))
        return before, after


def validate_lines(found: InstrumentCalibration, fresh: Observations) -> FreshLines:
    """Predicts lines at configurations that were not used.

    Raises:
        ValueError: if a target or an instrument was not in the calibration, or measured something else there,
            or if most of its lines are farther off than any calibrated robot is.
    """
    seen = _in_order_of(found.observations, fresh)
    first, problem = (_problem(found, seen, at) for at in (found.nominal_setting, found.setting))
    values = dict(zip(found.names, found.values.tolist(), strict=True))
    robot = np.array([values.get(name, 0.0) for name in problem.names]) * problem.is_of_robot
    u = (robot / problem.sizes)[problem.columns]
    measured = problem.active
    before, after = (
        np.where(measured, each.gathered(each.residuals(at)), np.nan)
        for each, at in ((first, 0.0 * u), (problem, u))
    )
    for number, name in enumerate(seen.instruments):
        distances = np.sqrt(np.nansum(after[seen.instrument == number] ** 2, axis=1))
        if len(distances):
            refuse_what_cannot_be(distances, of=name)
    J = problem.gathered(problem.linearise(u).J)  # zero where nothing was measured
    sigma = np.where(np.isfinite(seen.sigma), seen.sigma, found.noise[1 + seen.instrument])
    V = found.noise[JOINT] ** 2 * J @ np.swapaxes(J, 1, 2)
    V += np.maximum(sigma, _ROUNDING)[:, None, None] ** 2 * np.eye(3)
    e = np.nan_to_num(after)
    squared = np.sum(e * np.linalg.solve(V, e[..., None])[..., 0], axis=1)
    return FreshLines(seen, before, after, explained_by_noise(squared, measured.sum(axis=1)))


def _problem(found: InstrumentCalibration, seen: Observations, at: Setting) -> InstrumentProblem:
    """With targets, frames and anchors where they are."""
    start = Start(at.places, at.frames, at.anchors)
    nothing = MeasuringCell({}, {}, {}, {})
    return InstrumentProblem(found.model, seen, nothing, start, bool(found.compliance.any()))


def _in_order_of(known: Observations, fresh: Observations) -> Observations:
    """The same lines with targets and instruments numbered as in the calibration. Raises ValueError."""
    for kind, names, there in (
        ("target", fresh.targets, known.targets),
        ("instrument", fresh.instruments, known.instruments),
    ):
        strange = [name for name in names if name not in there]
        if strange:
            raise ValueError(f"{kind} {strange[0]} is not in the calibration; there are {', '.join(there)}")
    for number, name in enumerate(fresh.instruments):
        if fresh.is_bar(number) != known.is_bar(known.instruments.index(name)):
            raise ValueError(f"{name} measured coordinates in one table and distances in the other")
    targets = np.array([known.targets.index(name) for name in fresh.targets])
    instruments = np.array([known.instruments.index(name) for name in fresh.instruments])
    return replace(
        fresh,
        target=targets[fresh.target],
        instrument=instruments[fresh.instrument],
        targets=known.targets,
        instruments=known.instruments,
    )
