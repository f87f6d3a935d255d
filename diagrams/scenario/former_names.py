"""Names that entries of scenarios had before: what they mean now, so that older files go on working."""

from robots.configuration.nodes import Node

# From the path of an entry to the path under which it stands now, and the member of a union that it selects.
_FORMER: dict[tuple[str, str], tuple[str, str, str]] = {
    ("reference", "circle"): ("path", "", "circle"),
    ("reference", "figure_eight"): ("path", "", "figure_eight"),
    ("reference", "waypoints"): ("path", "waypoints", ""),
}


def renamed(node: Node) -> Node:
    """A tree in which entries that stand under a former name stand under the present one.

    What stands under the present name already goes before; a shape that is not the chosen one is left out.
    """
    if not isinstance(node.value, dict):
        return node
    for (group, old), (new, field, member) in _FORMER.items():
        inside = node.value.get(group)
        if inside is not None and isinstance(inside.value, dict) and old in inside.value:
            entries = {key: entry for key, entry in inside.value.items() if key != old}
            moved = inside.value[old]
            moved = Node({field: moved}, moved.place) if field else Node(moved.value, moved.place, member)
            entries[new] = _joined(moved, entries.get(new))
            group_node = Node(entries, inside.place, inside.tag)
            node = Node({**node.value, group: group_node}, node.place, node.tag)
    return node


def _joined(moved: Node, present: Node | None) -> Node:
    """What stood under a former name, under what the present name says."""
    if present is None:
        return moved
    chosen = present.tag or (present.value if isinstance(present.value, str) else "")
    if moved.tag and chosen and chosen.replace("_", "").lower() != moved.tag.replace("_", ""):
        return present
    entries = present.value if isinstance(present.value, dict) else {}
    below = moved.value if isinstance(moved.value, dict) else {}
    return Node({**below, **entries}, present.place, chosen or moved.tag)
