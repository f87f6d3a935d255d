"""Tables in text files: which field belongs to which column."""

import pytest

from robots.text_table import TextTableError, finite_number, parse_fields

HEAD = "name\tx_mm\ty_mm\tremark"


def rows(*lines: str) -> list[list[str]]:
    return parse_fields("\n".join(lines), "t.txt", has_head=True).rows[1:]


def test_a_field_between_tabulators_may_be_empty_and_hold_blanks():
    assert rows(HEAD, "p 1\t1.5\t2\tby hand", "\t1.5\t2\t\t", "p\t\t2") == [
        ["p 1", "1.5", "2", "by hand"],
        ["", "1.5", "2"],
        ["p", "", "2"],
    ]


def test_a_row_with_more_tabulators_than_its_head_is_refused():
    table = parse_fields(f"{HEAD}\np\t\t1.5\t2\tok\n", "t.txt", has_head=True)
    with pytest.raises(TextTableError, match="line 2: 5 fields, but the head has 4"):
        table.refuse_longer_rows()


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_where_no_comma_separates(separator: str):
    table = parse_fields(f"x_mm{separator}y_mm\n1,5{separator}-2,25\n", "t.txt", has_head=True)
    assert [finite_number(field, table.separator) for field in table.rows[1]] == [1.5, -2.25]


def test_names_with_blanks_between_commas_are_names():
    assert rows("t [s],x [mm], y [mm]", "1,2,3") == [["1", "2", "3"]]
    assert rows("point, name\tx", "p\t1.5") == [["p", "1.5"]]


def test_any_blanks_separate_where_not_every_column_has_its_tabulator():
    assert rows("x_mm\t\ty_mm", "1\t2") == [["1", "2"]]
    assert rows("x_mm\ty_mm", "1 2") == [["1", "2"]]
