"""Scenario files: which there are, files that extend one another, and changes on top of them."""

from importlib.resources import files
from pathlib import Path

from diagrams.scenario.former_names import renamed
from diagrams.scenario.own_laws import key_parts
from robots.configuration.extended import FileKind, read_extended
from robots.configuration.nodes import YAML, ConfigurationError, Node, parse
from robots.configuration.suggestion import did_you_mean, why_no_file
from robots.configuration.typed import merged


class ScenarioError(ConfigurationError):
    """A scenario is missing, cannot be read, or asks for something impossible."""


class OptionSetting(str):
    """A change such as ``reference.laps=2`` that another option than ``--set`` has made; messages name it."""

    option: str
    _by: str

    def __new__(cls, key: str, value: object, option: str) -> "OptionSetting":
        """The change ``key=value`` by an option such as ``--laps``, or ``--faults loss=``."""
        # An empty name is a name that does not exist, and not what YAML makes of nothing.
        made = super().__new__(cls, f"{key}={repr('') if value == '' else value}")
        made._by = option
        made.option = f"{option}{value}" if option.endswith("=") else f"{option} {value}"
        return made

    def __getnewargs__(self) -> tuple[str, str, str]:
        """For other processes."""
        key, _, value = self.partition("=")
        return key, value, self._by


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    names = (entry.name for entry in _folder().iterdir())
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))


def read_scenario_nodes(name: str, settings: list[str], schema: type) -> Node:
    """What a scenario and the files that it extends say, with the settings applied.

    Args:
        name: a shipped scenario or the path of a YAML file.
        settings: changes such as ``"station.camera.delay=0.008"``; the value is read as YAML.
        schema: the dataclass that it will be, which says what is merged with what.

    Raises:
        ConfigurationError: if a file or a setting cannot be read.
    """
    node = read_extended(name, FileKind(schema, _find, renamed=renamed))
    for setting in settings:
        node = merged(node, renamed(_setting(setting)), schema)
    return node


def stated_keys(node: Node, path: str = "") -> set[str]:
    """All that files and settings say, by their places, such as ``station.camera.delay``."""
    if not isinstance(node.value, dict):
        return {path}
    inside = (stated_keys(each, f"{path}.{key}".lstrip(".")) for key, each in node.value.items())
    return {path}.union(*inside)


def _folder():
    return files("diagrams.scenario") / "data"


def _find(name: str, beside: Path) -> tuple[Path, str]:
    """Path and label of a scenario."""
    is_file = name.lower().endswith(YAML)
    path = beside / name if is_file else Path(str(_folder() / f"{name}.yaml"))
    if not path.is_file():
        allowed, guess = ", ".join(shipped_scenarios()), did_you_mean(name, shipped_scenarios())
        missing = why_no_file(beside / name, is_file, *YAML)
        raise ScenarioError(
            f"scenario '{name}': {missing}; give the path of a YAML file or one of {allowed}{guess}"
        )
    return path, f"scenario {path if is_file else name}"


def _setting(setting: str) -> Node:
    """A change as a tree with one entry."""
    key, separator, value = setting.partition("=")
    label = setting.option if isinstance(setting, OptionSetting) else f"--set {setting}"
    if not separator or not key.strip():
        raise ScenarioError(f"{label}: must look like station.camera.delay=0.008")
    node = parse(value, label, has_lines=False)
    for part in reversed(key_parts(key.strip())):
        node = Node({part: node}, label)
    return node
