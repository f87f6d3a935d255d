"""What standard deviations would be if further motions or sensors were added to a recording.

Information adds up. But noise is the least of what is wrong: `ArmFit.covariance` is many times as large, by
what parts of the data disagree about. Further data are taken to disagree as those that are there do: their
gradients scatter by so many times their information, the mean over springs and dampers. What a sensor shows
wrongly, or all motions in the same phase, does not average out over further motions: it is taken to be
the same in them.
"""

from dataclasses import replace

import numpy as np

from robots.identification.arm_fit import ArmFit, Evidence

_ALIKE = (False, True, True)  # whether cases, sensors, phases are wrong alike in further motions


def with_further(
    fit: ArmFit, effects: list[float], information: np.ndarray, motions: int, further: int
) -> ArmFit:
    """The fit with the covariance that it would have with further data.

    Args:
        fit: of a recording.
        effects: its `design_effects`.
        information: of further data about the unknowns, (n, n).
        motions: of the recording.
        further: motions that are not in it.
    """
    evidence = evidence_of(fit)
    n = len(evidence.alike)
    more = np.zeros_like(evidence.information)
    more[:n, :n] = information
    apart = []
    for parts, effect, is_alike in zip(evidence.disagreement, effects, _ALIKE, strict=True):
        # (N + m)^2 / N^2 times where N motions and m more are wrong alike, N^2 of which is there already.
        times = 2.0 + further / motions if is_alike else 1.0
        apart.append(parts + times * effect * more)
    added = replace(evidence, information=evidence.information + more, disagreement=apart)
    return replace(fit, covariance=added.whole(), noise_covariance=added.covariance[:n, :n], evidence=added)


def design_effects(fit: ArmFit) -> list[float]:
    """By how many times variances are larger than of noise alone: as cases, sensors and phases disagree."""
    evidence = evidence_of(fit)
    kinds = fit.parameters.kinds
    known = [i for i, kind in enumerate(kinds) if kind in ("stiffness", "time")]
    covariance = evidence.covariance
    noise = np.diagonal(covariance @ evidence.information @ covariance)[known]
    return [
        float(np.mean(np.diagonal(covariance @ parts @ covariance)[known] / noise))
        for parts in evidence.disagreement
    ]


def evidence_of(fit: ArmFit) -> Evidence:
    """What the covariances of a fit are from. Raises ValueError if it was not made of a recording."""
    if fit.evidence is None:
        raise ValueError("this fit does not say what its standard deviations are from")
    return fit.evidence
