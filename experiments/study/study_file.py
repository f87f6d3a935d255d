"""The file of a study: a scenario, what is varied in it and how, and the laws that run."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from experiments.metrics.single_figures import FIGURES
from robots.configuration.nodes import Node, read_nodes
from robots.configuration.quantity import numbers, quantity
from robots.configuration.typed import typed
from systems.servo import LAWS


@dataclass
class Levels:
    """Numbers, one after the other."""

    values: list[float] = numbers(())


@dataclass
class Names:
    """Names, one after the other: laws' options, paths, ``"true"``."""

    values: list[str] = field(default_factory=list)


@dataclass
class Range:
    """Numbers at equal distances, both ends among them."""

    start: float = 0.0
    stop: float = 1.0
    count: int = quantity(5, 2, 100_000)


@dataclass
class Distribution:
    """A random variable by its name in `scipy.stats`, such as ``norm`` with ``loc`` and ``scale``."""

    name: str = "uniform"
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass
class Full:
    """Every combination of all levels."""


@dataclass
class LatinHypercube:
    """Each factor once in each of ``samples`` equally likely classes, in random combination."""

    samples: int = quantity(64, 1, 10_000_000)


@dataclass
class Sobol:
    """Points of Sobol's sequence, scrambled; a power of two is best."""

    samples: int = quantity(64, 1, 10_000_000)


@dataclass
class SobolIndices:
    """Saltelli's design for the indices: ``samples``, a power of two, times (factors + 2) points."""

    samples: int = quantity(64, 2, 10_000_000)


Factor = Levels | Names | Range | Distribution
Design = Full | LatinHypercube | Sobol | SobolIndices


@dataclass
class Study:
    """What is varied, how, and what runs; read by `load_study`."""

    description: str = ""
    scenario: str = "misaligned"
    settings: list[str] = field(default_factory=list)  # of every run, as ``--set`` takes them
    quick: bool = False  # one faster lap after at most 2 s of settling, as ``compare --quick``
    laws: list[str] = field(default_factory=lambda: ["open_loop", "numerical_ik"])
    factors: dict[str, Factor] = field(default_factory=dict)  # by the key of the scenario
    design: Design = field(default_factory=Full)
    repetitions: int = quantity(1, 1, 10_000)  # with another noise of the camera each
    seed: int = quantity(0, 0, 2**31 - 1)  # of the design, and of the first repetition's noise
    metrics: list[str] = field(default_factory=lambda: ["max_norm_mm", "static_mm"])  # of the report


def load_study(path: str | Path) -> Study:
    """Reads the file of a study.

    Raises:
        ConfigurationError: if something is missing, unknown, out of range or contradicts; one line that says
            what and in which line of the file.
    """
    node = read_nodes(Path(path), f"study file {Path(path).name}")
    study = typed(node, Study)
    for key, factor in study.factors.items():
        _check_factor(node.at(["factors", key]), key, factor, study.design)
        if any(setting.partition("=")[0].strip() == key for setting in study.settings):
            raise node.at(["factors", key]).refuse(
                f"factors.{key}: settings say it, too: leave it out in one"
            )
    if "seed" in study.factors and study.repetitions > 1:
        reason = "factors.seed: repetitions would all have the noise of that seed; leave one of the two out"
        raise node.at(["factors", "seed"]).refuse(reason)
    if "law" in study.factors:
        reason = "factors.law: it would not change what runs; the laws stand under laws"
        raise node.at(["factors", "law"]).refuse(reason)
    samples = getattr(study.design, "samples", 1)
    if isinstance(study.design, SobolIndices) and samples & (samples - 1):
        raise node.at(["design", "samples"]).refuse(f"design.samples must be a power of two, got {samples}")
    if not study.factors:
        raise node.refuse("factors: at least one key of a scenario that is varied is needed")
    for law in study.laws:
        try:
            LAWS.find(law)
        except ValueError as error:
            raise node.at(["laws"]).refuse(str(error)) from error
    _check_names(node.at(["laws"]), "laws", study.laws)
    _check_names(node.at(["metrics"]), "metrics", study.metrics)
    for metric in study.metrics:
        if metric not in FIGURES:
            raise node.at(["metrics"]).refuse(f"metrics: must be of {', '.join(FIGURES)}, got '{metric}'")
    return study


def random_variable(factor: Distribution) -> Any:
    """The distribution with its parameters, frozen as scipy has it.

    Raises:
        ValueError: if scipy has no such distribution or does not take its parameters.
    """
    found = getattr(stats, factor.name, None)
    if not isinstance(found, stats.rv_continuous | stats.rv_discrete):
        raise ValueError(f"scipy.stats has no distribution '{factor.name}'")
    try:
        frozen = found(**factor.parameters)
    except TypeError as error:
        takes = ", ".join([*(found.shapes or "").split(), "loc", "scale"])
        raise ValueError(
            f"distribution {factor.name} takes {takes}; got {', '.join(factor.parameters)}"
        ) from error
    if np.isnan(frozen.ppf(0.5)):  # NaN: a scale below zero, and the like
        given = ", ".join(f"{name}={value:g}" for name, value in factor.parameters.items())
        raise ValueError(f"distribution {factor.name} does not exist with {given}")
    return frozen


def _check_factor(node: Node, key: str, factor: Factor, design: Design) -> None:
    if isinstance(factor, Distribution):
        try:
            random_variable(factor)
        except ValueError as error:
            raise node.refuse(f"factors.{key}: {error}") from error
        if isinstance(design, Full):
            raise node.refuse(
                f"factors.{key}: a distribution needs a design that samples: !LatinHypercube, !Sobol or "
                "!SobolIndices"
            )
    elif not isinstance(factor, Range) and not factor.values:
        raise node.refuse(f"factors.{key}: values: at least one is needed")


def _check_names(node: Node, what: str, names: list[str]) -> None:
    if not names:
        raise node.refuse(f"{what}: at least one is needed")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise node.refuse(f"{what}: '{twice}' is there twice")
