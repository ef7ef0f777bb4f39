"""A run in Rerun, read back from the file."""

import builtins

import numpy as np
import pytest

from rfgen_sionna.dataset import OutputError, open_run
from rfgen_sionna.show import open_in_rerun
from tests.unit.dataset.small_sets import write_part


@pytest.fixture(scope="module")
def saved(run_path, tmp_path_factory):
    pytest.importorskip("rerun.chunk")
    return open_in_rerun(run_path, save=tmp_path_factory.mktemp("rerun") / "ball.rrd")


def chunks(path):
    """Tables of a file by the names of their entities."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(chunk.entity_path, []).append(chunk)
    return found


def column(chunk, wanted):
    """Values in each row of a column."""
    batch = chunk.to_record_batch()
    name = next(name for name in batch.schema.names if name.split(":")[-1] == wanted)
    return batch.column(name).to_pylist()


def test_everything_stands_on_one_time_line(saved, run):
    found = chunks(saved)
    moving = (
        "/world/actors/ball/mesh", "/world/point_cloud", "/range_doppler", "/pir/energy", "/pir/time_of_arrival",
        "/pir/velocity", "/doppler_time/now", "/range_time/now", "/texts/labels", "/labels/distance/ball",
    )  # fmt: skip
    for path in moving:
        assert sum(len(chunk) for chunk in found[path]) == len(run), path
        for chunk in found[path]:
            assert {"time", "frame"} <= set(chunk.timeline_names)
    for path in ("/world", "/world/radar", "/doppler_time", "/texts/report"):
        assert found[path][0].is_static
    times = np.concatenate([column(chunk, "time") for chunk in found["/world/point_cloud"]])
    seconds = [np.timedelta64(value) / np.timedelta64(1, "s") for value in times]
    assert seconds == pytest.approx(run.frame_times)


def test_meshes_and_points_stand_in_the_world_with_z_up(saved, run):
    found = chunks(saved)
    rows = [each for chunk in found["/world/actors/ball/mesh"] for each in column(chunk, "vertex_positions")]
    for frame in (0, 3):
        middle = np.mean(rows[frame], axis=0)
        np.testing.assert_allclose(middle, run.actors["ball"].vertices(frame).mean(axis=0), atol=2e-3)
    points = [each for chunk in found["/world/point_cloud"] for each in column(chunk, "positions")]
    assert np.linalg.norm(np.array(points[0]) - [2.5, 1.0, 1.2], axis=1).min() < 0.1
    (axes,) = column(found["/world"][0], "xyz")
    assert axes == [[3, 5, 1]]  # right, forward, up: Rerun's right-handed z up
    (place,) = column(found["/world/radar"][0], "translation")
    np.testing.assert_allclose(place, [run.radar.position], atol=1e-6)
    (rotation,) = column(found["/world/radar"][0], "mat3x3")
    np.testing.assert_allclose(np.reshape(rotation, (3, 3)).T, run.radar.rotation, atol=1e-6)


def test_labels_and_conventions_are_text(saved):
    found = chunks(saved)
    (report,) = column(found["/texts/report"][0], "text")
    assert "right-handed, z up" in report[0]
    assert "a ball rolling away" in report[0]
    texts = [each for chunk in found["/texts/labels"] for each in column(chunk, "text")]
    assert "action: rolling" in texts[0][0]
    assert "radial velocity: 0.8 m s-1" in texts[0][0]
    (distance,) = [each for chunk in found["/labels/distance/ball"] for each in column(chunk, "scalars")][:1]
    assert distance[0] == pytest.approx(np.linalg.norm([2.5, 1.0, 0.2]))


def test_a_recording_of_joints_has_bones(tmp_path):
    pytest.importorskip("rerun.chunk")
    write_part(tmp_path / "part.h5", 3, "wave", "train", keep=("joints", "labels"))
    found = chunks(open_in_rerun(tmp_path / "part.h5", save=tmp_path / "part.rrd"))
    assert "/world/actors/person/mesh" not in found
    assert "/range_doppler" not in found
    rows = [each for chunk in found["/world/actors/person/joints"] for each in column(chunk, "positions")]
    with open_run(tmp_path / "part.h5") as run:
        np.testing.assert_allclose(rows[2], run.actors["person"].joints(2), atol=1e-3)
    bones = column(found["/world/actors/person/bones"][0], "strips")
    assert np.shape(bones[0]) == (21, 2, 3)


def test_errors_come_first(run_path, saved, tmp_path, monkeypatch):
    with pytest.raises(OutputError, match="exists"):
        open_in_rerun(run_path, save=saved)
    with pytest.raises(ValueError, match=r"allowed: \.rrd"):
        open_in_rerun(run_path, save=tmp_path / "run.bag")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(OSError, match="no display"):
        open_in_rerun(run_path)


def test_without_rerun_the_error_says_how_to_get_it(run_path, tmp_path, monkeypatch):
    real = builtins.__import__

    def absent(name, *args, **options):
        if name.split(".")[0] == "rerun":
            raise ImportError(name)
        return real(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(ImportError, match=r"pip install 'rfgen-sionna\[view\]'"):
        open_in_rerun(run_path, save=tmp_path / "run.rrd")
