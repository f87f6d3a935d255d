"""``truetip scenarios``: lists the shipped ones, prints one, or says what can stand in one."""

from typing import Annotated

import typer

from diagrams.scenario.scenario import Scenario, load_scenario, scenario_text, shipped_scenarios
from experiments.cli.console import print_list, refusing
from robots.configuration.described import described


def scenarios_command(
    shows_fields: Annotated[
        bool, typer.Option("--fields", help="All fields of a scenario: default, range and unit, meaning.")
    ] = False,
    show: Annotated[
        str | None,
        typer.Option("--show", metavar="NAME|FILE", help="One scenario with all its values, as YAML."),
    ] = None,
) -> None:
    """List the scenarios that come with truetip, print one, or list what can stand in one."""
    if show is not None:
        with refusing(ValueError, OSError):
            if shows_fields:
                raise ValueError("--show: either one scenario or --fields, which are those of all")
            print(scenario_text(load_scenario(show)), end="")
        return
    if shows_fields:
        for row in described(Scenario()):
            print(f"{row.path:<58} {row.default or '-':<24} {row.allowed:<32} {row.meaning}".rstrip())
        return
    print_list((name, load_scenario(name).description) for name in shipped_scenarios())
