"""The manual names every key that a command writes with --json."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGES = [(ROOT / "docs" / "reference" / name).read_text() for name in ("results.md", "files.md")]
# Functions that make what --json writes; other functions of these names make parts of other files.
WRITERS = {
    "accept/cameras_command.py": ("judged",),
    "accept/robot_cycle.py": ("pose_results", "path_results"),
    "accept/robot_page.py": ("results",),
    "accept/tracker_command.py": ("_numbers",),
    "calibration/instruments_report.py": ("instruments_json", "_validation_json"),
    "calibration/report.py": ("calibration_json",),
    "cameras/accuracy.py": ("as_dict",),
    "cameras/budget.py": ("as_dict",),
    "cameras/calibration.py": ("calibration_json",),
    "cameras/study.py": ("study_json",),
    "cameras/sweeps.py": ("as_dict",),
    "compensate/report.py": ("compensation_json",),
    "feedforward/study.py": ("study_json",),
    "health/study.py": ("_alarm",),
    "identify/fine_tuning/report.py": ("fine_tuning_json", "_motion_json"),
    "identify/slow.py": ("slow_json",),
    "identify/study.py": ("identify_json",),
    "invert/study.py": ("invert_json",),
    "metrics/run_metrics.py": ("summary",),
    "modes/study.py": ("modes_json",),
    "plan/results.py": ("plan_json",),
    "record/runs_command.py": ("runs_below",),
    "station/guided.py": ("_link_json", "link_json"),
    "station/latency.py": ("as_dict",),
    "station/path_correction.py": ("_numbers",),
    "study/analysis.py": ("study_json",),
    "watch/data_rates.py": ("data_rates",),
    "watch/run.py": ("as_dict",),
    "watch/study.py": ("as_dict",),
    "zeros/study.py": ("zeros_json", "one_json"),
}


def written_keys(source: str, names: tuple[str, ...]) -> set[str]:
    """The literal keys of all dictionaries in the functions of these names.

    Raises:
        AssertionError: if there is no such function.
    """
    found = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef) and node.name in names
    ]
    assert {node.name for node in found} == set(names)
    inside = [part for node in found for part in ast.walk(node)]
    keys = [key for part in inside if isinstance(part, ast.Dict) for key in part.keys]
    keys += [
        part.slice for part in inside if isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Store)
    ]
    return {key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)}


@pytest.mark.parametrize("place", WRITERS)
def test_every_key_of_a_result_is_in_the_manual(place: str):
    keys = written_keys((ROOT / "experiments" / place).read_text(), WRITERS[place])
    assert keys
    assert not [key for key in sorted(keys) if not any(f"`{key}`" in page for page in PAGES)]
