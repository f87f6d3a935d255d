"""Results that appear all at once, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer

from experiments.cli.command_table import naming, typed

PAGE = (".html", ".htm")
YAML = (".yaml", ".yml")
TABLE = (".csv", ".txt")


@contextmanager
def staged_folder(folder: str | Path, *names: str) -> Iterator[Path]:
    """Gives a temporary folder whose files move to ``folder`` when the block ends well.

    It is made on entry, inside ``folder`` or its nearest existing parent: where that fails, the results
    would have failed too, and one knows before the work begins. If the block raises, nothing remains.

    Args:
        folder: of the results.
        names: of files that will be written into it, as far as they are known; none of them may be a file
            that an option of the running command names, for whatever it is.

    Raises:
        OSError: if the folder cannot be made or written, or a file in it is named otherwise; one line that
            says which and why.
    """
    folder = Path(folder)
    refuse_replaced(folder, *names)
    stage = _stage(folder)
    try:
        yield stage
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for path in sorted(stage.iterdir()):
                os.replace(path, folder / path.name)
        except OSError as error:
            raise OSError(f"cannot write in folder {folder}: {_reason(error)}") from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)


@contextmanager
def staged_file(path: str | Path, *suffixes: str) -> Iterator[Path]:
    """The same for a single file: gives the path to write to, in the temporary folder.

    Args:
        path: of the file.
        suffixes: one of which its name must have, so that other programs know what it holds.

    Raises:
        OSError: if the file cannot be written, has another suffix, or is also what another option of the
            running command names, to be read or written; one line that says which and why.
    """
    path = Path(path)
    if path.is_dir():
        raise OSError(f"cannot write the file {path}: it is a folder")
    check_suffix(path, suffixes)
    if len(options := naming(path)) > 1:
        raise OSError(f"{' and '.join(options)} name the same file {path}: what is written needs its own")
    with staged_folder(path.parent) as stage:
        yield stage / path.name
        make_folder_of(path)


def check_folder_of(path: Path) -> None:
    """Raises OSError, one line, if the folder of a file cannot be made or written; makes nothing."""
    _stage(path.parent).rmdir()


def make_folder_of(path: Path) -> None:
    """Makes the folder of a file where there is none, and says so if somebody has typed it: it may be a slip.

    Raises:
        OSError: if it cannot be made.
    """
    is_new = not path.parent.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    if is_new and (option := typed(path)):
        typer.echo(f"Made the folder {path.parent} for {option} {path}", err=True)


def check_suffix(path: str | Path, suffixes: Sequence[str]) -> None:
    """Raises OSError, one line, if there are suffixes and the name of a file ends in none of them."""
    if suffixes and Path(path).suffix.lower() not in suffixes:
        raise OSError(f"cannot write the file {path}: its name must end in {' or '.join(suffixes)}")


def refuse_replaced(folder: Path, *names: str) -> None:
    """Raises OSError if an option of the running command names a file that results would replace."""
    for name in names:
        if others := naming(folder / name):
            raise OSError(f"{' and '.join(others)} {folder / name}: the results in {folder} would replace it")


def keep_files(stage: Path, folder: Path) -> None:
    """Copies what has been staged so far to ``folder``, for work that will end in an error.

    File by file, because the staged folder itself is readable by its owner alone.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for path in stage.iterdir():
        shutil.copyfile(path, folder / path.name)


def _stage(folder: Path) -> Path:
    """A new hidden folder inside a folder or its nearest existing parent.

    Raises:
        OSError: if it cannot be made; one line.
    """
    try:
        return Path(tempfile.mkdtemp(prefix=".truetip-", dir=_nearest_existing(folder)))
    except OSError as error:
        raise OSError(f"cannot write in folder {folder}: {_reason(error)}") from error


def _nearest_existing(folder: Path) -> Path:
    """The folder itself or its first parent that exists."""
    while not os.path.lexists(folder) and folder != folder.parent:
        folder = folder.parent
    return folder


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
