"""Options by their former names, so that scripts of earlier versions run on."""

from collections.abc import Mapping, Sequence

_PAGE = {"--out": "--report"}
_FILE = {"--out": "--write"}

FORMER: Mapping[str, Mapping[str, str]] = {
    "accept cameras": {**_PAGE, "--box": "--cube"},
    "accept robot": _PAGE,
    "accept tracker": _PAGE,
    "calibrate": {"--cell": "--instruments"},
    "cameras budget": _PAGE,
    "cameras calibrate": {**_PAGE, "--images": "--recording", "--observations": "--write-recording"},
    "cameras study": _PAGE,
    "cell": {"--images": "--show-images"},
    "compensate": _FILE,
    "design": _FILE,
    "diagram": _FILE,
    "drivetrain": _PAGE,
    "feedforward": _PAGE,
    "identify": {"--cases": "--motions"},
    "invert": _PAGE,
    "modes": {**_PAGE, "--mode": "--shape"},
    "record": {**_FILE, "--mcap": "--write-recording"},
    "robots import": {"--base": "--base-link", "--tip": "--tip-link"},
    "watch": _PAGE,
    "zeros": _PAGE,
}
# --out of this command was the folder of its page.
_FOLDERS = {"feedforward": "feedforward.html"}


def renamed(command: str, args: Sequence[str]) -> list[str]:
    """The arguments of a command with the options as they are called today.

    Args:
        command: its name, ``accept robot``.
        args: as they were typed.
    """
    names, page = FORMER.get(command, {}), _FOLDERS.get(command)
    result, is_folder = [], False
    for index, arg in enumerate(args):
        if arg == "--":
            return [*result, *args[index:]]
        name, equals, value = arg.partition("=")
        if is_folder:
            arg = f"{arg}/{page}"
        is_folder = False
        if name in names:
            is_in = page is not None and name == "--out"
            is_folder = is_in and not equals
            arg = names[name] + equals + (f"{value}/{page}" if is_in and equals else value)
        result.append(arg)
    return result
