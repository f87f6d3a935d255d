"""What a second instrument saw: tables with and without a head, and lines that cannot be true."""

from pathlib import Path

import numpy as np
import pytest

from experiments.accept.tracker_table import read_tracker

TIME = np.arange(0.0, 4.0, 0.01)
SEEN = 1e3 * np.column_stack([np.sin(TIME), np.cos(2.0 * TIME), 0.3 * np.sin(3.0 * TIME)])  # mm, up to 2 m/s


def written(path: Path, head: str = "", seen: np.ndarray = SEEN, separator: str = ";") -> str:
    lines = [separator.join(f"{value:.4f}" for value in row) for row in np.column_stack([TIME, seen])]
    path.write_text("\n".join([head, *lines]) + "\n")
    return str(path)


@pytest.mark.parametrize(
    ("head", "separator"),
    [
        ("", ";"),
        ("# of the tracker", ";"),
        ("time;x;y;z", ";"),
        ("t_s;x_mm;y_mm;z_mm", ";"),
        ("Time [s],Pos X [mm],Pos Y [mm],Pos Z [mm]", ","),
        ("t x y z", " "),
        ("time in s\tx\ty\tz", "\t"),
        ("A;B;C;D", ";"),
        ('"Time";"X";"Y";"Z"', ";"),
        ("t [s]\tx [mm]\ty [mm]\tz [mm]", "\t"),
    ],
)
def test_a_head_line_may_be_there(tmp_path: Path, head: str, separator: str):
    found = read_tracker(written(tmp_path / "seen.csv", head, separator=separator), "mm")
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(found.position, 1e-3 * SEEN, atol=1e-7)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("x;y;z;time", "line 1: columns must be time, x, y, z in this order, the first is called 'x'"),
        ("time;y;x;z", "line 1: columns must be time, x, y, z in this order, the second is called 'y'"),
        ("t_ms;x;y;z", "line 1: the time must be in s, its column is called 't_ms'"),
        ("t;x_m;y_m;z_m", "line 1: a column is called 'x_m', but --unit is mm"),
        ("time;x;y", "line 2: 4 numbers, but 3 in line 1"),
    ],
)
def test_a_head_that_says_something_else_is_refused(tmp_path: Path, head: str, said: str):
    with pytest.raises(ValueError, match=said):
        read_tracker(written(tmp_path / "seen.csv", head), "mm")


@pytest.mark.parametrize("rows", [[0], [170], [399], [170, 171, 172], [100, 300]])
def test_a_coordinate_that_lost_its_decimal_point_is_named_with_its_line(tmp_path: Path, rows: list[int]):
    seen = SEEN.copy()
    seen[rows, 1] = 7e6
    more = f" and {len(rows) - 1} more" if len(rows) > 1 else ""
    with pytest.raises(
        ValueError, match=f"line {rows[0] + 2}{more}: y is 7e\\+06 mm, and .* beside it"
    ) as error:
        read_tracker(written(tmp_path / "seen.csv", "t;x;y;z", seen), "mm")
    assert "decimal point" in str(error.value)


def test_a_coordinate_that_is_ten_times_as_large_is_named_too(tmp_path: Path):
    seen = SEEN.copy()
    seen[200, 0] *= 10.0
    with pytest.raises(ValueError, match=r"line 202: x is 9093 mm, and 9\d\d\.\d mm beside it"):
        read_tracker(written(tmp_path / "seen.csv", "t;x;y;z", seen), "mm")


def test_a_beam_that_was_cut_and_another_unit_are_no_lost_decimal_points(tmp_path: Path):
    """After a gap the target is elsewhere; in metres every line is as far from the next one."""
    path = tmp_path / "seen.csv"
    kept = np.r_[0:100, 250:400]
    rows = [";".join(f"{value:.4f}" for value in row) for row in np.column_stack([TIME, SEEN])[kept]]
    path.write_text("\n".join(rows))
    assert len(read_tracker(str(path), "mm").time) == 250
    assert len(read_tracker(written(path), "m").time) == 400
