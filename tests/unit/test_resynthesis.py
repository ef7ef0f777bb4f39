"""Stored paths give the samples that a trace gives: the same bits for the same radar, the same echoes for others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.dataset import RunFormatError
from rfgen_sionna.dataset.stored_paths import read_frame_paths
from rfgen_sionna.radar import Trajectory
from rfgen_sionna.records import Pir
from rfgen_sionna.resynthesis import Resynthesis, resynthesize
from rfgen_sionna.signal import Receiver
from rfgen_sionna.signal.noise import noise_seed
from tests.sionna.rectangles import scene_of, wall

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
RTOL = 0.01
KEEP = ("adc", "body", "labels", "paths")


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Any:
    return rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


def ball(x: float = 3.0) -> Any:
    return rfgen.Actor.from_mesh(BALL, material="metal", position=(x, 0.3, 1), velocity=(1.0, 0.5, 0), name="ball")


def other(radar: Any, **changes: Any) -> Any:
    """A radar with another waveform, as of another preset."""
    return replace(radar, preset="other", waveform=replace(radar.waveform, **changes))


def quick(radar: Any) -> Any:
    """Preset of shorter frames of one Tx element with a narrower band, every second recorded frame, in other order."""
    single = replace(
        radar, tx_names=radar.tx_names[1:], tx_positions=radar.tx_positions[1:], name="tiny",
        waveform=replace(radar.waveform, tx_order=(0,)),
    )  # fmt: skip
    return other(single, num_loops=6, num_samples=40, adc_start_time=7e-6, frame_period=0.1)


@pytest.fixture(scope="module")
def free(radar: Any) -> Any:
    return rfgen.Simulator(None, radar, [ball()], rtol=RTOL)


@pytest.fixture(scope="module")
def run(free: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    with free.record(tmp_path_factory.mktemp("runs") / "run.h5", 0.2, keep=KEEP, seed=4) as recorded:
        yield recorded


def difference(found: Any, expected: Any) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def test_the_same_radar_and_seed_give_the_recorded_samples(run: Any, tmp_path: Path) -> None:
    with resynthesize(run, tmp_path / "again.h5") as again:
        np.testing.assert_array_equal(again.adc[:], run.adc[:])
        np.testing.assert_array_equal(again.frame_times, run.frame_times)
        assert (again.full_scale, again.clipped) == (run.full_scale, run.clipped)
        assert again.contents == tuple(sorted(set(KEEP) - {"paths"}))
        for name, label in run.labels.items():
            np.testing.assert_array_equal(again.labels[name].values, label.values)
        for frame in range(4):
            np.testing.assert_array_equal(again.actors["ball"].vertices(frame), run.actors["ball"].vertices(frame))
        assert (again.radar, again.receiver, again.seeds) == (run.radar, run.receiver, run.seeds)


def test_other_seeds_and_receivers_are_those_of_a_trace(run: Any, free: Any, tmp_path: Path) -> None:
    receiver = {"dc_offset": {"level_dbm": -80.0}, "mismatch": {"gain_spread_db": 1.0, "phase_spread_deg": 9.0}}
    with resynthesize(run, tmp_path / "seed.h5", seed=9, words=True) as other_noise:
        np.testing.assert_array_equal(other_noise.cube().data, free.adc(0.2, seed=9).data)
        assert other_noise.seeds["noise"] == 9
    with resynthesize(run, tmp_path / "receiver.h5", receiver=receiver, seed=2) as impaired:
        np.testing.assert_array_equal(impaired.adc[:], free.adc(0.2, seed=2, receiver=receiver).data)
        assert impaired.receiver["mismatch"]["gain_spread_db"] == 1.0


def test_more_power_is_more_signal(run: Any, radar: Any) -> None:
    ideal = Receiver.ideal()
    strong = replace(radar, tx_power_dbm=radar.tx_power_dbm + 6.0)
    for weak, loud in zip(
        Resynthesis(run, radar).samples(ideal, 0), Resynthesis(run, strong).samples(ideal, 0), strict=True
    ):
        assert difference(loud, 10**0.3 * weak) < RTOL


@pytest.mark.parametrize("walled", [False, True])
def test_another_preset_is_that_of_a_trace_of_its_own(radar: Any, tmp_path: Path, walled: bool) -> None:
    scene = scene_of(radar.center_frequency, wall=(wall(4.5, half=1.0), "concrete")) if walled else None
    preset, options = quick(radar), {"rtol": RTOL}
    with (
        rfgen.Simulator(scene, radar, [ball()], **options).record(
            tmp_path / "run.h5", 0.2, keep=("paths", "body", "labels"), noise=False
        ) as recorded,
        resynthesize(recorded, tmp_path / "new.h5", radar=preset, keep=("adc", "drai", "body")) as made,
    ):
        fresh = rfgen.Simulator(scene, preset, [ball()], **options).adc(0.2, noise=False)
        np.testing.assert_array_equal(made.frame_times, fresh.frame_times)
        assert made.radar == preset
        assert made.adc.shape == fresh.data.shape
        for ours, theirs in zip(made.adc, fresh.data, strict=True):
            assert difference(ours, theirs) < 2 * RTOL
            # What moves is as exact as what does not.
            assert difference(ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)) < 3 * RTOL
        np.testing.assert_allclose(
            made.actors["ball"].vertices(1), recorded.actors["ball"].vertices(2), atol=1e-6
        )  # its second frame is the third recorded one
        assert made.settings["traced"] == "tiny, tiny"


@pytest.mark.filterwarnings("ignore:actor 'far' stays beyond the range window")
def test_a_smaller_range_window_leaves_out_what_is_beyond(radar: Any, tmp_path: Path) -> None:
    near, far = ball(2.0), replace(ball(6.0), name="far", velocity=(0.0, 0.0, 0.0))
    preset = other(radar, range_limit=4.0)
    options: dict[str, Any] = {"rtol": RTOL, "outside": "ignore"}
    with (
        rfgen.Simulator(None, radar, [near, far], **options).record(
            tmp_path / "run.h5", 0.1, keep=KEEP, noise=False
        ) as recorded,
        resynthesize(recorded, tmp_path / "new.h5", radar=preset) as made,
    ):
        fresh = rfgen.Simulator(None, preset, [near, far], **options).adc(0.1, noise=False)
        assert difference(made.adc[:], fresh.data) < 2 * RTOL
        assert made.labels["in_range"].values.tolist() == [[1.0, 0.0]] * 2


def test_what_was_not_traced_is_refused_with_the_cure(run: Any, radar: Any, free: Any, tmp_path: Path) -> None:
    beyond = other(radar, start_frequency=78e9)
    moved = radar.placed(position=(0, 0, 1.5))
    elsewhere = replace(radar, tx_positions=radar.tx_positions + np.array([0, 0.01, 0]))
    refusals = {
        "take a preset within that band, or record with a wider one": beyond,
        r"position is \[0.0, 0.0, 1.5\], recorded is \[0.0, 0.0, 1.0\]: place it so": moved,
        "element TX3 is at .* where no recorded one is": elsewhere,
        "take a preset with frames of at most .* a whole number of 0.05 s apart": other(radar, num_loops=64),
        "a whole number of 0.05 s apart": other(radar, frame_period=0.03),
        "take a preset with a shorter period": other(radar, frame_period=0.5),
    }
    for text, asked in refusals.items():
        with pytest.raises(ValueError, match=text):
            resynthesize(run, tmp_path / "new.h5", radar=asked)
    with pytest.raises(TypeError, match="the name of a preset or None is needed"):
        resynthesize(run, tmp_path / "new.h5", radar=3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"keep has 'joints', which the run .* has not to copy"):
        resynthesize(run, tmp_path / "new.h5", keep=["adc", "joints"])
    with (
        free.record(tmp_path / "plain.h5", 0.05) as plain,
        pytest.raises(RunFormatError, match=r"holds no paths: record it with keep=\[…, 'paths'\]"),
    ):
        resynthesize(plain, tmp_path / "new.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["plain.h5"]


def test_a_larger_window_needs_all_in_the_recorded_one(run: Any, radar: Any, tmp_path: Path) -> None:
    wide = other(radar, slope=radar.waveform.slope / 2, start_frequency=77.2e9, adc_start_time=9e-6, num_samples=60)
    assert wide.max_range > radar.max_range
    assert Resynthesis(run, wide).frames[0] == (0.0, 0)
    scene = scene_of(radar.center_frequency, wall=(wall(4.5, half=1.0), "concrete"))
    with (
        rfgen.Simulator(scene, radar, [ball()], rtol=0.05).record(tmp_path / "run.h5", 0.05, keep=["paths"]) as walled,
        pytest.raises(ValueError, match="take a preset with a smaller window, or record with a larger one"),
    ):
        Resynthesis(walled, wide)


def test_a_moving_radar(radar: Any, tmp_path: Path) -> None:
    way = Trajectory((0.0, 1.0), ((0.0, 0.0, 1.0), (0.5, 0.2, 1.0)))
    moving = replace(radar, trajectory=way)
    sim = rfgen.Simulator(None, moving, [ball()], rtol=RTOL)
    with sim.record(tmp_path / "run.h5", 0.1, keep=("adc", "paths")) as run:
        with resynthesize(run, tmp_path / "same.h5") as same:
            np.testing.assert_array_equal(same.adc[:], run.adc[:])
        with pytest.raises(ValueError, match=r"trajectory is None, recorded is .*give it the same trajectory"):
            Resynthesis(run, replace(moving, trajectory=None))


def test_imagined_surroundings(radar: Any, tmp_path: Path) -> None:
    pixels = (6, 8)
    levels = np.random.default_rng(0).uniform(1e-10, 1e-9, pixels)
    place = Pir(levels, np.full(pixels, 3e-8), np.zeros(pixels), (60.0, 46.0), radar.position, radar.orientation)
    sim = rfgen.Simulator(None, radar, [ball()], rtol=RTOL, environment=place)
    with sim.record(tmp_path / "run.h5", 0.1, keep=("adc", "paths")) as run:
        assert len(read_frame_paths(run.stored("paths"), 0)) > 1
        with resynthesize(run, tmp_path / "same.h5") as same:
            np.testing.assert_array_equal(same.adc[:], run.adc[:])


def test_several_radars_of_one_file(radar: Any, free: Any, tmp_path: Path) -> None:
    side = radar.placed(position=(3, -2, 1), orientation=(np.pi / 2, 0, 0))
    sims = {"front": free, "side": rfgen.Simulator(None, side, free.actors, rtol=RTOL)}
    with rfgen.record(tmp_path / "run.h5", sims, 0.1, keep=KEEP) as run:
        with resynthesize(run, tmp_path / "new.h5", seed=6) as again:
            assert list(again.radars) == ["front", "side"]
            for index, (name, sim) in enumerate(sims.items()):
                np.testing.assert_array_equal(again[name].adc[:], sim.adc(0.1, seed=noise_seed(6, index)).data)
        quicker = {"side": other(side, num_samples=32)}
        with resynthesize(run, tmp_path / "part.h5", radar=quicker) as part:
            assert (part["front"].adc.shape[-1], part["side"].adc.shape[-1]) == (64, 32)
        with pytest.raises(ValueError, match="radar names 'back'; the run has 'front', 'side'"):
            resynthesize(run, tmp_path / "no.h5", radar={"back": "tiny"})


def test_radars_of_one_name_at_one_place_have_noise_of_their_own(free: Any, tmp_path: Path) -> None:
    with rfgen.record(tmp_path / "run.h5", {"one": free, "other": free}, 0.1, keep=KEEP) as run:
        quiet = {"adc": "none", "thermal_noise": False}
        with (
            resynthesize(run, tmp_path / "new.h5", seed=6) as again,
            resynthesize(run, tmp_path / "quiet.h5", receiver=quiet) as echoes,
        ):
            assert again["one"].seeds["noise"] == 6 != again["other"].seeds["noise"]
            one, other = (again[name].cube().data - echoes[name].cube().data for name in ("one", "other"))
            coherence = abs(np.vdot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other)
            assert coherence < 0.1


@pytest.mark.slow
def test_a_walking_figure_before_a_wall(radar: Any, tmp_path: Path) -> None:
    person = rfgen.Actor.from_prompt("a man walks on the spot at 3 m", seed=0, duration=1.0, radar=radar)
    scene, preset = scene_of(radar.center_frequency, wall=(wall(4.5, half=1.0), "concrete")), quick(radar)
    with rfgen.Simulator(scene, radar, [person], rtol=RTOL).record(
        tmp_path / "run.h5", 0.2, keep=("adc", "paths", "body")
    ) as recorded:
        with resynthesize(recorded, tmp_path / "same.h5") as same:
            np.testing.assert_array_equal(same.adc[:], recorded.adc[:])
        fresh = rfgen.Simulator(scene, preset, [person], rtol=RTOL).adc(0.2, noise=False).data
        for ours, theirs in zip(Resynthesis(recorded, preset).samples(Receiver.ideal(), 0), fresh, strict=True):
            assert difference(ours, theirs) < 2 * RTOL
            # Over six chirps the figure hardly moves: what changes is compared with the whole return.
            change = (ours - ours.mean(axis=0)) - (theirs - theirs.mean(axis=0))
            assert np.linalg.norm(change) < 0.5 * RTOL * np.linalg.norm(theirs)
