"""Tables of the manual from the numbers of their commands."""

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from experiments.bench.accuracy.rows import Row
from experiments.metrics.laps import SLOWED

HEAD = ("with", "runs", "lap 1, mm and °", "lap 2, mm and °", "at rest, mm", "within the ellipsoid")
AFTER = "after the event, mm"
_PLACE = re.compile(r"(<!-- accuracy: (?P<name>\S+) -->\n).*?(<!-- end -->)", re.S)


def table(rows: Iterable[tuple[Row, Sequence[dict[str, Any]]]]) -> str:
    """A table of rows and what `robustness` found for each, a case a line; worst, and medians in brackets."""
    found = [(row, result) for row, results in rows for result in results]
    has_events = any("recovered_mm" in result for _, result in found)
    head = (*HEAD[:-1], *([AFTER] if has_events else []), HEAD[-1])
    lines = [_line(head), _line(["---", *["--:"] * (len(head) - 1)])]
    for number, (row, result) in enumerate(found):
        is_first = number == 0 or found[number - 1][0] is not row
        said = f"`{row.options}`{': ' if row.what else ''}{row.what}" if is_first else ""
        is_one_of_many = sum(other is row for other, _ in found) > 1
        if is_one_of_many:
            said += f"{' ' if said else ''}{result['case']}"
        cells = [said, str(result["runs"])]
        first, last = (_lap(lap) for lap in result["laps"])
        # Of a lap on which something happens the largest error is the blow itself.
        cells += ["" if "recovered_mm" in result else first, last]
        cells.append(_both(result["static_mm"], 4))
        if has_events:
            cells.append(_both(result["recovered_mm"]) if "recovered_mm" in result else "")
        worst, share = result["coverage"]
        cells.append(f"{share:.3f}, {worst:.3f}")
        lines.append(_line(cells))
    return "\n".join(lines)


def write_tables(page: Path, tables: dict[str, str]) -> None:
    """Puts tables into a page, each between ``<!-- accuracy: NAME -->`` and ``<!-- end -->``.

    Raises:
        ValueError: if the page has a place for a table that there is not, or none for one that there is.
    """
    text = page.read_text(encoding="utf-8")
    places = [match["name"] for match in _PLACE.finditer(text)]
    if sorted(places) != sorted(tables):
        raise ValueError(
            f"{page}: has places for {', '.join(places) or 'no table'}, not for {', '.join(tables)}"
        )
    filled = _PLACE.sub(lambda match: f"{match[1]}\n{tables[match['name']]}\n\n{match[3]}", text)
    page.write_text(filled, encoding="utf-8")


def read_results(file: Path) -> list[dict[str, Any]]:
    """What a command has written, a result a case.

    Raises:
        ValueError: if a run broke off: a table of the others would not say so.
    """
    results = json.loads(file.read_text(encoding="utf-8"))["results"]
    for result in results:
        if result["failures"]:
            raise ValueError(f"{file}: {result['failures'][0]}")
    return results


def _lap(lap: dict[str, tuple[float, float]]) -> str:
    (worst, median), (angle, _) = lap["max_norm_mm"], lap["max_angle_deg"]
    said = f"{worst:.3f} ({median:.3f}), {angle:.3f}"
    if "times_planned" not in lap:  # measured before it was kept: unknown
        return said
    longest, usual = lap["times_planned"]
    return f"{said}, × {longest:.2f} ({usual:.2f})" if longest > SLOWED else said


def _both(values: tuple[float, float], digits: int = 3) -> str:
    worst, median = values
    return f"{worst:.{digits}f} ({median:.{digits}f})"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"
