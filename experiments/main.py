"""The command line: which commands there are, and where each is."""

from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from experiments.cli.command_app import command_app
from experiments.cli.console import BROKEN_OFF
from experiments.cli.ending import clean_up_on_sigterm, outliving_stdout
from experiments.cli.one_thread import take_one_thread

COMMANDS = {
    "compare": "experiments.running.compare_command:compare_command",
    "run": "experiments.running.run_command:run_command",
    "diagram": "experiments.diagram.command:diagram_command",
    "cell": "experiments.station.cell_command:cell_command",
    "latency": "experiments.station.latency_command:latency_command",
    "record": "experiments.station.record_command:record_command",
    "log": "experiments.record.log_command:log_command",
    "report": "experiments.record.report_command:report_command",
    "runs": "experiments.record.runs_command:runs_command",
    "modes": "experiments.modes.command:modes_command",
    "zeros": "experiments.zeros.command:zeros_command",
    "cameras": "experiments.cameras.command:cameras_app",
    "feedforward": "experiments.feedforward.command:feedforward_command",
    "invert": "experiments.invert.command:invert_command",
    "identify": "experiments.identify.command:identify_command",
    "plan": "experiments.plan.command:plan_command",
    "design": "experiments.calibration.design_command:design_command",
    "calibrate": "experiments.calibration.calibrate_command:calibrate_command",
    "compensate": "experiments.compensate.command:compensate_command",
    "drivetrain": "experiments.drivetrain.command:drivetrain_command",
    "robustness": "experiments.robustness.command:robustness_command",
    "study": "experiments.study.command:study_command",
    "frame": "experiments.frames.commands:frame_command",
    "chain": "experiments.frames.commands:chain_command",
    "tool": "experiments.frames.commands:tool_command",
    "align": "experiments.frames.commands:align_command",
    "robots": "experiments.robots.command:robots_app",
    "watch": "experiments.watch.command:watch_command",
    "accept": "experiments.accept.command:accept_app",
    "health": "experiments.health.command:health_command",
    "scenarios": "experiments.scenarios.command:scenarios_command",
    "doctor": "experiments.doctor.command:doctor_command",
}

app = command_app(
    "Puts the true tip of an industrial robot on its path: visual-servo laws, simulated and compared.",
    completes=True,
    table=COMMANDS,
)


def main() -> None:
    """The console command."""
    take_one_thread()
    clean_up_on_sigterm()
    with outliving_stdout(BROKEN_OFF):
        app(prog_name="truetip")


def _print_version(wanted: bool) -> None:
    if wanted:
        try:
            typer.echo(f"truetip {version('truetip')}")
        except PackageNotFoundError:
            typer.echo("truetip, not installed")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


if __name__ == "__main__":
    main()
