"""Samples as the ADC's words, fewer parts, and further arrays of a run."""

import pickle
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.dataset import RunFormatError, RunInfo, RunWriter, StoredArray, StoredAxis, open_run
from rfgen_sionna.dataset.adc_words import AdcWords, decoded, encoded
from rfgen_sionna.radar import Adc
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import write_capture
from rfgen_sionna.signal.receiver.reception import convert

BITS, FULL_SCALE = 12, 10**-2.8


def quantised(radar, index, real=False):
    """A frame behind a 12-bit ADC at -26 dBm."""
    rng = np.random.default_rng(index)
    samples = rng.normal(0, 1e-5, radar.frame_shape) + 0j
    samples = samples.real if real else samples + 1j * rng.normal(0, 1e-5, radar.frame_shape)
    found = convert(samples, radar, Adc(BITS, -26.0, real=real))
    return {"adc": found.samples, "time": 0.1 * index, "full_scale": found.full_scale, "clipped": found.clipped}


def info_of(radar, **more):
    adc = {"bits": BITS, "full_scale_dbm": -26.0, "real": radar.adc.real, "iq_swap": False}
    return RunInfo(radar, receiver={"thermal_noise": True, "adc": adc}, **more)


@pytest.fixture(params=[False, True], ids=["complex", "real"])
def pair(request, tmp_path, radar):
    """The same run as words and as floats."""
    radar = replace(radar, adc=replace(radar.adc, real=request.param))
    for name, options in {"words": {"words": True, "compressed": True, "dated": False}, "floats": {}}.items():
        with RunWriter(tmp_path / f"{name}.h5", info_of(radar), **options) as writer:
            for index in range(3):
                writer.append(**quantised(radar, index, request.param))
    with open_run(tmp_path / "words.h5") as words, open_run(tmp_path / "floats.h5") as floats:
        yield words, floats


def test_words_are_the_samples_bit_for_bit(pair):
    words, floats = pair
    assert isinstance(words.adc, AdcWords)
    assert isinstance(floats.adc, h5py.Dataset)
    assert words.adc.words.dtype == np.int16
    assert words.adc.shape == floats.adc.shape
    assert (words.adc.ndim, words.adc.size, words.adc.dtype) == (5, floats.adc.size, floats.adc.dtype)
    for key in (
        slice(None),
        1,
        (0, 2),
        (slice(1, 3), ..., 3),
        (..., slice(2, 5)),
        (2, 0, 1, 1, 7),
        (1, slice(None, 2)),
    ):
        assert words.adc[key].tobytes() == floats.adc[key].tobytes(), key
    assert words.cube(slice(1, 3)).data.tobytes() == floats.cube(slice(1, 3)).data.tobytes()
    assert np.asarray(words.adc).tobytes() == floats.adc[:].tobytes()
    assert (words.full_scale, words.clipped) == (floats.full_scale, floats.clipped)
    assert pickle.loads(pickle.dumps(words)).adc[2].tobytes() == floats.adc[2].tobytes()


@given(st.integers(2, 16), st.floats(1e-9, 1e3), st.data())
@settings(deadline=None, max_examples=50)
def test_any_word_comes_back_at_any_scale(bits, full_scale, data):
    step, half = full_scale / 2 ** (bits - 1), 2 ** (bits - 1)
    levels = np.array(data.draw(st.lists(st.integers(-half, half - 1), min_size=1, max_size=20)), float)
    samples = levels * step + 1j * levels[::-1] * step
    words = encoded(samples.astype(np.complex64), step, bits)
    np.testing.assert_array_equal(words[:, 0], levels)
    assert decoded(words, step, True).tobytes() == (samples + 0.0).astype(np.complex64).tobytes()


def test_words_are_netcdf_that_xarray_scales(tmp_path, radar):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    given = quantised(radar, 0)
    with RunWriter(tmp_path / "run.h5", info_of(radar), words=True) as writer:
        writer.append(**given)
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as run:
        assert run.adc.dims == ("frame", "chirp", "tx", "rx", "sample", "iq")
        np.testing.assert_allclose(run.adc.sel(iq="I")[0], given["adc"].real, rtol=1e-6)


def test_samples_that_are_no_words_are_refused(tmp_path, radar):
    frame = quantised(radar, 0)
    with RunWriter(tmp_path / "run.h5", info_of(radar), words=True) as writer:
        with pytest.raises(ValueError, match=r"between the steps of the receiver's ADC \(12 bits"):
            writer.append(**frame | {"adc": frame["adc"] * 1.0001})
        with pytest.raises(ValueError, match="beyond the 12 bits"):
            writer.append(**frame | {"adc": frame["adc"] + 2 * FULL_SCALE})
        with pytest.raises(ValueError, match="full_scale is None"):
            writer.append(frame["adc"], time=0.0)
        writer.append(**frame)


@pytest.mark.parametrize("receiver", [None, {"adc": "none"}, {"adc": {"bits": 20, "full_scale_dbm": -26.0}}])
def test_samples_without_words_stay_floats(tmp_path, radar, frame, receiver):
    with RunWriter(tmp_path / "run.h5", RunInfo(radar, receiver=receiver), words=True, compressed=True) as writer:
        writer.append(frame(0)["adc"], time=0.0)
    with open_run(tmp_path / "run.h5") as run:
        assert run.adc.dtype == np.complex64
        np.testing.assert_array_equal(run.adc[0], frame(0)["adc"])


def test_parts_that_are_left_out_are_absent(tmp_path, info, frame):
    given = frame(0)
    with RunWriter(tmp_path / "run.h5", info, keep=("labels", "drai"), dated=False) as writer:
        writer.append(None, time=0.0, labels=given["labels"], full_scale=2.0)
        writer.append(None, time=0.1, labels=given["labels"], vertices=given["vertices"], full_scale=2.0)
    with open_run(tmp_path / "run.h5") as run:
        assert (len(run), run.contents, run.created, run.full_scale) == (2, ("drai", "labels"), "", 2.0)
        assert list(run.actors) == ["person", "ball"]
        assert run.actors["person"].joints(0).shape == (0, 3)
        with pytest.raises(RunFormatError, match="holds no samples: write runs with keep 'adc'"):
            _ = run.adc
        with pytest.raises(RunFormatError, match=r"holds no mesh of actor 'ball': .* keep 'body' or 'vertices'"):
            run.actors["ball"].vertices(0)
        with pytest.raises(RunFormatError, match="holds no mesh"):
            _ = run.actors["ball"].faces
    with h5py.File(tmp_path / "run.h5") as file:
        assert "adc" not in file
        assert set(file["actors/person"]) == set()


def test_all_parts_by_default(tmp_path, write):
    with open_run(write(tmp_path / "run.h5")) as run:
        assert run.contents == ("adc", "labels", "pir", "vertices", "joints")
        assert run.recording == {}


def test_further_arrays_with_axes(tmp_path, radar):
    ranges = StoredAxis(np.arange(5) * 0.1, "m", "distance")
    images = StoredArray(("range", "angle"), "dB", "images", axes={"range": ranges})
    points = StoredArray(("point", "field"), "", "points", "float64", {"field": StoredAxis(["x", "y"])}, ragged=True)
    arrays = {"representations/image": images, "cloud/points": points, "representations/level": StoredArray((), "W")}
    rng = np.random.default_rng(0)
    values = [rng.random((5, 3)).astype(np.float32) for _ in range(4)]
    clouds = [rng.random((count, 2)) for count in (2, 0, 3, 700)]
    shape = StoredArray(("coefficient",), "1", "of the body")
    with RunWriter(tmp_path / "run.h5", RunInfo(radar, arrays=arrays), keep=(), compressed=True) as writer:
        for index, (image, cloud) in enumerate(zip(values, clouds, strict=True)):
            row = {"representations/image": image, "cloud/points": cloud, "representations/level": index}
            writer.append(None, time=0.1 * index, arrays=row)
        writer.add_array("body/shape", np.arange(7.0), shape)
        with pytest.raises(ValueError, match="'body/shape' is in the run already"):
            writer.add_array("body/shape", np.arange(7.0), shape)
        with pytest.raises(ValueError, match=r"declared are \['cloud/points', "):
            writer.append(None, time=0.9)
        with pytest.raises(ValueError, match=r"as in the first frame is needed"):
            writer.append(None, time=0.9, arrays=row | {"representations/image": np.ones((5, 4))})
    with open_run(tmp_path / "run.h5") as run:
        assert set(run.arrays) == {*arrays, "body/shape"}
        found = run.arrays["representations/image"]
        assert (found.dims, found.units, found.axes["range"].units) == (("range", "angle"), "dB", "m")
        np.testing.assert_array_equal(found.axes["range"].values, ranges.values)
        assert run.arrays["cloud/points"].ragged
        assert list(run.arrays["cloud/points"].axes["field"].values) == ["x", "y"]
        np.testing.assert_array_equal(run.array("representations/image"), values)
        np.testing.assert_array_equal(run.array("representations/image", 2), values[2])
        np.testing.assert_array_equal(run.array("representations/level", slice(1, 3)), [1, 2])
        np.testing.assert_array_equal(run.array("body/shape"), np.arange(7))
        for got, cloud in zip(run.array("cloud/points", slice(1, None)), clouds[1:], strict=True):
            np.testing.assert_array_equal(got, cloud)
        np.testing.assert_array_equal(run.array("cloud/points", -1), clouds[-1])
        with pytest.raises(RunFormatError, match="holds no array 'representations/none'"):
            run.array("representations/none")


def test_declarations_that_cannot_be_are_named(tmp_path, radar):
    with pytest.raises(ValueError, match="different names are needed"):
        StoredArray(("a", "a"))
    with pytest.raises(ValueError, match=r"array.axes has \['b'\]"):
        StoredArray(("a",), axes={"b": StoredAxis([1])})
    for path in ("adc", "labels/x", "actors/person/x", "a//b", "../a"):
        with pytest.raises(ValueError, match="array path is"):
            RunInfo(radar, arrays={path: StoredArray(())})
    arrays = {"a/b": StoredArray(("c",), axes={"c": StoredAxis([1.0, 2.0])})}
    with RunWriter(tmp_path / "run.h5", RunInfo(radar, arrays=arrays), keep=()) as writer:
        with pytest.raises(ValueError, match="its axis 'c' has 2 values"):
            writer.append(None, time=0.0, arrays={"a/b": np.zeros(3)})
        writer.append(None, time=0.0, arrays={"a/b": np.zeros(2)})


def test_a_capture_of_words_is_that_of_the_samples(pair, tmp_path):
    words, floats = pair
    real = words.radar.adc.real
    for name, run in {"words": words, "floats": floats}.items():
        cube = AdcCube(run.adc, run.radar, run.frame_times)  # read frame by frame
        write_capture(cube, tmp_path / name, "dca1000", scale=run.full_scale / 2 ** (BITS - 1))
    files = {name: sorted((tmp_path / name).glob("*.bin")) for name in ("words", "floats")}
    assert files["words"], real
    for one, other in zip(*files.values(), strict=True):
        assert one.read_bytes() == other.read_bytes()
