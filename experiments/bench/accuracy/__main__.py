"""``python -m experiments.bench.accuracy``: measures what the manual says of accuracy, and writes its tables.

Each row is a command of its own, `experiments.bench.accuracy.rows`. Its numbers stay in a folder, and a row
that is there already is not measured again, so that an interrupted measurement goes on where it was; another
law wants another folder. All rows are 523 runs and take hours.
"""

import argparse
import shlex
import subprocess
import sys
from pathlib import Path

from experiments.bench.accuracy.rows import COMMAND, SECTIONS, Row
from experiments.bench.accuracy.tables import read_results, table, write_tables
from experiments.cli.console import progress_bar


def measure(row: Row, file: Path, jobs: int | None) -> None:
    """Runs the command of a row.

    Raises:
        RuntimeError: if it fails.
    """
    limited = ["--jobs", str(jobs)] if jobs else []
    words = [*COMMAND.split(), *shlex.split(row.options), *limited, "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "experiments.main", *words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"truetip {' '.join(words)}: {done.stderr.strip()}")


def main() -> None:
    """Reads the command line, measures what is missing, and writes."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench.accuracy", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("out/accuracy"), help="where the numbers stay")
    parser.add_argument(
        "--only", default="", help="rows by name, separated by commas; then no page is written"
    )
    parser.add_argument("--jobs", type=int, help="processes of a command")
    parser.add_argument("--page", type=Path, default=Path("docs/accuracy.md"), help="where the tables go")
    options = parser.parse_args()
    only = [name for name in options.only.split(",") if name]
    rows = {row.name: row for section in SECTIONS.values() for row in section}
    unknown = [name for name in only if name not in rows]
    if unknown:
        parser.error(f"--only: no row '{unknown[0]}', only {', '.join(rows)}")
    options.folder.mkdir(parents=True, exist_ok=True)
    files = {name: options.folder / f"{name}.json" for name in rows}
    missing = [name for name in (only or rows) if not files[name].exists()]
    try:
        with progress_bar(f"{len(missing)} rows") as progress:
            for number, name in enumerate(missing):
                measure(rows[name], files[name], options.jobs)
                progress((number + 1) / len(missing))
        if only:
            print(table([(rows[name], read_results(files[name])) for name in only]))
            return
        tables = {
            section: table([(row, read_results(files[row.name])) for row in of_section])
            for section, of_section in SECTIONS.items()
        }
        write_tables(options.page, tables)
    except (RuntimeError, ValueError, OSError) as error:
        sys.exit(f"accuracy: {error}")
    print(options.page)


if __name__ == "__main__":
    main()
