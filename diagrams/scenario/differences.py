"""What a scenario says that the default one does not."""

from typing import Any

import yaml

from diagrams.scenario.scenario import Scenario, scenario_text


class _AnyTag(yaml.CSafeLoader):
    """Reads values with a tag, such as ``!Payload {mass: 5}``, and keeps the tag beside them."""


def _tagged(loader: yaml.CSafeLoader, suffix: str, node: yaml.Node) -> dict[str, Any]:
    assert isinstance(node, yaml.MappingNode)
    return {"kind": suffix} | {
        str(key): value for key, value in loader.construct_mapping(node, deep=True).items()
    }


_AnyTag.add_multi_constructor("!", _tagged)


def scenario_differences(text: str, other: str | None = None) -> list[tuple[str, str, str]]:
    """Fields of a scenario whose values are not those of another one.

    Args:
        text: the scenario as YAML, all of its fields.
        other: likewise; None for the default scenario.

    Returns:
        Place such as ``station.camera.delay``, the value here and in the other, in the order of the text;
        a dash for what one of the two does not have.
    """
    here = _leaves(text)
    default = _leaves(scenario_text(Scenario()) if other is None else other)
    places = [*here, *(place for place in default if place not in here)]
    return [
        (place, here.get(place, "–"), default.get(place, "–"))
        for place in places
        if here.get(place) != default.get(place)
    ]


def scenario_tree(text: str) -> dict[str, Any]:
    """What stands in a scenario, also in one of another version: nothing is checked, and tags are ``kind``.

    Args:
        text: the scenario as YAML.

    Returns:
        Values by name, as far as the text is a scenario at all.
    """
    try:
        tree = yaml.load(text, Loader=_AnyTag)  # it extends the safe loader
    except yaml.YAMLError:
        return {}
    return tree if isinstance(tree, dict) else {}


def _leaves(text: str) -> dict[str, str]:
    return dict(_flat(scenario_tree(text), ""))


def _flat(value: Any, place: str) -> list[tuple[str, str]]:
    if isinstance(value, dict) and value:
        return [leaf for key, each in value.items() for leaf in _flat(each, f"{place}.{key}".lstrip("."))]
    if isinstance(value, list) and any(isinstance(each, dict) for each in value):
        return [leaf for number, each in enumerate(value, 1) for leaf in _flat(each, f"{place}.{number}")]
    return [(place, _text(value))]


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_text(each) for each in value) + "]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)
