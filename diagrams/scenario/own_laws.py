"""Gains of laws of one's own, below `servo.laws` under their names: ``my_law.py:MyLaw: {translation: 8}``."""

import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from robots.configuration.nodes import ConfigurationError, Node
from robots.configuration.suggestion import did_you_mean
from robots.configuration.typed import typed
from systems.servo import LAWS
from systems.servo.contract import law_traits
from systems.servo.law_config import LawConfig

_PLACE = "servo.laws"
_KEY = re.compile(rf"({re.escape(_PLACE)})\.(.+?\.py:\w+)(?:\.(.+))?")


def key_parts(key: str) -> list[str]:
    """The names in a key such as ``servo.laws.my_law.py:MyLaw.translation``; a law's has dots of its own."""
    found = _KEY.fullmatch(key)
    if found is None:
        return key.split(".")
    place, law, below = found.groups()
    return [*place.split("."), law, *(below.split(".") if below else [])]


def without_own_laws(node: Node) -> tuple[Node, dict[str, Node]]:
    """A scenario without the gains of laws of one's own, and these by the names of the laws.

    Raises:
        ConfigurationError: if there is no such law, or it has not such gains.
    """
    servo = node.value.get("servo") if isinstance(node.value, dict) else None
    laws = servo.value.get("laws") if servo is not None and isinstance(servo.value, dict) else None
    if servo is None or laws is None or not isinstance(laws.value, dict):
        return node, {}
    own = {name: entry for name, entry in laws.value.items() if name not in LAWS}
    for name, entry in own.items():
        if ".py:" not in name:
            raise entry.refuse(
                f"unknown key '{_PLACE}.{name}'; known here: {', '.join(LAWS)}, or FILE.py:CLASS of a law of "
                f"one's own{did_you_mean(name, LAWS)}"
            )
        _gains(_law(name, entry), name, entry)
    shipped = replace(laws, value={name: entry for name, entry in laws.value.items() if name in LAWS})
    servo = replace(servo, value={**servo.value, "laws": shipped})
    return replace(node, value={**node.value, "servo": servo}), own


def own_gains(law: type, own: Mapping[str, Node]) -> LawConfig:
    """Gains and limits of a law of one's own: those that are said of it, and its class's for all others.

    Args:
        law: its class.
        own: what is said of which law, as of `without_own_laws`.

    Raises:
        ConfigurationError: if there is no such law, or it has not such gains.
    """
    said = {name: node for name, node in own.items() if _are_same(_law(name, node), law)}
    if not said:
        return law_traits(law).Config()
    entries = {key: entry for node in said.values() for key, entry in node.value.items()}
    name, node = next(iter(said.items()))
    return _gains(law, name, replace(node, value=entries))


def _gains(law: type, name: str, said: Node) -> LawConfig:
    return typed(said, law_traits(law).Config, f"{_PLACE}.{name}")


def _law(name: str, said: Node) -> type:
    try:
        return LAWS.find(name)
    except ValueError as error:
        raise ConfigurationError(f"{said.place}: {error}") from error


def _are_same(one: type, other: type) -> bool:
    """Whether two classes are one, also where its file was imported under two names."""
    if one is other or one.__qualname__ != other.__qualname__:
        return one is other
    files = [getattr(sys.modules.get(each.__module__), "__file__", None) for each in (one, other)]
    return None not in files and Path(str(files[0])).resolve() == Path(str(files[1])).resolve()
