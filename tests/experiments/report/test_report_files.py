"""Files of a result: the old one or the new one, never half of one."""

import pytest

from experiments.report.files import write_json


def test_a_refused_number_leaves_the_old_file_and_no_rubbish(tmp_path):
    path = tmp_path / "summary.json"
    write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"a": float("nan")})
    with pytest.raises(FileNotFoundError):
        write_json(tmp_path / "missing" / "summary.json", {})
    assert [entry.name for entry in tmp_path.iterdir()] == ["summary.json"]
    assert path.read_text() == '{\n  "a": 1\n}\n'
