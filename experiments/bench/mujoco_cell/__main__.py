"""The self-calibrating law on physics that are not ours: ``python -m experiments.bench.mujoco_cell``.

Arm, drives, encoders and camera are MuJoCo's or written anew; of ours they have the numbers of a robot file.
Robots are as wrong as in the scenario `everything`: every frame displaced by up to 6 mm and turned by up to
0.9 degrees, springs and friction off by up to 20 %, a load of another mass and centre, a dead time and stamps
of the camera that are 3 ms off. Beyond that Coulomb friction sticks, and drives are sampled, with lags of
their own. With ``--play`` gears have play, hysteresis and uneven ratios, which are none of ours either.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from experiments.bench.mujoco_cell.arm import STEP, Wrong
from experiments.bench.mujoco_cell.cell import Drives
from experiments.bench.mujoco_cell.gears import Wear
from experiments.bench.mujoco_cell.run import CellRun, run
from experiments.cli.console import progress_bar
from experiments.cli.workers import in_processes
from experiments.metrics.laps import SLOWED

ROBOTS = ("irb1200", "irb140", "ur10", "crb15000", "crx10ial", "mh5", "tx2_90")


def main() -> None:
    """Prints a row for each run, and the worst of each robot."""
    parser = argparse.ArgumentParser(description="The self-calibrating law on physics that are MuJoCo's.")
    parser.add_argument("--robots", default=",".join(ROBOTS), help="names, separated by commas")
    parser.add_argument("--paths", default="rectangle", help="rectangle, circle, figure_eight")
    parser.add_argument("--seeds", type=int, default=3, help="robots of each name")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--egm", action="store_true", help="behind a planner as that of EGM, without torques")
    parser.add_argument(
        "--gains",
        type=float,
        nargs=3,
        default=(Drives.position, Drives.speed, Drives.integral),
        metavar=("POSITION", "SPEED", "INTEGRAL"),
        help="of the drives, 1/s, which the law takes for 25, 100 and 10",
    )
    parser.add_argument("--bending", type=float, default=0.0, help="of links, over that of their bearings")
    parser.add_argument(
        "--friction-time",
        type=float,
        default=Wrong.friction_time,
        help="s, in which friction that holds brakes a motor: 0.0005, two steps, is as hard as it can stick",
    )
    parser.add_argument(
        "--play",
        type=float,
        metavar="ARC_MINUTES",
        help="of gears that have hysteresis, uneven ratios and a hump of friction, too; else none of these",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="of the scenario, such as what the law is to do",
    )
    parser.add_argument("--jobs", type=int, default=None, help="parallel processes; one per core")
    parser.add_argument("--json", metavar="FILE", default="")
    options = parser.parse_args()
    if options.friction_time < 2.0 * STEP:
        parser.error(f"--friction-time must be two steps of {STEP} s or more, got {options.friction_time}")
    wrong = Wrong(bending=options.bending, friction_time=options.friction_time)
    if options.play is not None and options.play < 0.0:
        parser.error(f"--play must not be negative, got {options.play:g}")
    if min(options.gains) <= 0.0:
        parser.error(f"--gains must be positive, got {' '.join(f'{gain:g}' for gain in options.gains)}")
    drives = Drives(*options.gains, planner=20.0 if options.egm else 0.0)
    wear = None if options.play is None else Wear(play=options.play)
    jobs = [
        CellRun(robot, seed, path, wrong=wrong, drives=drives, wear=wear, more=tuple(options.set))
        for robot in options.robots.split(",")
        for path in options.paths.split(",")
        for seed in range(options.first_seed, options.first_seed + options.seeds)
    ]
    with progress_bar(f"{len(jobs)} runs") as progress:
        rows = in_processes(run, jobs, options.jobs, progress)
    if options.json:
        Path(options.json).write_text(json.dumps({"runs": rows}, indent=1, default=float), encoding="utf-8")
    table = Table(box=box.SIMPLE_HEAD)
    for name in ("robot", "runs", "lap 1, mm and °", "lap 2, mm and °", "at rest, mm", "guard"):
        table.add_column(name, justify="left" if name == "robot" else "right")
    for robot in options.robots.split(","):
        own = [row for row in rows if row["robot"] == robot]
        laps = [_worst([row["laps"][lap] for row in own]) for lap in range(len(own[0]["laps"]))]
        at_rest, guard = max(row["static_mm"] for row in own), sum(row["guard"] for row in own)
        table.add_row(robot, str(len(own)), *laps, f"{at_rest:.4f}", str(guard))
    Console().print(table)


def _worst(laps: Sequence[Mapping[str, float]]) -> str:
    """The largest errors, and how many times as long as planned the longest one took if that is more."""
    largest = [max(lap[name] for lap in laps) for name in ("max_norm_mm", "max_angle_deg")]
    longest = max(lap["times_planned"] for lap in laps)
    slowed = f", × {longest:.2f}" if longest > SLOWED else ""
    return ", ".join(f"{error:.3f}" for error in largest) + slowed


if __name__ == "__main__":
    main()
