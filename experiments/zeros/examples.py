"""The textbook examples of zeros: numbers, a verdict, and what stands on the page of each."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from experiments.cli.console import count
from experiments.cli.option_limits import one_of
from experiments.report.plot_page import Section, html_table
from experiments.zeros import beam_arm as elastic_arm
from experiments.zeros import low_pass
from experiments.zeros import two_beams as two_beam_arm
from experiments.zeros.driven_beam import MODELS, TIMES, DrivenBeam, deviation
from experiments.zeros.example import Example
from experiments.zeros.linear_arm import (
    DISTANCE,
    LinearArm,
    filtered_path,
    observed_error,
    virtual_outputs,
)
from experiments.zeros.linear_arm import TIMES as ARM_TIMES
from experiments.zeros.plots import (
    arm_locus_figure,
    beam_figure,
    gain_figure,
    locus_figure,
    plane_figure,
    time_figure,
    zeros_note,
)
from experiments.zeros.spatial_arm import spatial_arm
from experiments.zeros.study import BEAM_MODES, one_json, two_joint_arm_limit, two_joint_arm_zeros
from robots.dynamics.modal.arm_equations import VARIANTS
from robots.dynamics.modal.modal_beam import BOUNDARIES, ModalBeam
from robots.dynamics.transmission_zeros import Zeros
from systems.feedforward.inverse_observer import InverseObserver

_BANDWIDTHS = (5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0)  # Hz
_DRAWN = (15.0,)  # Hz


def two_joint_arm() -> Example:
    """Reiner (2010), section 3.5.3: from which point on the inverse is unstable."""
    limit, zeros = two_joint_arm_limit(), two_joint_arm_zeros(0.5)
    rates = ", ".join(f"{value:.2f}" for value in np.real(zeros.values))
    verdict = (
        f"The point 0.5 m beyond the centre of mass of the two-joint arm has zeros at {rates} 1/s; "
        f"the inverse is stable up to {limit:.4f} m."
    )
    numbers = {**one_json(zeros), "x_l_m": 0.5, "largest_stable_x_l_m": limit}
    note = "Reiner (2010), figure 3.9: a pair goes to infinity and comes back on the real axis."
    sections = [
        Section("Zeros, x_l = 0.5 m", zeros_note(zeros), plane_figure(zeros)),
        Section("Zeros by the place of the output", note, arm_locus_figure(two_joint_arm_zeros), 420),
    ]
    return Example(numbers, verdict, sections)


def beam() -> Example:
    """Reiner (2010), sections 3.5.1 and 3.7: outputs along a driven beam, and a coupling that is left out."""
    limits = {
        boundary: {n: ModalBeam(num_modes=n, boundary=boundary).largest_stable_xi() for n in BEAM_MODES}
        for boundary in BOUNDARIES
    }
    one, three = limits["clamped"][1], limits["clamped"][3]
    nominal, decoupled = ModalBeam(num_modes=3).zeros(1.0), ModalBeam(num_modes=3).decoupled_zeros(1.0)
    verdict = (
        f"A driven beam with 0.45 of its mass at the end has a stable inverse for outputs up to {one:.3f} of "
        f"its length with one mode, {three:.3f} with three; for its end, if the model leaves out what the "
        "turning of the joint does to the modes."
    )
    head = ("boundary", *(count(n, "mode") for n in BEAM_MODES))
    rows = [[b, *(f"{limit:.3f}" for limit in of.values())] for b, of in limits.items()]
    along = (
        "The inverse is stable where the curve is at zero, left of the dotted line (Reiner 2010, figures 3.4 "
        "and 3.5)."
    )
    locus = (
        "Pairs on the imaginary axis go to infinity as the output moves outwards, and come back on the real "
        "one."
    )
    sections = []
    for n in (1, 3):
        modes = count(n, "mode")
        sections.append(Section(f"Output along the beam, {modes}", along, beam_figure(n), 360))
        sections.append(Section(f"Zeros by the place of the output, {modes}", locus, locus_figure(n), 420))
    sections += [
        Section("Largest stable output by number of modes", "", html_table(head, rows)),
        Section(
            "Output at the end, three modes",
            "Squares of the zeros, in E I / (m l^3). A positive one makes the inverse unstable.",
            html_table(
                ("model", "s^2"),
                [
                    ["nominal", _squares(nominal)],
                    ["without C_r of the beam, with that of the load", _squares(decoupled)],
                ],
            ),
        ),
    ]
    numbers = {
        **one_json(nominal),
        "largest_stable_xi": {b: {str(n): limit for n, limit in of.items()} for b, of in limits.items()},
        "decoupled": one_json(decoupled),
    }
    return Example(numbers, verdict, sections)


def observer() -> Example:
    """Reiner (2010), section 5.2.1, on the two-joint arm: as in figure 5.4."""
    arm = LinearArm()
    zeros = arm.zeros
    plain = _largest(observed_error(arm, None))
    highest, chosen = InverseObserver.highest_bandwidth(zeros), InverseObserver.beside(zeros)
    shares = {hertz: _share(arm, hertz, plain) for hertz in (*_BANDWIDTHS, chosen.bandwidth)}
    share = shares[chosen.bandwidth]
    verdict = (
        f"Around an approximate inverse of the two-joint arm an observer of {chosen.bandwidth:.1f} Hz, by "
        f"the zero at {highest:.1f} Hz, leaves {share:.2f} of the largest error of {1e3 * plain:.3f} mm; "
        f"one of {max(hertz for hertz, value in shares.items() if value is None):g} Hz is unstable."
    )
    curves = {"approximate inverse": observed_error(arm, None)}
    for hertz in (*_DRAWN, chosen.bandwidth):
        curves[f"observer of {hertz:.3g} Hz"] = observed_error(arm, InverseObserver(hertz))
    errors = {name: 1e3 * np.abs(error) for name, error in curves.items() if error is not None}
    rows = [
        [f"{hertz:.1f}", "unstable" if value is None else f"{value:.3f}"]
        for hertz, value in sorted(shares.items())
    ]
    sections = [
        Section(
            "Error with and without the observer",
            f"Of a point that goes {DISTANCE:g} m; as in Reiner (2010), figure 5.4.",
            time_figure(ARM_TIMES, errors, "error in mm"),
            420,
        ),
        Section(
            "Largest error by bandwidth",
            "Relative to the approximate inverse alone. A bandwidth above the zero is refused where an "
            "observer is made for an arm; here it shows why.",
            html_table(("bandwidth in Hz", "relative error"), rows),
        ),
    ]
    numbers = {
        **one_json(zeros),
        "highest_bandwidth_hz": highest,
        "bandwidth_hz": chosen.bandwidth,
        "largest_error_mm": {"approximate": 1e3 * plain, "observer": 1e3 * plain * (share or np.nan)},
        "relative_error": {f"{hertz:.4g}": value for hertz, value in sorted(shares.items())},
    }
    return Example(numbers, verdict, sections)


def virtual_output() -> Example:
    """Reiner (2010), section 3.5.3, figure 3.12: zeros at wanted places, and what that costs on the way."""
    arm = LinearArm()
    own = np.real(arm.zeros.values)
    wanted = -np.abs(np.array([own[0], own[0], own[-1]]))
    found, alone, corrected = virtual_outputs(arm, wanted)
    path = filtered_path()
    off = {"virtual output": alone - path, "with quasi-static correction": corrected - path}
    largest = {name: float(1e3 * np.abs(error).max()) for name, error in off.items()}
    first, second = largest.values()
    verdict = (
        f"With zeros wanted at {', '.join(f'{zero:.2f}' for zero in wanted)} 1/s the arm can be inverted "
        f"exactly for the virtual output; the point is off by {first:.1f} mm on the way, by {second:.3f} mm "
        "with the quasi-static correction, and where it should be at the end."
    )
    reached = found.numerator.roots()
    curves = {"wanted": path, "virtual output": alone, "with quasi-static correction": corrected}
    sections = [
        Section(
            "Path of the point", "Reiner (2010), figure 3.12.", time_figure(ARM_TIMES, curves, "y in m"), 420
        ),
        Section(
            "Deviation on the way",
            "Zero at both ends; between them the quasi-static correction should leave little.",
            time_figure(ARM_TIMES, {name: 1e3 * error for name, error in off.items()}, "deviation in mm"),
            360,
        ),
        Section(
            "Zeros",
            "Two at one place are ill-conditioned: they come out beside each other, though the polynomial is "
            f"right to {found.error:.0e}.",
            html_table(
                ("wanted in 1/s", "reached in 1/s"),
                [
                    [f"{a:.4f}", f"{b:.4f}"]
                    for a, b in zip(
                        np.sort(wanted), np.sort_complex(np.asarray(reached, dtype=complex)), strict=True
                    )
                ],
            ),
        ),
    ]
    numbers = {
        "zeros": [[float(np.real(zero)), float(np.imag(zero))] for zero in reached],
        "slowest_rhp": None,
        "poses": 1,
        "wanted": wanted.tolist(),
        "weights": found.weights.tolist(),
        "largest_deviation_mm": {"alone": first, "corrected": second},
    }
    return Example(numbers, verdict, sections)


def driven_beam() -> Example:
    """Reiner (2010), section 3.7, figure 3.20: three inverse models of an elastic gear and a beam."""
    plant, seen = DrivenBeam(), slice(800, 2500)
    off = {model: 1e3 * deviation(plant, model)[seen] for model in MODELS}
    largest = {model: float(np.abs(error).max()) for model, error in off.items()}
    nominal = plant.beam.zeros(1.0)
    decoupled = replace(plant.beam, num_modes=1).decoupled_zeros(1.0)
    verdict = (
        f"The end of a beam behind an elastic gear leaves its path by {largest['rigid']:.2f} mm with an "
        f"inverse that takes all for rigid, {largest['gear alone']:.2f} mm with the gear in it, "
        f"{largest['gear and beam']:.2f} mm with gear and beam."
    )
    note = (
        "The exact inverse is unstable; that of gear and beam has one mode and leaves out what the turning "
        "of the joint does to it by the beam's own mass. The same controller of the motor in all three."
    )
    figure = time_figure(TIMES[seen], off, "deviation in mm")
    numbers = {**one_json(nominal), "decoupled": one_json(decoupled), "largest_deviation_mm": largest}
    return Example(numbers, verdict, [Section("Deviation of the end of the beam", note, figure, 420)])


def prefilter() -> Example:
    """Reiner (2010), section 3.4, figure 3.2: which low-pass may stand before an inverse."""
    beyond = {name: low_pass.overshoot(name) for name in low_pass.NAMES}
    at = 5.0 * low_pass.HERTZ
    left = {name: float(low_pass.gain(name, np.array([at]))[0]) for name in low_pass.NAMES}
    verdict = (
        f"Low-pass filters of order {low_pass.ORDER} with -3 dB at {low_pass.HERTZ:g} Hz overshoot a step by "
        + ", ".join(f"{value:.1%} ({name})" for name, value in beyond.items())
        + ": before an inverse the first two will do, of which Bessel's is the steeper."
    )
    answers = {name: low_pass.step_response(name) for name in low_pass.NAMES}
    rows = [[name, f"{beyond[name]:.2%}", f"{20.0 * np.log10(left[name]):.1f}"] for name in low_pass.NAMES]
    sections = [
        Section(
            "Answer to a step",
            "Reiner (2010), figure 3.2(a).",
            time_figure(low_pass.TIMES, answers, "share of the step"),
            420,
        ),
        Section("Gain", "Figure 3.2(b).", gain_figure(), 420),
        Section("In numbers", "", html_table(("filter", "overshoot", f"dB at {at:g} Hz"), rows)),
    ]
    numbers = {"overshoot": beyond, "gain_at_100_hz": left, "order": low_pass.ORDER, "hertz": low_pass.HERTZ}
    return Example(numbers, verdict, sections)


def two_beams() -> Example:
    """Reiner (2010), section 3.5.1, figures 3.6 and 3.7: the output of the inverse at 0.9 of two beams."""
    runs = {"rigid": two_beam_arm.run(0), "one mode, output at 0.9": two_beam_arm.run(1)}
    moved = round((two_beam_arm.PATH.start + two_beam_arm.PATH.duration) / two_beam_arm.STEP)
    largest = {name: 1e3 * float(run.deviation[: moved + 1].max()) for name, run in runs.items()}
    later = {name: 1e3 * float(run.deviation[-1]) for name, run in runs.items()}
    rigid, placed = runs.values()
    zeros = two_beam_arm.output_zeros(1, two_beam_arm.OUTPUT)
    full = two_beam_arm.output_zeros(3, two_beam_arm.OUTPUT)
    verdict = (
        f"Torques of an inverse with one mode a beam, its outputs at {two_beam_arm.OUTPUT:g} of them, leave "
        f"the end of the second beam within {largest['one mode, output at 0.9']:.1f} mm of its path "
        f"({largest['rigid']:.1f} mm with a rigid inverse), without any controller; in the "
        f"{two_beam_arm.TIMES[-1] - two_beam_arm.TIMES[moved]:.1f} s after it the arm drifts, to "
        f"{later['one mode, output at 0.9']:.0f} mm ({later['rigid']:.0f}). With three modes that inverse "
        f"would be unstable: a zero at {full.slowest_rhp or np.nan:.0f} 1/s."
    )
    heights = {
        "wanted": placed.path[:, 1],
        "reached": placed.reached[:, 1],
        "rigid inverse": rigid.reached[:, 1],
    }
    torques = {f"joint {i + 1}": placed.torques[::2, i] for i in range(2)}
    off = {name: 1e3 * run.deviation for name, run in runs.items()}
    times = two_beam_arm.TIMES
    sections = [
        Section("Height of the end", "As figure 3.7(b).", time_figure(times, heights, "y in m"), 420),
        Section("Torques", "As figure 3.7(a).", time_figure(times, torques, "torque in N m"), 360),
        Section(
            "Deviation of the end",
            "On the way the placed output stays closer than the rigid inverse; afterwards both drift.",
            time_figure(times, off, "deviation in mm"),
            360,
        ),
    ]
    numbers = {**one_json(zeros), "largest_deviation_mm": largest, "at_the_end_mm": later}
    return Example({**numbers, "with_three_modes": one_json(full)}, verdict, sections)


def beam_arm() -> Example:
    """Reiner (2010), section 3.7, figure 3.20 and the variants of (3.72), on a nonlinear arm in a plane."""
    off = {
        name: elastic_arm.deviation(elastic_arm.configuration(name)) for name in elastic_arm.CONFIGURATIONS
    }
    largest = {name: 1e3 * float(error.max()) for name, error in off.items()}
    first, second, third = largest.values()
    variants: dict[str, float | None] = {}
    growth = {name: elastic_arm.StructureInverse(terms).fastest_growth() for name, terms in VARIANTS.items()}
    for name, terms in VARIANTS.items():
        if growth[name] == 0.0:
            told = elastic_arm.configuration(elastic_arm.CONFIGURATIONS[0], terms)
            variants[name] = 1e3 * float(elastic_arm.deviation(told).max())
        else:
            variants[name] = None
    verdict = (
        f"The load of an arm with two bodies that bend leaves its path by {first:.2f} mm with an inverse of "
        f"gears and structure, {second:.2f} mm with one of the gears and {third:.2f} mm with a rigid one. "
        f"Variants {', '.join(name for name, value in variants.items() if value is not None)} of the "
        f"equations can be inverted; with C_t and C_r the inverse grows by {max(growth.values()):.0f} 1/s."
    )
    left_out = (
        "C_t, C_r, h_e, G_r, O_e, bent inertia",
        "C_t, C_r, h_e, G_r, O_e",
        "C_t, C_r, h_e",
        "C_t, C_r",
        "nothing",
    )
    rows = [
        [name, what, "unstable" if value is None else f"{value:.3f}", f"{growth[name]:.0f}"]
        for (name, value), what in zip(variants.items(), left_out, strict=True)
    ]
    curves = {name: 1e3 * error[::10] for name, error in off.items()}
    note = "Reiner (2010), figure 3.20; the same plant and the same controller of the motors in all three."
    sections = [
        Section(
            "Deviation of the load",
            note,
            time_figure(elastic_arm.TIMES[::10], curves, "deviation in mm"),
            420,
        ),
        Section(
            "What an invertible model leaves out",
            "In a plane the couplings have no terms of first order, so that variant 5 is the whole model.",
            html_table(("variant", "left out", "largest deviation in mm", "growth in 1/s"), rows),
        ),
    ]
    numbers = {"largest_deviation_mm": largest, "variants_mm": variants, "growth": growth}
    return Example(numbers, verdict, sections)


EXAMPLES: dict[str, Callable[[], Example]] = {
    each.__name__: each
    for each in (
        two_joint_arm,
        beam,
        two_beams,
        driven_beam,
        beam_arm,
        spatial_arm,
        observer,
        virtual_output,
        prefilter,
    )
}


def example_named(name: str) -> Example:
    """An example by its name.

    Raises:
        ValueError: if there is no such example.
    """
    one_of("--example", EXAMPLES, name)
    found = EXAMPLES[name]()
    return found._replace(numbers={"example": name, **found.numbers})


def _largest(error: np.ndarray | None) -> float:
    return np.nan if error is None else float(np.abs(error).max())


def _share(arm: LinearArm, bandwidth: float, plain: float) -> float | None:
    error = observed_error(arm, InverseObserver(bandwidth))
    return None if error is None else _largest(error) / plain


def _squares(zeros: Zeros) -> str:
    return ", ".join(f"{value:.1f}" for value in np.unique(np.real(zeros.values**2).round(1)))
