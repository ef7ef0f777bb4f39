"""What a run keeps is what its samples give, in any slice, and a run that keeps it needs no samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.dataset import RunFormatError
from rfgen_sionna.dataset.representations import KEPT, POINT_FIELDS, REPRESENTATIONS, checked_keep
from rfgen_sionna.processing import drai, micro_doppler, point_cloud, range_doppler

BALL = trimesh.creation.icosphere(subdivisions=1, radius=0.2)


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Any:
    return rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


@pytest.fixture(scope="module")
def simulator(radar: Any) -> Any:
    ball = rfgen.Actor.from_mesh(BALL, material="metal", position=(3, 0.5, 1), velocity=(1.5, 0, 0), name="ball")
    return rfgen.Simulator(None, radar, [ball], rtol=0.03)


@pytest.fixture(scope="module")
def stored(simulator: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("runs") / "stored.h5"
    with rfgen.record(path, simulator, 0.2, keep=REPRESENTATIONS, seed=5) as run:
        yield run


@pytest.fixture(scope="module")
def raw(simulator: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("runs") / "raw.h5"
    with rfgen.record(path, simulator, 0.2, keep=["adc"], words=True, seed=5) as run:
        yield run


@pytest.mark.parametrize("name", REPRESENTATIONS)
def test_a_stored_representation_is_the_one_computed_from_samples(stored: Any, raw: Any, name: str) -> None:
    assert set(stored.contents) == set(REPRESENTATIONS)
    assert raw.contents == ("adc",)
    for frames in (slice(None), slice(1, 3), slice(-1, None), slice(0, 0), slice(None, None, 2)):
        ours, theirs = stored.representation(name, frames), raw.representation(name, frames)
        # Of words the scale comes last, with a rounding of single precision.
        exact = {"rtol": 1e-5, "atol": 1e-7 * np.abs(theirs.values).max(initial=0.0)} if "doppler" in name else {}
        np.testing.assert_allclose(ours.values, theirs.values, **{"rtol": 0.0} | exact)
        assert (ours.dims, ours.units, len(ours)) == (theirs.dims, theirs.units, len(range(4)[frames]))
        assert (ours.dims, ours.units) == (KEPT[name].dims, KEPT[name].units)
        for dim, values in theirs.axes.items():
            np.testing.assert_array_equal(ours.axes[dim], values)
        if theirs.row_splits is not None:
            np.testing.assert_array_equal(ours.row_splits, theirs.row_splits)


def test_representations_are_those_of_processing(raw: Any, radar: Any) -> None:
    cube = raw.cube().data
    found = {name: raw.representation(name) for name in REPRESENTATIONS}
    maps = range_doppler(cube, radar)
    np.testing.assert_allclose(found["range_doppler"].values, maps.power, rtol=1e-5, atol=1e-7 * maps.power.max())
    np.testing.assert_allclose(found["range_doppler"].axes["velocity"], maps.velocity)
    np.testing.assert_allclose(found["drai"].values, drai(cube, radar).image, rtol=1e-6)
    assert found["drai"].values.shape == (4, 32, 32)
    spectra = micro_doppler(cube[2:3], radar)
    np.testing.assert_allclose(found["micro_doppler"].values[2], spectra.power, rtol=1e-6)
    np.testing.assert_allclose(found["micro_doppler"].axes["window"], spectra.time)
    cloud, points = point_cloud(cube[1], radar), found["point_cloud"].frame(1)
    assert points.shape == (len(cloud), len(POINT_FIELDS))
    np.testing.assert_allclose(points[:, :3], cloud.position, atol=1e-5)
    np.testing.assert_allclose(points[:, list(POINT_FIELDS).index("velocity")], cloud.velocity, atol=1e-5)
    # The ball is where it is, and moves away: that is what the points say.
    np.testing.assert_allclose(points[0, :3], [3.1, 0.5, 1.0], atol=0.3)


def test_units_and_axes_are_in_the_file(stored: Any) -> None:
    power = stored.stored("range_doppler/power")
    assert power.attrs["units"] == "W"
    assert [dim.label for dim in power.dims] == ["frame", "range", "velocity"]
    assert power.dims[1][0].attrs["units"] == "m"
    assert power.dims[2][0].attrs["units"] == "m s-1"
    assert list(stored.stored("point_cloud/points").dims[1][0].asstr()) == list(POINT_FIELDS)


def test_without_samples_nothing_is_computed(simulator: Any, stored: Any, tmp_path: Path) -> None:
    with pytest.raises(RunFormatError, match="no samples"):
        stored.representation("adc")
    with rfgen.record(tmp_path / "run.h5", simulator, 0.1, keep=["labels"]) as run:
        assert (run.contents, len(run)) == (("labels",), 2)
        assert run.full_scale is not None
        np.testing.assert_allclose(run.labels["distance"].values[:, 0], [3.06, 3.13], atol=0.05)
        with pytest.raises(RunFormatError, match="no samples"):
            run.representation("drai")
        with pytest.raises(RunFormatError, match="keep 'body' or 'vertices'"):
            run.actors["ball"].vertices(0)


def test_mistakes_are_named_before_any_frame(simulator: Any, radar: Any, tmp_path: Path) -> None:
    for keep, error, text in (
        (["adc", "range-doppler"], ValueError, "keep has 'range-doppler': allowed are adc, range_doppler"),
        ([], ValueError, "keep is empty"),
        ("adc", TypeError, "a list of names"),
        (["pir"], ValueError, "give pir_resolution"),
    ):
        with pytest.raises(error, match=text):
            rfgen.record(tmp_path / "run.h5", simulator, 0.1, keep=keep)
    doppler = rfgen.Radar.load("position2go", preset="doppler", position=(0, 0, 1), look_at=(3, 0, 1))
    sim = rfgen.Simulator(None, doppler, simulator.actors, rtol=0.03)
    with pytest.raises(ValueError, match="keep has 'point_cloud': radar 'position2go' with preset 'doppler'"):
        rfgen.record(tmp_path / "run.h5", sim, 0.5, keep=["point_cloud"])
    with pytest.raises(ValueError, match="keep has 'drai', which this radar has not"):
        rfgen.record(tmp_path / "run.h5", sim, 0.5, keep=["drai"])
    assert not list(tmp_path.iterdir())
    assert checked_keep(["labels", "adc"], False) == ("adc", "labels")


def test_an_interrupted_run_goes_on_with_what_it_keeps(simulator: Any, stored: Any, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    keep = (*REPRESENTATIONS, "paths", "body")
    options: dict[str, Any] = {"keep": keep, "seed": 5, "resume": True}
    with pytest.raises(KeyboardInterrupt):
        rfgen.record(tmp_path / "run.h5", simulator, 0.2, progress=interrupt, **options)
    with pytest.raises(rfgen.dataset.OutputError, match=r"settings.keep is"):
        rfgen.record(tmp_path / "run.h5", simulator, 0.2, **options | {"keep": ["adc"]})
    with (
        rfgen.record(tmp_path / "run.h5", simulator, 0.2, **options) as run,
        rfgen.record(tmp_path / "whole.h5", simulator, 0.2, **options) as whole,
    ):
        for name in REPRESENTATIONS:
            ours, theirs = (each.representation(name) for each in (run, whole))
            np.testing.assert_array_equal(ours.frame(1), theirs.frame(1))
            assert (len(ours), ours.frame(3).shape[1:]) == (4, theirs.frame(3).shape[1:])
        assert run.has_paths
        assert sorted(run.stored("paths")) == ["000000", "000001", "000002", "000003", "static"]
