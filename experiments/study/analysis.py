"""What the rows of a study say: distributions, effects of the factors, indices of Sobol, worst cases."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from experiments.study.study_file import Distribution, Range, SobolIndices, Study

Rows = Mapping[str, np.ndarray]  # column -> values, (n,)
_CLASSES = 8  # of a continuous factor, for its main effect
_CONFIDENCE = 0.95
_RESAMPLES = 999


@dataclass(frozen=True)
class Effect:
    """The mean of a metric over the values of one factor, the others being as they are in the design."""

    factor: str
    values: list[float | str]  # a level, or the middle of a class of values
    mean: np.ndarray  # (v,)
    half_width: np.ndarray  # (v,), of the mean's 95 % interval; NaN where there is one run alone


@dataclass(frozen=True)
class Indices:
    """Shares of the variance of a metric; estimates may be a little outside [0, 1]."""

    factors: list[str]
    first: np.ndarray  # (d,), by a factor alone
    total: np.ndarray  # (d,), with all that it has to do with
    first_interval: np.ndarray  # (d, 2), 95 %
    total_interval: np.ndarray


def spread(values: np.ndarray) -> dict[str, float | int]:
    """Median, 95th percentile, largest and mean of the numbers among values (n,)."""
    known = values[np.isfinite(values)]
    if not len(known):
        return {"runs": 0}
    return {
        "runs": len(known),
        "mean": float(known.mean()),
        "median": float(np.median(known)),
        "p95": float(np.percentile(known, 95.0)),
        "worst": float(known.max()),
    }


def of_law(rows: Rows, law: str) -> dict[str, np.ndarray]:
    """The rows of one law."""
    chosen = rows["law"] == law
    return {name: values[chosen] for name, values in rows.items()}


def worst_row(rows: Rows, metric: str) -> int | None:
    """The index of the largest value of a metric; None if no run has one."""
    values = rows[metric]
    return int(np.nanargmax(values)) if np.isfinite(values).any() else None


def main_effects(study: Study, rows: Rows, metric: str) -> list[Effect]:
    """The effect of each factor on a metric, over the rows of one law."""
    effects = []
    for name, factor in study.factors.items():
        values, found = rows[name], rows[metric]
        known = np.isfinite(found)
        values, found = values[known], found[known]
        levels = np.unique(values)
        is_continuous = isinstance(factor, Distribution | Range) and len(levels) > _CLASSES
        if is_continuous:
            # Fewer classes where a value comes often, as of a distribution of whole numbers.
            edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _CLASSES + 1)))
            member = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
            kept, member = np.unique(member, return_inverse=True)
            places: list[Any] = [float(np.median(values[member == i])) for i in range(len(kept))]
        else:
            member = np.searchsorted(levels, values)
            places = levels.tolist()
        groups = [found[member == i] for i in range(len(places))]
        mean = np.array([group.mean() for group in groups])
        half_width = np.array([_half_width(group) for group in groups])
        effects.append(Effect(name, places, mean, half_width))
    return effects


def strongest_factor(study: Study, rows: Rows, metric: str) -> str | None:
    """The factor over whose values the mean of a metric changes most; None where nothing can be compared."""
    reach = {
        effect.factor: float(np.ptp(effect.mean[np.isfinite(effect.mean)]))
        for effect in main_effects(study, rows, metric)
        if np.isfinite(effect.mean).any()
    }
    strongest = max(reach, key=lambda factor: reach[factor], default=None)
    return strongest if len(reach) > 1 and strongest and reach[strongest] > 0.0 else None


def sobol_indices(study: Study, rows: Rows, metric: str) -> Indices | None:
    """Indices of a metric over the rows of one law, averaged over repetitions.

    Where runs have failed, the largest power of two of complete samples serves.

    Saltelli et al. (2010), by `scipy.stats.sobol_indices`, with intervals by bootstrap.

    Returns:
        None if the study was not designed for them, or fewer than two of its samples are complete.
    """
    if not isinstance(study.design, SobolIndices):
        return None
    samples, dimension = study.design.samples, len(study.factors)
    points = np.full(samples * (dimension + 2), np.nan)
    for point in range(len(points)):
        here = rows[metric][rows["point"] == point]
        if len(here) == study.repetitions and np.isfinite(here).all():
            points[point] = here.mean()
    blocks = points.reshape(dimension + 2, samples)
    complete = np.flatnonzero(np.isfinite(blocks).all(axis=0))  # a failed run takes out its sample
    if len(complete) < 2:
        return None
    used = 2 ** int(np.log2(len(complete)))  # scipy insists on a power of two
    f_A, f_B, *f_AB = blocks[:, complete[:used]]
    with warnings.catch_warnings(), np.errstate(invalid="ignore", divide="ignore"):
        # A metric that hardly varies, or few samples, have no shares or no interval, and NaN says so.
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        found = stats.sobol_indices(
            func={"f_A": f_A[None], "f_B": f_B[None], "f_AB": np.array(f_AB)[:, None]}, n=used
        )
        bounds = found.bootstrap(confidence_level=_CONFIDENCE, n_resamples=_RESAMPLES)
    return Indices(
        factors=list(study.factors),
        first=np.ravel(found.first_order),
        total=np.ravel(found.total_order),
        first_interval=_interval(bounds.first_order),
        total_interval=_interval(bounds.total_order),
    )


def study_json(study: Study, rows: Rows, commands: Sequence[str]) -> dict[str, Any]:
    """The numbers of a study; ``commands`` repeats each row."""
    laws: dict[str, Any] = {}
    for law in study.laws:
        own = of_law(rows, law)
        laws[law] = {}
        for metric in study.metrics:
            found: dict[str, Any] = dict(spread(own[metric]))
            worst = worst_row(own, metric)
            if worst is not None:
                found["worst_row"] = int(own["row"][worst])
                found["command"] = commands[int(own["row"][worst])]
            indices = sobol_indices(study, own, metric)
            if indices is not None:
                found["sobol"] = {
                    name: {
                        "first": _known(indices.first[i]),
                        "first_interval": [_known(end) for end in indices.first_interval[i]],
                        "total": _known(indices.total[i]),
                        "total_interval": [_known(end) for end in indices.total_interval[i]],
                    }
                    for i, name in enumerate(indices.factors)
                }
            laws[law][metric] = found
    return {"rows": len(rows["row"]), "failures": int((rows["failure"] != "").sum()), "laws": laws}


def _known(value: float) -> float | None:
    """A number; None where there is none, as of shares of a variance that is zero."""
    return float(value) if np.isfinite(value) else None


def _half_width(values: np.ndarray) -> float:
    if len(values) < 2:
        return float("nan")
    quantile = stats.t.ppf(0.5 + 0.5 * _CONFIDENCE, len(values) - 1)
    return float(quantile * values.std(ddof=1) / np.sqrt(len(values)))


def _interval(bound: Any) -> np.ndarray:
    interval = bound.confidence_interval
    return np.column_stack([np.ravel(interval.low), np.ravel(interval.high)])
