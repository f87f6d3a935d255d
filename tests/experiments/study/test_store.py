"""The table of a study survives whatever interrupts it."""

import math
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.study.store import TABLE, StudyStore, columns_of

COLUMNS = columns_of({"station.payload": [0.0], "law_option": ["x"]}, ["max_norm_mm"])


def line(number: int, failure: str = "") -> dict:
    value = math.nan if failure else 0.1 * number
    return {
        "row": number,
        "point": number,
        "repetition": 0,
        "law": "open_loop",
        "seed": 0,
        "station.payload": 7.0,
        "law_option": "y",
        "max_norm_mm": value,
        "failure": failure,
        "wall_s": 1.0 + number,
        "command": f"truetip compare --set seed={number}",
    }


def complete(folder: Path, order: list[int], stops: set[int]) -> bytes:
    """Does rows in an order, with the process ended after some of them; the table's bytes."""
    store = StudyStore(folder, {"study": 1}, COLUMNS)
    for count, number in enumerate(order):
        store.add(line(number))
        if count in stops:
            store.flush()
            store = StudyStore(folder, {"study": 1}, COLUMNS)
    store.finish()
    return (folder / TABLE).read_bytes()


@pytest.mark.slow
@settings(max_examples=15)
@given(order=st.permutations(list(range(8))), stops=st.sets(st.integers(0, 7)))
def test_the_table_does_not_depend_on_order_and_interruptions(tmp_path_factory, order, stops):
    straight = complete(tmp_path_factory.mktemp("straight"), list(range(8)), set())
    assert complete(tmp_path_factory.mktemp("broken"), list(order), stops) == straight


def test_a_damaged_file_is_named_with_what_to_do(tmp_path):
    store = StudyStore(tmp_path, {"study": 1}, COLUMNS)
    store.add(line(0))
    store.flush()
    part = tmp_path / "parts" / "000000.parquet"
    whole = part.read_bytes()
    spoiled = whole[:8] + bytes(200) + whole[208:]
    for damaged in (b"", whole[:100], spoiled):
        part.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"000000.parquet is damaged: remove it, and what it had"):
            store.finished()
    for text in ("", "[]", '{"study": '):
        (tmp_path / "plan.json").write_text(text)
        with pytest.raises(ValueError, match=r"plan.json is damaged, so that nobody knows which study"):
            StudyStore(tmp_path, {"study": 1}, COLUMNS)


@pytest.mark.parametrize("is_complete", [False, True])
def test_rows_without_their_plan_are_not_taken_for_those_of_this_study(tmp_path: Path, is_complete: bool):
    store = StudyStore(tmp_path, {"study": 1}, COLUMNS)
    store.add(line(0))
    if is_complete:
        store.finish()
    store.flush()
    (tmp_path / "plan.json").unlink()
    with pytest.raises(ValueError, match=r"plan.json is missing, so that nobody knows which study"):
        StudyStore(tmp_path, {"study": 2}, COLUMNS)
    assert not (tmp_path / "plan.json").exists()


def test_a_folder_in_which_no_row_was_finished_needs_no_plan(tmp_path: Path):
    StudyStore(tmp_path, {"study": 1}, COLUMNS)
    (tmp_path / "plan.json").unlink()
    assert StudyStore(tmp_path, {"study": 2}, COLUMNS).finished() == set()


def test_a_finished_row_is_known_and_a_failed_one_can_be_done_again(tmp_path):
    store = StudyStore(tmp_path, {}, COLUMNS)
    store.add(line(0))
    store.add(line(1, failure="ran away"))
    store.finish()
    again = StudyStore(tmp_path, {}, COLUMNS)
    assert (again.finished(), again.finished(with_failures=False)) == ({0, 1}, {0})
    again.add(line(1))
    again.finish()
    assert pq.read_table(tmp_path / TABLE)["failure"].to_pylist() == ["", ""]
    assert pq.read_table(tmp_path / "times.parquet")["wall_s"].to_pylist() == [1.0, 2.0]


def test_rows_of_another_study_are_not_mixed_in(tmp_path):
    StudyStore(tmp_path, {"study": 1}, COLUMNS)
    with pytest.raises(ValueError, match=r"rows of another study \(its study differ\)"):
        StudyStore(tmp_path, {"study": 2}, COLUMNS)


def test_what_makes_it_another_study_is_named(tmp_path: Path):
    plan = {"study": {"seed": 1, "laws": ["pbvs"]}, "files": {"a.yaml": "1", "b.yaml": "2"}}
    StudyStore(tmp_path, plan, COLUMNS)
    other = {"study": plan["study"] | {"seed": 2}, "files": plan["files"] | {"b.yaml": "3"}}
    with pytest.raises(ValueError, match=r"another study \(its files b\.yaml, study seed differ\)"):
        StudyStore(tmp_path, other, COLUMNS)


def test_a_file_that_was_not_completed_is_not_read(tmp_path):
    store = StudyStore(tmp_path, {}, COLUMNS)
    store.add(line(0))
    store.flush()
    (tmp_path / "parts" / "000001.unfinished").write_bytes(b"PAR1")
    assert StudyStore(tmp_path, {}, COLUMNS).finished() == {0}
