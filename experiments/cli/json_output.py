"""A command's numbers as JSON beside its other results: in a file, on stdout or nowhere."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.cli.staging import staged_file
from experiments.report.files import json_text, write_json

STDOUT = "-"


def human_console(json_file: str | None) -> Console:
    """Where a command speaks to people: stdout, or stderr where stdout is for the numbers alone."""
    return Console(stderr=json_file == STDOUT)


class JsonOutput:
    """Collects the JSON output of a command. Get one from `json_output`."""

    _staged: Path  # where a file is written until its command has ended well

    def __init__(self, json_file: str | None) -> None:
        self._json_file = json_file
        self.text_for_stdout = ""

    @contextmanager
    def staged(self) -> Iterator[None]:
        """Where the numbers go to a file, that file is staged, as by `staged_file`.

        Raises:
            OSError: if the file cannot be written; one line that says which and why.
        """
        if self._json_file is None or self._json_file == STDOUT:
            yield
            return
        with staged_file(self._json_file, ".json") as self._staged:
            yield

    def write(self, numbers: Any) -> None:
        """Takes the numbers; a file has to be `staged` for them.

        Raises:
            ValueError: if a number that goes anywhere is NaN or infinite.
        """
        if self._json_file == STDOUT:
            self.text_for_stdout = json_text(numbers)
        elif self._json_file is not None:
            write_json(self._staged, numbers)


@contextmanager
def json_output(json_file: str | None) -> Iterator[JsonOutput]:
    """Gives what takes the numbers; those for stdout are printed when the block has ended well.

    It belongs around all the rest of a command: then they are printed when its files are in their places.

    Args:
        json_file: what ``--json`` says: the name of a file, ``-`` for stdout, or None for nowhere.
    """
    output = JsonOutput(json_file)
    yield output
    sys.stdout.write(output.text_for_stdout)
