"""Files of a result: the old one or the new one, never half of one."""

import errno
import io
from pathlib import Path

import pytest

from experiments.report import files
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


def test_a_full_disk_is_reported_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    full = io.StringIO()

    def write(text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(full, "write", write)
    monkeypatch.setattr(files, "open", lambda *_, **__: full, raising=False)
    with pytest.raises(OSError, match=r"No space left on device: '.*page\.html'"):
        files.write_text(tmp_path / "page.html", "text")
