"""The legs of a file: every place that it moves to, in the order in which it does, or a refusal."""

from pathlib import Path

import pytest

from experiments.plan.legs import legs_of
from robots.description.model import load_robot

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSES = "x_mm,y_mm,z_mm,qw,qx,qy,qz"
UNREADABLE = {
    "no number": (HEAD, "10,nan,90,0,30,0", "q2 is not a number: 'nan'"),
    "typing error": (HEAD, "10,-80,9o,0,30,0", "q3 is not a number: '9o'"),
    "short row": (HEAD, "10,-80", "q3 is not a number: ''"),
    "long row": (HEAD, "10,-80,90,0,30,0,5", "there are 7 values for 6 columns"),
    "beyond all numbers": (HEAD, "1e999,-80,90,0,30,0", "a number is infinite"),
    "no rotation": (POSES, "1100,0,900,0,0,0,0", "the quaternion is zero"),
}


@pytest.mark.parametrize(("head", "row", "why"), UNREADABLE.values(), ids=UNREADABLE)
def test_a_way_point_that_cannot_be_read_is_refused_and_never_passed_by(
    tmp_path: Path, head: str, row: str, why: str
):
    first, last = ("1100,-40,900,0,1,0,0", "1100,60,900,0,1,0,0") if head is POSES else (
        "0,-90,90,0,30,0", "20,-80,90,0,30,0"
    )  # fmt: skip
    table = tmp_path / "way.csv"
    table.write_text("\n".join([head, first, row, last, ""]))
    with pytest.raises(ValueError, match="line 3") as refused:
        legs_of(load_robot("kr16"), str(table))
    assert str(refused.value).startswith(f"{table}, line 3: {why}")
