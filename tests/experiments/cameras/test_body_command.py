"""``truetip cameras body`` writes a body that scenarios take, better on the path for which it was moved."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from experiments.main import app
from systems.vision.marker_body import load_body


@pytest.mark.slow
def test_the_body_that_is_written_can_be_read_and_is_better(tmp_path: Path):
    file, page = tmp_path / "body.yaml", tmp_path / "body.html"
    arguments = ["--write", str(file), "--report", str(page), "--json", "-"]
    result = CliRunner().invoke(app, ["cameras", "body", *arguments])
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["path_um"][1] < 0.9 * found["path_um"][0]
    assert found["workspace_um"][1] < found["workspace_um"][0]
    assert load_body(str(file)).markers_mm.tolist() == found["markers_mm"]
    text = page.read_text(encoding="utf-8")
    assert f"{found['path_um'][0]:.1f} to {found['path_um'][1]:.1f} µm in the mean along" in text
    for marker in found["markers_mm"]:
        assert "".join(f"<td>{value:.1f}</td>" for value in marker) in text


def test_no_steps_are_refused():
    result = CliRunner().invoke(app, ["cameras", "body", "--steps", "0"])
    assert result.exit_code == 2
    assert "--steps must be at least 1" in result.stderr
