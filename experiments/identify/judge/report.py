"""What the full simulation says of an identification: in words, as a table, as JSON."""

from typing import Any

from experiments.identify.judge.judge import BEFORE, FOUND, WRITTEN, Verdict
from experiments.report.plot_page import Section, html_table

_UNITS = {"gyro": "rad/s", "accelerometer": "m/s²"}
_BY_MOTORS = ["before", "as written", "as found", "linear before", "linear as found"]
_IN_LOOP = ["in loop before", "in loop as written"]


def judged(verdict: Verdict) -> str:
    """A sentence for each kind of sensors."""
    said = []
    for kind in verdict.kinds:
        before, written, found = (verdict.left(kind, "full", name) for name in (BEFORE, WRITTEN, FOUND))
        said.append(
            f"In the full simulation {kind}s are off by {found:.1%} of what they show with the values found, "
            f"{written:.1%} with the robot as written and {before:.1%} with the one before; in the linear "
            f"model by {verdict.left(kind, 'linear', FOUND):.1%}."
        )
    if verdict.motors:
        before, written = (1e3 * verdict.motors[name] for name in (BEFORE, WRITTEN))
        said.append(f"In closed loop motors are off by {written:.3f} mrad, {before:.3f} before.")
    return " ".join(said)


def judge_head(verdict: Verdict) -> list[str]:
    """Of the table."""
    return ["motion", "sensors", "unit", "measured", *_BY_MOTORS, *(_IN_LOOP if verdict.motors else [])]


def judge_rows(verdict: Verdict) -> list[list[str]]:
    """Root mean squares, a row for each motion and kind of sensors."""
    rows = []
    for row in verdict.rows:
        values = [row.measured, *(row.full[name] for name in (BEFORE, WRITTEN, FOUND))]
        values += [row.linear[name] for name in (BEFORE, FOUND)]
        values += [row.driven[name] for name in (BEFORE, WRITTEN) if row.driven]
        rows.append([row.case, row.kind, _UNITS[row.kind], *(f"{value:.4f}" for value in values)])
    return rows


def judge_summary(verdict: Verdict) -> list[list[str]]:
    """The same over all motions, as shares of what was measured; the head is `SUMMARY_HEAD`."""
    rows = []
    for kind in verdict.kinds:
        ways = [("full", name) for name in (BEFORE, WRITTEN, FOUND)]
        ways += [("linear", name) for name in (BEFORE, FOUND)]
        rows.append([kind, *(f"{verdict.left(kind, *way):.2%}" for way in ways)])
    return rows


SUMMARY_HEAD = ["sensors", *_BY_MOTORS]


def judge_section(verdict: Verdict) -> Section:
    """Of the page."""
    note = (
        f"{judged(verdict)} Root mean squares of measured readings about those at rest, and of what is left "
        "of them. Motors move as measured, in the full nonlinear simulation of the robot as it was believed "
        "to be, as it is written (with former values where motions hardly show any) and with all values "
        "found, and in the model that identifies. Where the values found leave as much in both, that model "
        "was good enough."
    )
    return Section("Full simulation as the judge", note, html_table(judge_head(verdict), judge_rows(verdict)))


def judge_json(verdict: Verdict) -> dict[str, Any]:
    """The numbers in SI units; `left` is a share of what was measured, over all motions."""
    numbers: dict[str, Any] = {
        "left": {
            kind: {
                "full": {name: verdict.left(kind, "full", name) for name in (BEFORE, WRITTEN, FOUND)},
                "linear": {name: verdict.left(kind, "linear", name) for name in (BEFORE, FOUND)},
            }
            for kind in verdict.kinds
        },
        "motions": [
            {
                "case": row.case,
                "kind": row.kind,
                "measured": row.measured,
                "full": row.full,
                "linear": row.linear,
            }
            | ({"closed_loop": row.driven} if row.driven else {})
            for row in verdict.rows
        ],
    }
    if verdict.motors:
        numbers["closed_loop_motors_rad"] = verdict.motors
    return numbers
