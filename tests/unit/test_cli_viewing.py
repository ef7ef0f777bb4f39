"""`rfgen view` and the pages of `rfgen show --html`: runs, recordings of sets, captures, files of several radars."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rfgen_sionna import cli
from tests.unit.dataset.small_sets import make_set, write_part

pytestmark = pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
"""Thresholds of order statistics of few cells are integrals at the limit of their routine."""


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(cli.app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return "".join(result.output.split())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_set(tmp_path_factory.mktemp("sets") / "gestures", count=3, per_shard=2)


def test_a_page_of_a_recording_is_written_in_place_of_pictures(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "two.html"
    assert f"wrote{page}" in run("show", folder, "--recording", "2", "--html", page)
    assert "a person does a push" in page.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [page]


def test_a_recording_is_summarised_and_drawn(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    out = run("show", folder, "--recording", "1")
    assert "recording1ofadataset,splittrain,attempt0" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gestures-000001.gif", "gestures-000001.png"]


def test_what_is_no_recording_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="has no recording 7"):
        run("show", folder, "--recording", "7")
    with pytest.raises(ValueError, match="--recording N takes one of its recordings"):
        run("show", folder)
    write_part(tmp_path / "part.h5", 0, "push", "train")
    with pytest.raises(ValueError, match=r"no folder of a data set"):
        run("view", tmp_path / "part.h5", "--recording", "0")
    with pytest.raises(ValueError, match="--partial is for captures"):
        run("view", folder, "--recording", "0", "--partial")


def test_files_of_several_radars_have_a_page_each(tmp_path: Path) -> None:
    source = tmp_path / "two.h5"
    write_part(source, 0, "push", "train", radars=("left", "right one"), frames=2)
    run("show", source, "--html", tmp_path / "page.html")
    pages = {"page-left.html", "page-right-one.html"}
    assert {path.name for path in tmp_path.glob("*.html")} == pages
    run("show", source, "--html", tmp_path / "own.html", "--radar", "left")
    assert {path.name for path in tmp_path.glob("*.html")} == {*pages, "own-left.html"}
    pytest.importorskip("rerun")
    with pytest.raises(ValueError, match="name one of them"):
        run("view", source, "--save", tmp_path / "two.rrd")
    run("view", source, "--save", tmp_path / "two.rrd", "--radar", "right one")
    assert (tmp_path / "two.rrd").stat().st_size > 10_000


def test_recordings_and_captures_open_in_rerun(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    target = tmp_path / "one.rrd"
    assert f"wrote{target}" in run("view", folder, "--recording", "1", "--save", target)
    assert target.stat().st_size > 10_000
    write_part(tmp_path / "part.h5", 0, "push", "train", frames=2)
    run("export", tmp_path / "part.h5", "--format", "dca1000", "--output", tmp_path)
    run("view", tmp_path, "--save", target, "--overwrite")
    run("show", tmp_path, "--html", tmp_path / "capture.html")
    assert "adc_data.bin" in (tmp_path / "capture.html").read_text(encoding="utf-8")
