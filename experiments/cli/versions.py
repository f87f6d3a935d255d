"""Versions of what decides about a number."""

from importlib.metadata import PackageNotFoundError, version

_DECIDING = ("truetip", "drake", "numpy", "scipy")
_MARK = "# made with "


def installed_versions() -> dict[str, str]:
    """Of truetip and the packages that compute."""
    found = {}
    for name in _DECIDING:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def versions_line() -> str:
    """They as a comment of a file, which `versions_in` finds."""
    return f"{_MARK}{', '.join(f'{name} {number}' for name, number in installed_versions().items())}"


def versions_in(text: str) -> dict[str, str]:
    """The versions of a `versions_line` in a text, none if there is no such line."""
    line = next((line for line in text.splitlines() if line.startswith(_MARK)), _MARK)
    words = (each.strip().partition(" ") for each in line.removeprefix(_MARK).split(","))
    return {name: number for name, _, number in words if number}
