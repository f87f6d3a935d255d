"""Names that entries of scenarios had before: what they mean now, so that older files go on working."""

from dataclasses import replace

from robots.configuration.nodes import Node

# From the path of an entry to the union whose fields it holds now, or one of them, and the only member for
# which it is meant, if there is one.
_FORMER: dict[tuple[str, str], tuple[str, str, str]] = {
    ("reference", "circle"): ("path", "", "circle"),
    ("reference", "figure_eight"): ("path", "", "figure_eight"),
    ("reference", "waypoints"): ("path", "waypoints", ""),
    ("station", "markers"): ("camera", "", ""),
}

# Groups that stand elsewhere now, as they are.
_MOVED = {
    ("station", "egm"): ("station", "link"),
    ("servo", "self_calibrating"): ("servo", "laws", "self_calibrating"),
}


# From a choice that was made with a name to the switch that it is now: on for that name.
_SWITCHES = {("station", "link", "on_break"): ("resume", ("servo", "guard", "resume"))}


def renamed(node: Node) -> Node:
    """A tree in which entries that stand under a former name stand under the present one.

    They choose no member of the union: they serve the members that have such fields.
    """
    if not isinstance(node.value, dict):
        return node
    for (group, old), (new, field, member) in _FORMER.items():
        inside = node.value.get(group)
        if inside is not None and isinstance(inside.value, dict) and old in inside.value:
            entries = {key: entry for key, entry in inside.value.items() if key != old}
            moved = inside.value[old]
            fields = {field: moved} if field else moved.value
            if not isinstance(fields, dict):
                raise moved.refuse(f"{group}.{old} must be a group, got {moved.plain!r}")
            present = entries.get(new) or Node({}, moved.place)
            if not member or not isinstance(present.value, str) or present.value == member:
                entries[new] = replace(present, aside=fields | present.aside)
            node = replace(node, value={**node.value, group: replace(inside, value=entries)})
    for former, present in _MOVED.items():
        node = _moved(node, former, present)
    for former, (name, present) in _SWITCHES.items():
        node = _switched(node, former, name, present)
    return node


def _switched(node: Node, former: tuple[str, ...], name: str, present: tuple[str, ...]) -> Node:
    """A tree whose choice at one path is the switch at another."""
    found = _found(node, former)
    if found is None:
        return node
    node = _without(node, former)
    return _with(node, present, replace(found, value=True)) if found.value == name else node


def _found(node: Node, path: tuple[str, ...]) -> Node | None:
    for key in path:
        if not isinstance(node.value, dict) or key not in node.value:
            return None
        node = node.value[key]
    return node


def _moved(node: Node, former: tuple[str, ...], present: tuple[str, ...]) -> Node:
    """A tree whose group at one path is part of the one at another path; what stands there already counts."""
    found = _found(node, former)
    if found is None:
        return node
    return _with(_without(node, former), present, found)


def _without(node: Node, path: tuple[str, ...]) -> Node:
    key, *rest = path
    below = {name: each for name, each in node.value.items() if name != key or rest}
    if rest:
        below[key] = _without(below[key], tuple(rest))
    return replace(node, value=below)


def _with(node: Node, path: tuple[str, ...], group: Node) -> Node:
    if not path:
        both = isinstance(node.value, dict) and isinstance(group.value, dict)
        return replace(node, value=group.value | node.value) if both else node
    key, *rest = path
    inside = node.value if isinstance(node.value, dict) else {}
    if not rest and key not in inside:
        return replace(node, value={**inside, key: group})
    below = inside.get(key, replace(group, value={}))
    return replace(node, value={**inside, key: _with(below, tuple(rest), group)})
