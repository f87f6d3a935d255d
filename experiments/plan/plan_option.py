"""``--plan``: a planned motion in place of the path of a scenario."""

from typing import Annotated

import numpy as np
import typer

from systems.reference.planned_file import read_planned

PlanOption = Annotated[
    str | None,
    typer.Option(
        "--plan",
        metavar="FILE.csv",
        help="The motion that truetip plan --write has written, in place of the scenario's path.",
    ),
]


def plan_settings(file: str | None) -> list[str]:
    """The settings of a scenario with this motion, which begins where the plan does.

    Raises:
        ValueError: if the file is not readable.
    """
    if file is None:
        return []
    try:
        motion = read_planned(file)
    except ValueError as error:  # of a table of something else, as of targets
        raise ValueError(f"--plan {error}; it is no motion that truetip plan --write has written") from error
    home = ", ".join(f"{angle:.9g}" for angle in np.rad2deg(motion.q[0]))
    return [f"reference.path=!Planned {{file: '{file}'}}", f"home_deg=[{home}]"]
