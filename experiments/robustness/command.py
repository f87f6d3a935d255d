"""``truetip robustness``: laws on many random robots, worst and median."""

from dataclasses import replace
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cli.cluster import executor
from experiments.cli.console import BROKEN_OFF, count, fail, print_note, print_table, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, one_of
from experiments.cli.options import JobsOption, JsonOption, RobotOption, SchedulerOption, SetOption
from experiments.metrics.laps import SLOWED
from experiments.metrics.unfinished import never_finished
from experiments.robustness.cases import CASES
from experiments.robustness.contenders import contenders
from experiments.robustness.study import Case, judged, run_trials, trials, with_calibrated_robots
from robots.configuration.suggestion import did_you_mean
from robots.description.model import load_robot
from robots.description.source_notes import assumed_note
from systems.reference.paths import make_path

PATHS = ("rectangle", "circle", "figure_eight")


def robustness_command(
    scenario: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="Properties drawn at random for each seed.")
    ] = ("everything"),
    laws: Annotated[
        str,
        typer.Option(
            metavar="A,B,...",
            help="Which laws, by name or as my_law.py:MyLaw; LAW+FEEDFORWARD has an inverse model beside it, "
            "LAW@calibrated a robot that was calibrated before.",
        ),
    ] = "open_loop,numerical_ik",
    cases: Annotated[
        str, typer.Option(metavar="A,B,...", help=f"Which disturbances: {', '.join(CASES)}; or all.")
    ] = "plain",
    paths: Annotated[
        str, typer.Option(metavar="A,B,...", help=f"Which paths: {', '.join(PATHS)}.")
    ] = "rectangle",
    seeds: Annotated[int, typer.Option(metavar="N", help="Number of random robots.")] = 3,
    first_seed: Annotated[int, typer.Option(metavar="N", help="First seed.")] = 1000,
    laps: Annotated[int, typer.Option(metavar="N", help="Laps of the path in each run.")] = 1,
    settings: SetOption = None,
    robot: RobotOption = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    json_file: JsonOption = None,
) -> None:
    """Run laws on random robots and print the worst and the median error."""
    human = human_console(json_file)
    with refusing(ValueError):
        for name, value in (("--seeds", seeds), ("--laps", laps), ("--jobs", jobs)):
            at_least(name, 1, value)
        names = list(CASES) if cases == "all" else _each_once("--cases", cases)
        chosen = [_case(name, settings or []) for name in names]
        compared = contenders(laws)
        shapes = _each_once("--paths", paths)
        for shape in shapes:
            one_of("--paths", PATHS, shape)
        drawn = range(first_seed, first_seed + seeds)
        todo = trials(scenario, chosen, compared, drawn, shapes, laps, robot)
        for trial in todo:
            if trial.seed == first_seed:  # what cannot run is refused before anything does
                make_path(trial.load().reference)
        # Robots that seeds draw are many; the one that all runs share is spoken of.
        shared = next((trial.load().robot for trial in todo if robot or trial.case.draw is None), None)
        assumed = assumed_note(load_robot(shared)) if shared else ""
        print_note(human, assumed)
        where = executor(scheduler, jobs)
        with (
            json_output(json_file) as output,
            output.staged(),
        ):
            if any(contender.is_calibrated for contender in compared):
                with progress_bar(f"calibrating {count(seeds, 'robot')}") as progress:
                    todo = with_calibrated_robots(todo, tuple(settings or ()), where, progress)
            with progress_bar(f"{count(len(todo), 'run')} {where.place(len(todo))}") as progress:
                rows = run_trials(todo, where, progress)
            results = [
                {"case": case.name, "law": law, **judged(matching)}
                for case in chosen
                for law in (contender.text for contender in compared)
                if (matching := [row for row in rows if (row["case"], row["law"]) == (case.name, law)])
            ]
            numbers = {"scenario": scenario, "robot": robot, "results": results, "runs": rows}
            output.write(numbers | ({"assumed": assumed} if assumed else {}))
    _print(human, scenario, results, {contender.text: contender.title for contender in compared})
    failures = {each.text: [row["failure"] for row in rows if row["law"] == each.text] for each in compared}
    if lost := never_finished(failures):
        fail(lost, BROKEN_OFF)


def _each_once(option: str, text: str) -> list[str]:
    """The names in a list; twice the same would count double. Raises ValueError."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{option}: '{name}' is there twice")
    return names


def _case(name: str, settings: list[str]) -> Case:
    if name not in CASES:
        guess = did_you_mean(name, CASES)
        raise ValueError(f"--cases: must be of {', '.join(CASES)}, got '{name}'{guess}")
    return replace(CASES[name], settings=(*CASES[name].settings, *settings))


def _print(console: Console, scenario: str, results: list[dict[str, Any]], titles: dict[str, str]) -> None:
    only = next(iter(titles.values())) if len(titles) == 1 else ""

    def label(result: dict[str, Any]) -> str:
        return (
            escape(result["case"]) if only else f"{escape(result['case'])}, {escape(titles[result['law']])}"
        )

    is_single = all(result["runs"] == 1 for result in results)

    def pair(values: tuple[float, float], digits: int) -> str:
        worst, median = (f"{value:.{digits}f}" for value in values)
        return worst if is_single else f"{worst} ({median})"

    of_law = f", {escape(only)}" if only else ""
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"Scenario {escape(scenario)}{of_law}: true error{'' if is_single else ', worst (median)'}",
        title_justify="left",
        title_style="italic",
    )
    has_events = any("recovered_mm" in result for result in results)
    ratios = [lap["times_planned"][0] for result in results for lap in result.get("laps", [])]
    is_slowed = any(ratio > SLOWED for ratio in ratios)
    table.add_column("case" if only else "case, law", overflow="fold")
    own = (
        *(["planned time"] if is_slowed else []),
        "at rest mm",
        *(["mm after event"] if has_events else []),
    )
    for name in ("lap", "mm", "°", *own):
        table.add_column(name, justify="right", no_wrap=name not in ("mm after event", "planned time"))
    for result in results:
        laps = result.get("laps", [])
        for number, lap in enumerate(laps, 1):
            is_last = number == len(laps)
            cells = [str(number), pair(lap["max_norm_mm"], 3), pair(lap["max_angle_deg"], 3)]
            if is_slowed:
                cells.append(f"× {pair(lap['times_planned'], 2)}")
            cells.append(pair(result["static_mm"], 4) if is_last else "")
            if has_events:
                cells.append(pair(result["recovered_mm"], 3) if is_last and "recovered_mm" in result else "")
            table.add_row(label(result) if number == 1 else "", *cells)
    print_table(console, table)
    for result in results:
        if not is_single and "worst_seed" in result:
            robot = f" ({result['worst_robot']})" if "worst_robot" in result else ""
            console.print(
                f"{label(result)}: worst with seed {result['worst_seed']}{robot} on {result['worst_path']}"
            )
        if "coverage" in result:
            smallest, of_all = result["coverage"]
            worst = "" if is_single else f", worst run {smallest:.3f}"
            console.print(f"{label(result)}: in the predicted 95 % ellipsoid {of_all:.3f}{worst}")
        if result.get("guard"):
            console.print(f"{label(result)}: the guard intervened in {result['guard']} ticks")
        for failure in result["failures"]:
            console.print(f"[red]{label(result)}: {escape(failure)}[/red]")
