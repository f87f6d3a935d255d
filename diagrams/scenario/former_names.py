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
    return node
