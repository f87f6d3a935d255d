"""Text files of points, poses and transformations: what is read, what it means, and what is refused where."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robots.metrology.frame_files import points_of, poses_of, transform_of
from robots.metrology.number_table import NumberFileError, parse_table, read_table
from robots.pose import rotation_from_zyx

numbers = st.floats(-1e4, 1e4).map(lambda value: round(value, 6))
tables = st.integers(1, 7).flatmap(lambda n: st.lists(st.lists(numbers, min_size=n, max_size=n), min_size=1))


@given(tables, st.sampled_from([";", "; ", ",", " , ", " ", "\t"]), st.sampled_from(["\n", "\r\n", "\n\n"]))
def test_what_is_written_is_read(rows: list[list[float]], separator: str, end: str):
    text = "# a comment\n" + end.join(separator.join(map(repr, row)) for row in rows)
    assert np.array_equal(parse_table(text, "a file").values, np.array(rows))


@given(tables.filter(lambda rows: len(rows[0]) > 1), st.sampled_from([";", " "]))
def test_decimal_commas_mean_the_same_as_points(rows: list[list[float]], separator: str):
    text = "\n".join(separator.join(map(repr, row)).replace(".", ",") for row in rows)
    assert np.array_equal(parse_table(text, "a file").values, np.array(rows))


@given(st.lists(st.lists(st.floats(0.0, 1e3).map(lambda x: f"{x:.2f}"), min_size=3, max_size=3), min_size=1))
def test_decimal_commas_between_commas_are_never_taken_for_numbers(rows: list[list[str]]):
    text = "\n".join(",".join(row).replace(".", ",") for row in rows)
    with pytest.raises(NumberFileError, match="line 1: may be decimal commas"):
        parse_table(text, "a file")


@given(st.text(alphabet="0123456789+-.,;eE# \n\tnaif", max_size=60))
def test_any_text_is_either_read_or_refused(text: str):
    try:
        table = parse_table(text, "a file")
    except NumberFileError:
        return
    assert np.isfinite(table.values).all()
    assert table.values.shape == (len(table.lines), table.columns)


UNREADABLE = {
    "empty": ("# nothing\n\n", "the table is empty"),
    "word": ("1;2;3\n4;x;6", "line 2: 'x' is not a finite number"),
    "heading": (
        "x;y;z\n1;2;3",
        "line 1: a head line .'x'. has no meaning here: only numbers, # in front of it",
    ),
    "nan": ("1;2;3\n# comment\n4;nan;6", "line 3: 'nan' is not a finite number"),
    "overflow": ("1;2;1e999", "line 1: '1e999' is not a finite number"),
    "hexadecimal": ("1;2;0x1", "'0x1' is not"),
    "underscore": ("1;2;1_000", "'1_000' is not"),
    "gap": ("1;;3", "line 1: '' is not a finite number"),
    "ragged": ("1;2;3\n4;5", "line 2: 2 numbers, but 3 in line 1"),
    "some decimal commas": ("1,5,2,0\n1,2,0", "line 2: 3 numbers, but 4 in line 1 .decimal commas"),
    "thousands": ("1.234,5;2;3", "line 1: decimal points and decimal commas"),
    "two marks": ("1.5;2;3\n1,5;2;3", "line 2: decimal points and decimal commas in one file"),
    "commas and exponents": ("1,5e3,2,0", "line 1: may be decimal commas"),
    "two separators": ("1;2;3\n1 2 3", "line 2: 1 numbers, but 3"),
}


@pytest.mark.parametrize(("text", "reason"), UNREADABLE.values(), ids=UNREADABLE.keys())
def test_a_text_that_is_no_table_is_refused_with_its_line(text, reason, tmp_path: Path):
    file = tmp_path / "measured.txt"
    file.write_text(text)
    with pytest.raises(NumberFileError, match=reason) as refusal:
        read_table(file)
    assert str(refusal.value).startswith(str(file))


@pytest.mark.parametrize(
    "text", ["t;x\n1;2\n3;4", "t [s],x [m]\n1,2\n3,4", "t x\n1 2\n3 4", "# a\nt;x\n1,0;2\n3;4"]
)
def test_a_head_line_is_kept_where_one_may_be(text: str):
    table = parse_table(text, "a file", may_have_head=True)
    assert [name[0] for name in table.head] == ["t", "x"]
    assert table.values.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert table.where([1]) == f"a file, line {len(text.splitlines())}"
    assert parse_table("1;2\n3;4", "a file", may_have_head=True).head == ()


def test_files_that_are_none_are_refused(tmp_path: Path):
    with pytest.raises(NumberFileError, match=r"missing\.txt: no such file"):
        read_table(tmp_path / "missing.txt")
    (tmp_path / "binary.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(NumberFileError, match=r"binary\.txt: not a text file"):
        read_table(tmp_path / "binary.txt")


def test_a_byte_order_mark_is_no_number(tmp_path: Path):
    (tmp_path / "excel.txt").write_bytes("\ufeff1,5;2,5;3\r\n".encode())
    assert read_table(tmp_path / "excel.txt").values.tolist() == [[1.5, 2.5, 3.0]]


def test_units_say_how_large_the_numbers_are():
    table = parse_table("1;2;3\n250;0;0", "a file")
    assert points_of(table, "mm")[1] == pytest.approx([0.25, 0.0, 0.0])
    with pytest.raises(NumberFileError, match=r"line 2: 250 m is beyond 100 m \(is the unit m"):
        points_of(table, "m")
    with pytest.raises(ValueError, match="unit must be one of mm, m, got 'inch'"):
        points_of(table, "inch")


Rz, Ry, Rx = (
    Rotation.from_euler(axis, angle, True).as_matrix() for axis, angle in (("z", 30), ("y", 20), ("x", 10))
)
# The same orientation, written in the conventions of different makers.
SAME = {
    "ZYX": ("30;20;10", Rz @ Ry @ Rx),
    "XYZ": ("10;20;30", Rx @ Ry @ Rz),
    "xyz": ("10;20;30", Rz @ Ry @ Rx),
    "ZYZ": ("30;20;30", Rz @ Ry @ Rz),
    "rotvec": ("0;0;30", Rz),
    "wxyz": ("0.5;0.5;0.5;0.5", np.eye(3)[[2, 0, 1]]),
    "xyzw": ("1;0;0;0", np.diag([1, -1, -1])),
}


@pytest.mark.parametrize(("orientation", "case"), SAME.items(), ids=SAME.keys())
def test_conventions_mean_what_their_makers_mean(orientation, case):
    text, R = case
    X = poses_of(parse_table(f"100;200;300;{text}", "a file"), "mm", "deg", orientation)
    assert X[0, :3, :3] == pytest.approx(R, abs=1e-12)
    assert X[0, :3, 3] == pytest.approx([0.1, 0.2, 0.3])


def test_zyx_is_the_convention_of_the_package_and_radians_are_radians():
    X = poses_of(parse_table("0;0;1;0.3;-0.2;0.1", "a file"), "m", "rad", "ZYX")
    assert X[0, :3, :3] == pytest.approx(rotation_from_zyx(np.array([0.3, -0.2, 0.1])), abs=1e-12)


def test_twelve_numbers_are_a_matrix():
    M = np.column_stack([rotation_from_zyx(np.array([0.3, -0.2, 0.1])), [0.1, 0.2, 0.3]])
    X = poses_of(parse_table(";".join(map(repr, M.ravel().tolist())), "a file"), "m", "deg", "ZYX")
    assert X[0, :3] == pytest.approx(M, abs=1e-12)


FLAT = "1;0;0;5;0;1;0;6;0;0;{};7"
BAD_POSES = {
    "columns": ("1;2;3;4", "deg", "ZYX", "line 1: a pose takes 6 columns .* got 4"),
    "quaternion": ("1;2;3;1;0;0;0\n1;2;3;1;1;0;0", "deg", "wxyz", "line 2: a quaternion must have length 1"),
    "degrees": ("1;2;3;0;0;0\n1;2;3;90;0;0", "rad", "ZYX", "line 2: an angle of 90 rad is beyond two turns"),
    "left-handed": (FLAT.format(-1), "deg", "ZYX", "line 1: the rotation matrix is left-handed"),
    "singular": (FLAT.format(0), "deg", "ZYX", "line 1: the rotation matrix is singular"),
    "stretched": (FLAT.format(1.1), "deg", "ZYX", "line 1: .* orthogonal and of length 1"),
    "mixed units": (
        "300;200;400;0;0;0\n0.31;0.19;0.4;0;0;9\n290;210;410;0;0;0",
        "deg",
        "ZYX",
        "line 2: a position 0.5[0-9]+ mm from the origin, but 538.5 mm in the median.*units mixed",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "angles", "orientation", "reason"), BAD_POSES.values(), ids=BAD_POSES.keys()
)
def test_poses_that_cannot_be_meant_so_are_refused_with_their_line(text, angles, orientation, reason):
    with pytest.raises(NumberFileError, match=reason):
        poses_of(parse_table(text, "a file"), "mm", angles, orientation)


def test_a_printed_matrix_is_read_as_the_nearest_true_one():
    text = "0.985230 0.171207 0.003152 -252.3\n-0.171214 0.985231 0.002277 -174.8\n"
    text += "-0.002715 -0.002783 0.999992 0.46\n0 0 0 1"
    X = transform_of(parse_table(text, "a file"), "mm")
    assert X[:3, :3].T @ X[:3, :3] == pytest.approx(np.eye(3), abs=1e-14)
    assert X[0] == pytest.approx([0.985230, 0.171207, 0.003152, -0.2523], abs=1e-6)


BAD_MATRICES = {
    "three rows": ("1 0 0 0\n0 1 0 0\n0 0 1 0", "lines 1 to 3: .* takes 4 rows of 4 numbers, got 3"),
    "last row": ("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 1 1", "line 4: the last row .* must be 0 0 0 1"),
    "singular": ("1 0 0 0\n0 1 0 0\n0 0 0 0\n0 0 0 1", "lines 1 to 3: the rotation matrix is singular"),
    "left-handed": ("1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1", "left-handed, its determinant is -1"),
    "metres": ("1 0 0 250000\n0 1 0 0\n0 0 1 0\n0 0 0 1", "line 1: 250 m is beyond 100 m"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "reason"), BAD_MATRICES.values(), ids=BAD_MATRICES.keys())
def test_a_matrix_that_is_no_transformation_is_refused_with_its_line(text, reason):
    with pytest.raises(NumberFileError, match=reason):
        transform_of(parse_table(text, "a file"), "mm")


def test_a_refusal_names_the_lines_of_the_file_not_the_rows():
    table = parse_table("# tool 3\n\n1;2;3\n# again\n4;5;6\n7;8;9", "pivot.txt")
    assert table.where() == "pivot.txt, lines 3 to 6"
    assert table.where([1]) == "pivot.txt, line 5"
    assert re.fullmatch(r"pivot.txt, lines 3 to 5: far", str(table.error("far", [1, 0])))
