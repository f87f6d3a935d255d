"""``truetip drivetrain``: figures of the drive-train models."""

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from experiments.cli.console import print_files, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.staging import PAGE, staged_file
from experiments.drivetrain.figures import (
    PLAY_APPROXIMATIONS,
    SMOOTH_INVERSES,
    THRESHOLDS,
    WEIGHTS,
    backlash_figure,
    efficiency_figure,
    friction_figure,
    hysteresis_figure,
    hysteresis_signal,
    smoothly_compensated,
)
from experiments.report.plot_page import Section, html_table, write_plot_page
from robots.drivetrain.hysteresis import PrandtlIshlinskii
from robots.drivetrain.parts import PARTS


def drivetrain_command(
    out: PictureOption = Path("out/drivetrain.html"),
    json_file: JsonOption = None,
) -> None:
    """Draw friction, efficiency, play and hysteresis as in Reiner (2010), figures 2.3 to 2.6."""
    human = human_console(json_file)
    x, step = hysteresis_signal()
    operator = PrandtlIshlinskii(WEIGHTS, THRESHOLDS)
    inverse, starts = operator.inverse()
    residual = float(np.abs(operator.response(inverse.response(x, starts)) - x).max())
    smoothly = {name: float(np.abs(found - x).max()) for name, found in smoothly_compensated(x, step).items()}
    result = {
        "parts": {name: {"invertible": part.invertible} for name, part in PARTS.items()},
        "hysteresis": {
            "weights": list(WEIGHTS),
            "thresholds": list(THRESHOLDS),
            "inverse_weights": list(inverse.weights),
            "inverse_thresholds": list(inverse.thresholds),
            "residual": residual,
            "smooth_residual": smoothly,
        },
    }
    rows = [[name, "yes" if part.invertible else "no"] for name, part in PARTS.items()]
    parameters = [
        *([name, f"T = {T} s, psi = {psi}, n = {n}"] for name, (T, psi, n) in PLAY_APPROXIMATIONS.items()),
        ["hysteresis and its exact inverse", f"w = {WEIGHTS}, r = {THRESHOLDS}"],
        *(
            [f"smooth inverse, {name}", f"T = {T} s, psi = {psi}, n = {n}; it leaves {smoothly[name]:.3f}"]
            for name, (T, psi, n) in SMOOTH_INVERSES.items()
        ),
    ]
    with json_output(json_file) as output, refusing(OSError), ExitStack() as stack:
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        sections = [
            Section(
                "Friction",
                "Figure 2.3: the torque of a joint over its velocity, in three parts that join smoothly. Its "
                "numbers are assumed, the source shows none.",
                friction_figure(),
                360,
            ),
            Section(
                "Efficiency",
                "Figure 2.4: a ramp of torque drives two inertias through a gear with losses. Friction holds "
                "it at first; later the direction in which power flows decides what is lost.",
                efficiency_figure(),
                480,
            ),
            Section(
                "Play",
                "Figure 2.5: a gap between teeth, in which nothing is transmitted, and a smooth substitute "
                "that an inverse model can follow; it yields more when it is slow. On the right, near zero.",
                backlash_figure(),
                380,
            ),
            Section(
                "Hysteresis",
                "Figure 2.6. On the left the play operator, which moves only when it is pushed, and three "
                "smooth approximations of the table below. On the right a hysteresis, and what is left of it "
                "behind its exact inverse, a straight line, and behind the inverse of its smooth form: with "
                "the parameters of table 2.1, and with sharper ones.",
                hysteresis_figure(),
                420,
            ),
            Section(
                "Parameters of table 2.1",
                "Corrected: thresholds begin with zero, and psi is meant where the table says s.",
                html_table(["approximation", "parameters"], parameters),
            ),
            Section("Parts by their names in YAML", "", html_table(["kind", "can be inverted"], rows)),
        ]
        left = smoothly["table 2.1"]
        verdict = (
            f"The inverse operator compensates the hysteresis to {residual:.1e}, the inverse of its smooth "
            f"form with the parameters of table 2.1 to {left:.3f}."
        )
        write_plot_page(page, "Drive trains", verdict, sections)
        output.write(result)
    print_files(human, out)
