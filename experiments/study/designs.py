"""Points of a study: which combinations of its factors are run."""

from collections.abc import Mapping
from itertools import product

import numpy as np
from scipy.stats import qmc

from experiments.study.study_file import (
    Design,
    Distribution,
    Factor,
    Full,
    LatinHypercube,
    Range,
    Sobol,
    SobolIndices,
    random_variable,
)

Value = float | str
_CLOSE_TO_ONE = np.nextafter(1.0, 0.0)


def design_points(factors: Mapping[str, Factor], design: Design, seed: int) -> list[dict[str, Value]]:
    """The points in the order in which they are run; the same seed gives the same points.

    Args:
        factors: key of the scenario -> what it is varied over.
        design: how they are combined.
        seed: of random designs.
    """
    if isinstance(design, Full):
        levels = [factor_levels(factor) for factor in factors.values()]
        return [dict(zip(factors, values, strict=True)) for values in product(*levels)]
    shares = _unit_points(design, len(factors), seed)
    columns = [at_shares(factor, shares[:, i]) for i, factor in enumerate(factors.values())]
    return [dict(zip(factors, values, strict=True)) for values in zip(*columns, strict=True)]


def factor_levels(factor: Factor) -> list[Value]:
    """The values of a factor one after the other.

    Raises:
        ValueError: for a distribution, which has none.
    """
    if isinstance(factor, Distribution):
        raise ValueError(f"distribution {factor.name} has no levels")
    if isinstance(factor, Range):
        return [float(value) for value in np.linspace(factor.start, factor.stop, factor.count)]
    return list(factor.values)


def at_shares(factor: Factor, shares: np.ndarray) -> list[Value]:
    """Values of a factor below which lie the given shares of all, (n,) in [0, 1]; levels are equally likely.

    A range is continuous here: a sampled design may take any number in it.
    """
    inside = np.clip(shares, 0.0, _CLOSE_TO_ONE)
    if isinstance(factor, Distribution):
        # An unbounded distribution is infinite at 0, which a design may contain.
        return [float(value) for value in random_variable(factor).ppf(np.clip(inside, 1e-12, 1.0 - 1e-12))]
    if isinstance(factor, Range):
        return [float(value) for value in factor.start + inside * (factor.stop - factor.start)]
    return [factor.values[int(share * len(factor.values))] for share in inside]


def _unit_points(design: Design, dimension: int, seed: int) -> np.ndarray:
    """Points in the unit cube, (n, dimension)."""
    if isinstance(design, LatinHypercube):
        return qmc.LatinHypercube(dimension, rng=seed).random(design.samples)
    if isinstance(design, Sobol):
        return _sobol(dimension, design.samples, seed)
    if isinstance(design, SobolIndices):
        A, B = np.hsplit(_sobol(2 * dimension, design.samples, seed), 2)
        return np.vstack([A, B, *exchanged(A, B)])
    raise TypeError(f"no points for {design}")


def exchanged(A: np.ndarray, B: np.ndarray) -> list[np.ndarray]:
    """For each column A with that column of B, Saltelli et al. (2010), table 2: d arrays (n, d)."""
    mixed = [A.copy() for _ in range(A.shape[1])]
    for column, points in enumerate(mixed):
        points[:, column] = B[:, column]
    return mixed


def _sobol(dimension: int, samples: int, seed: int) -> np.ndarray:
    # Sobol's sequence keeps its balance only up to a power of two; the surplus is cut off.
    exponent = int(np.ceil(np.log2(samples)))
    return qmc.Sobol(dimension, rng=seed).random_base2(exponent)[:samples]
