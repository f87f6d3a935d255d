"""``truetip study``: many runs of several laws over what is varied in a scenario."""

import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cli.cluster import executor
from experiments.cli.console import (
    BROKEN_OFF,
    count,
    fail,
    print_files,
    print_note,
    print_table,
    progress_bar,
    refusing,
)
from experiments.cli.ending import exit_code
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least
from experiments.cli.options import JobsOption, JsonOption, SchedulerOption
from experiments.cli.staging import staged_file
from experiments.cli.workers import Executor, SimulationError
from experiments.metrics.single_figures import FIGURES
from experiments.metrics.unfinished import never_finished
from experiments.report.plot_page import Section, html_table, write_plot_page
from experiments.report.style import law_title
from experiments.study.analysis import Rows, of_law, spread, strongest_factor, study_json, worst_row
from experiments.study.figures import (
    effects_figure,
    indices_figure,
    metric_name,
    metric_unit,
    spread_figure,
)
from experiments.study.rows import StudyRow, first_run, prepared_of, run_row, study_rows
from experiments.study.store import TABLE, StudyStore, alone_in, columns_of
from experiments.study.study_file import Study, load_study
from robots.description.source_notes import assumed_note

_PAGE = "study.html"
_SHOWN_FAILURES = 20  # on the page
_NAMED_FAILURES = 5  # on the terminal


def study_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The study, a YAML file.", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of the results.", show_default="out/ and the name of the file"
        ),
    ] = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Run again what has failed.")] = False,
    json_file: JsonOption = None,
) -> None:
    """Run laws over everything that a file varies; started again, it goes on where it ended."""
    human = human_console(json_file)
    folder = out or Path("out") / file.stem
    start = time.perf_counter()
    with json_output(json_file) as output, refusing(ValueError, OSError), output.staged():
        at_least("--jobs", 1, jobs)
        study = load_study(file)
        rows = study_rows(study)
        plan = {"study": asdict(study), **first_run(rows)}
        prepared = prepared_of(rows)
        assumed = [note for each in prepared if (note := assumed_note(each.robot))]
        print_note(human, "; ".join(filter(None, dict.fromkeys(each.note for each in prepared))))
        where = executor(scheduler, jobs)
        factors = {
            name: [dict(row.factors)[name] for row in rows[:: len(study.laws)]] for name in study.factors
        }
        with alone_in(folder):
            store = StudyStore(folder, plan, columns_of(factors, list(FIGURES)))
            finished = store.finished(with_failures=not retry_failed)
            todo = [row for row in rows if row.number not in finished]
            if finished and todo:
                human.print(f"{count(len(finished), 'run')} of {len(rows)} are there from before")
            _run(store, where, todo, len(rows))
            table = store.finish()
            found = {name: _column(table, name) for name in table.column_names}
            numbers = study_json(study, found, [row.command for row in rows])
            with staged_file(folder / _PAGE) as page:
                _write_page(page, study, found, rows)
        numbers |= {"assumed": assumed} if assumed else {}
        output.write(numbers | {"seconds": time.perf_counter() - start})
    _print(human, study, found)
    print_files(human, folder / _PAGE, folder / TABLE)
    if lost := never_finished({law: of_law(found, law)["failure"].tolist() for law in study.laws}):
        fail(lost, BROKEN_OFF)


def _run(store: StudyStore, where: Executor, todo: Sequence[StudyRow], total: int) -> None:
    """Runs what is not there yet. What is done stays, whatever ends the rest."""
    if not todo:
        return
    with progress_bar(count(len(todo), "run")) as progress:
        try:
            with closing(where.completed(run_row, todo, progress)) as completed:
                for _, line in completed:
                    store.add(line)
        except KeyboardInterrupt as error:
            fail(f"interrupted; {_kept(store, total)}", exit_code(error))
        except SimulationError as error:
            raise SimulationError(f"{error}; {_kept(store, total)}") from error
        finally:
            store.flush()


def _kept(store: StudyStore, total: int) -> str:
    store.flush()
    return f"{len(store.finished())} of {count(total, 'run')} are kept, the same command goes on"


def _column(table: Any, name: str) -> np.ndarray:
    """A column as numbers or texts; NaN where there is no number."""
    values = table[name].to_pylist()
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    return np.array([np.nan if value is None else value for value in values])


def _print(human: Console, study: Study, rows: Rows) -> None:
    for metric in study.metrics:
        table = Table(box=box.SIMPLE_HEAD, title=FIGURES[metric], title_justify="left", title_style="italic")
        for name in ("law", "runs", "median", "95 %", "worst"):
            table.add_column(name, justify="left" if name == "law" else "right")
        for line in _spread_lines(study, rows, metric):
            table.add_row(*map(escape, line))
        print_table(human, table)
    failed = int((rows["failure"] != "").sum())
    if failed:
        for i in np.flatnonzero(rows["failure"] != "")[:_NAMED_FAILURES]:
            law = law_title(str(rows["law"][i]))
            human.print(f"[red]run {rows['row'][i]}, {escape(law)}: {escape(str(rows['failure'][i]))}[/red]")
        human.print(f"[red]{count(failed, 'run')} failed; reasons and commands are in the report[/red]")
    human.print(escape(study_verdict(study, rows)))


def _spread_lines(study: Study, rows: Rows, metric: str) -> list[list[str]]:
    lines = []
    for law in study.laws:
        found = spread(of_law(rows, law)[metric])
        numbers = [f"{found[name]:.4g}" if name in found else "-" for name in ("median", "p95", "worst")]
        lines.append([law_title(law), str(found["runs"]), *numbers])
    return lines


def _write_page(path: Path, study: Study, rows: Rows, plan: Sequence[StudyRow]) -> None:
    sections = []
    for metric in study.metrics:
        sections += [
            Section(
                f"Spread: {metric_name(metric)}",
                f"The share of runs that are at most so far off. In {TABLE} it is {metric}.",
                spread_figure(study, rows, metric),
            ),
            Section(
                f"Effect of each factor: {metric_name(metric)}",
                "Means over all runs with that value, and their 95 % intervals.",
                effects_figure(study, rows, metric),
                height=380,
            ),
        ]
        indices = indices_figure(study, rows, metric)
        if indices is not None:
            sections.append(
                Section(
                    f"Which factor matters: {metric_name(metric)}",
                    "Sobol's indices, the share of the variance that a factor causes alone, and with its "
                    "interactions; 95 % intervals. Those beyond 0 and 1 say that samples are too few.",
                    indices,
                )
            )
    sections.append(Section("The numbers", "Of all runs that did not fail.", _numbers_table(study, rows)))
    sections.append(
        Section("Worst runs", "With the command line that repeats each.", _worst_table(study, rows, plan))
    )
    failures = np.flatnonzero(rows["failure"] != "")
    if len(failures):
        shown = [
            [str(rows["row"][i]), law_title(str(rows["law"][i])), str(rows["failure"][i]), plan[i].command]
            for i in failures[:_SHOWN_FAILURES]
        ]
        note = f"{len(failures)} of {count(len(plan), 'run')}; the first {len(shown)}. All are in {TABLE}."
        sections.append(Section("Failures", note, html_table(["row", "law", "reason", "command"], shown)))
    write_plot_page(path, study.description or "Study", study_verdict(study, rows), sections)


def study_verdict(study: Study, rows: Rows) -> str:
    """What came out, in a sentence: the best law by the worst run of the first metric, if it has not failed.

    The worst run of a law may be one that failed; it is not better than another one for leaving it out.
    """
    metric = study.metrics[0]
    found = {law: spread(of_law(rows, law)[metric]) for law in study.laws}
    failures = {law: int((of_law(rows, law)["failure"] != "").sum()) for law in study.laws}
    ranked = sorted(
        (law for law in found if found[law]["runs"]), key=lambda law: (failures[law], found[law]["worst"])
    )
    failed = int((rows["failure"] != "").sum())
    if not ranked:
        runs = len(rows["row"])
        return "The only run failed." if runs == 1 else f"All {runs} runs failed."
    best = ranked[0]
    strongest = strongest_factor(study, of_law(rows, best), metric)
    return (
        f"Over {count(len(rows['row']), 'run')} {law_title(best)} has the best worst run: "
        f"{metric_name(metric)} {found[best]['worst']:.3g}, in the median {found[best]['median']:.3g}, "
        f"{metric_unit(metric)}."
        + (f" Of what is varied, {strongest} changes its mean most." if strongest else "")
        + (f" {count(failed, 'run')} failed." if failed else "")
    )


def _numbers_table(study: Study, rows: Rows) -> str:
    lines = [
        [FIGURES[metric], *line] for metric in study.metrics for line in _spread_lines(study, rows, metric)
    ]
    return html_table(["what", "law", "runs", "median", "95 %", "worst"], lines)


def _worst_table(study: Study, rows: Rows, plan: Sequence[StudyRow]) -> str:
    lines = []
    for metric in study.metrics:
        for law in study.laws:
            own = of_law(rows, law)
            worst = worst_row(own, metric)
            if worst is not None:
                command = plan[int(own["row"][worst])].command
                lines.append([FIGURES[metric], law_title(law), f"{own[metric][worst]:.4g}", command])
    return html_table(["largest", "law", "value", "command"], lines)
