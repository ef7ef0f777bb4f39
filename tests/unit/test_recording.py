"""What a simulator makes is in a file, whole and true, whoever moves and however many radars look."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.radar import Trajectory

BALL = trimesh.creation.icosphere(subdivisions=1, radius=0.1)


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Any:
    return rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


def ball(name: str = "ball", **changes: Any) -> Any:
    return rfgen.Actor.from_mesh(BALL, **{"material": "metal", "position": (3, 0, 1), "name": name} | changes)


def simulator(radar: Any, *actors: Any) -> Any:
    return rfgen.Simulator(
        None, radar, actors or (ball(velocity=(0.5, 0, 0)), ball("other", position=(2, 1, 1))), rtol=0.03
    )


def interrupt_after(frames: int) -> Any:
    def step(done: int, total: int) -> None:
        if done == frames:
            raise KeyboardInterrupt

    return step


def test_a_recorded_run_has_the_samples_of_adc_and_the_truth_about_each_actor(radar: Any, tmp_path: Path) -> None:
    sim, steps = simulator(radar), []
    options: dict[str, Any] = {"seed": 4, "receiver": {"dc_offset": {"level_dbm": -95.0}}}
    with sim.record(tmp_path / "run.h5", 0.2, progress=lambda *step: steps.append(step), **options) as run:
        np.testing.assert_array_equal(run.adc[:], sim.adc(0.2, **options).data)
        assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]
        assert list(run.actors) == ["ball", "other"]
        t, labels = run.mesh_times, {name: label.values for name, label in run.labels.items()}
        np.testing.assert_allclose(t, run.frame_times + radar.waveform.frame_length / 2)
        np.testing.assert_allclose(
            labels["position"][:, 0], np.stack([3 + 0.5 * t, 0 * t, 1 + 0 * t], axis=1), atol=1e-9
        )
        np.testing.assert_allclose(labels["velocity"], [[[0.5, 0, 0], [0, 0, 0]]] * 4, atol=1e-9)
        low, high = labels["bounding_box"][2, 1]
        np.testing.assert_allclose([low, high], [[1.9, 0.9, 0.9], [2.1, 1.1, 1.1]], atol=1e-9)
        np.testing.assert_allclose(labels["distance"][:, 1], np.sqrt(5))
        np.testing.assert_allclose(labels["radial_velocity"], [[0.5, 0]] * 4, atol=1e-9)
        np.testing.assert_allclose(labels["azimuth"][:, 1], np.arctan2(1, 2))
        assert set(labels["action"].ravel()) == {""}
        np.testing.assert_allclose(run.actors["ball"].vertices(3), sim.actors[0].vertices(t[3]), atol=1e-6)
        assert run.receiver["dc_offset"] == {"level_dbm": -95.0, "phase_deg": None}
        assert (run.seeds, run.environment, run.has_pir) == ({"speckle": 0, "noise": 4}, "", False)
        assert run.settings["rtol"] == 0.03
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_a_run_without_noise_or_actors(radar: Any, tmp_path: Path) -> None:
    empty = rfgen.Simulator(None, radar, (), rtol=0.03)
    with empty.record(tmp_path / "run.h5", 0.1, noise=False, pir_resolution=(6, 8), fov_deg=50.0) as run:
        assert run.seeds["noise"] is None
        assert not run.adc[:].any()
        assert not run.labels
        assert run.pir(1).energy.shape == (6, 8)
        assert run.pir(1).fov_deg[0] == 50.0


def test_several_radars_of_one_scene_are_in_one_file(radar: Any, tmp_path: Path) -> None:
    side = radar.placed(position=(3, -2, 1), orientation=(np.pi / 2, 0, 0))
    slow = replace(side, waveform=replace(side.waveform, frame_period=0.1))
    one = ball(velocity=(0.5, 0, 0))
    sims = {"front": simulator(radar, one), "side": simulator(slow, one)}
    with rfgen.record(tmp_path / "run.h5", sims, 0.2) as run:
        assert list(run.radars) == ["front", "side"]
        assert (len(run["front"]), len(run["side"])) == (4, 2)
        for name, sim in sims.items():
            np.testing.assert_array_equal(run[name].cube().data, sim.adc(0.2).data)
            assert run[name].radar == sim.radar
        # Distances and directions are each radar's own: the ball passes the side radar at its boresight.
        np.testing.assert_allclose(run["side"].labels["distance"].values[0, 0], 2.0, atol=1e-3)
        assert abs(run["side"].labels["azimuth"].values[0, 0]) < 1e-3
        with pytest.raises(
            ValueError, match=r"has several radars, 'front', 'side': take the run of one, run\['front'\]"
        ):
            run.cube()
        with pytest.raises(KeyError, match="no radar 'back'; it has 'front', 'side'"):
            run["back"]
    with rfgen.record(tmp_path / "list.h5", list(sims.values()), 0.05 + 0.05) as run:
        assert list(run.radars) == ["tiny 1", "tiny 2"]
    with rfgen.record(tmp_path / "one.h5", [sims["front"]], 0.05) as run:
        assert run["tiny"] is run
        assert len(run) == 1


def test_an_interrupted_record_goes_on_where_it_was(radar: Any, tmp_path: Path) -> None:
    target, steps = tmp_path / "run.h5", []
    one = ball()
    sims = {"a": simulator(radar, one), "b": simulator(radar.placed(position=(0, 1, 1)), one)}
    options: dict[str, Any] = {"resume": True}
    with pytest.raises(KeyboardInterrupt):
        rfgen.record(target, sims, 0.3, progress=interrupt_after(8), **options)
    assert [path.name for path in tmp_path.iterdir()] == [".run.h5.partial"]
    with rfgen.record(target, sims, 0.3, progress=lambda *step: steps.append(step), **options) as run:
        assert steps == [(9, 12), (10, 12), (11, 12), (12, 12)]
        for name, sim in sims.items():
            whole = sim.adc(0.3).data
            assert len(run[name].adc) == 6
            error = np.linalg.norm(run[name].adc[:] - whole) / np.linalg.norm(whole)
            assert error < sim.rtol
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_the_same_call_returns_a_finished_run(radar: Any, tmp_path: Path) -> None:
    sim, target, steps = simulator(radar), tmp_path / "run.h5", []
    sim.record(target, 0.1, resume=True).close()
    with sim.record(target, 0.1, resume=True, progress=lambda *step: steps.append(step)) as run:
        assert len(run) == 2
    assert not steps
    with pytest.raises(ValueError, match=r"run\.h5' exists"):
        sim.record(target, 0.2, resume=True)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seed": 1}, r"seeds\.noise is 0 instead of 1"),
        ({"receiver": {"thermal_noise": False}}, r"receiver\.thermal_noise is True instead of False"),
        ({"duration": 0.2}, r"settings\.frames is 3 instead of 4"),
    ],
)
def test_frames_of_another_run_are_not_continued(radar: Any, tmp_path: Path, changes: Any, said: str) -> None:
    sim, options = simulator(radar), {"duration": 0.15, "resume": True}
    with pytest.raises(KeyboardInterrupt):
        sim.record(tmp_path / "run.h5", progress=interrupt_after(1), **options)
    with pytest.raises(ValueError, match=rf"frames in '.*\.run\.h5\.partial' are those of another run, whose {said}"):
        sim.record(tmp_path / "run.h5", **options | changes)
    other = simulator(radar, ball(velocity=(0.6, 0, 0)), ball("other", position=(2, 1, 1)))
    with pytest.raises(ValueError, match=r"whose settings\.actors is"):
        other.record(tmp_path / "run.h5", **options)


def test_an_interrupted_record_leaves_nothing_unasked(radar: Any, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        simulator(radar).record(tmp_path / "run.h5", 0.1, progress=interrupt_after(1))
    assert not list(tmp_path.iterdir())


def test_labels_are_seen_from_a_radar_on_its_way(radar: Any, tmp_path: Path) -> None:
    """A radar that drives at 2 m/s towards a ball at rest: the ball approaches at 2 m/s."""
    path = Trajectory((0.0, 1.0), ((0.0, 0.0, 1.0), (2.0, 0.0, 1.0)))
    moving = replace(radar, trajectory=path)
    with simulator(moving, ball()).record(tmp_path / "run.h5", 0.1) as run:
        t = run.mesh_times
        np.testing.assert_allclose(run.labels["distance"].values[:, 0], 3 - 2 * t, atol=1e-9)
        np.testing.assert_allclose(run.labels["radial_velocity"].values[:, 0], -2.0, atol=1e-6)
        np.testing.assert_allclose(run.labels["velocity"].values, 0.0, atol=1e-9)


def test_samples_of_a_real_adc_stay_real(tmp_path: Path) -> None:
    radar = rfgen.Radar.load("bgt60tr13c", position=(0, 0, 1), look_at=(1, 0, 1))
    sim = rfgen.Simulator(None, radar, [ball(position=(1, 0, 1))], rtol=0.03)
    frame = 1.01 * radar.waveform.frame_length
    with sim.record(tmp_path / "run.h5", frame) as run:
        assert run.adc.dtype == run.cube().data.dtype == np.float32
        np.testing.assert_array_equal(run.cube().data, sim.adc(frame).data)


def test_mistakes_are_told_before_the_work(radar: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sim = simulator(radar)
    monkeypatch.setattr("rfgen_sionna.simulation.frame_tracer", lambda *_: pytest.fail("work had begun"))
    target = tmp_path / "run.h5"
    for arguments, error, said in (
        ({"simulators": []}, ValueError, "simulators is empty"),
        ({"simulators": [sim, "radar"]}, TypeError, "simulators holds a str: a Simulator is needed"),
        ({"simulators": {"a/b": sim}}, ValueError, r"simulators has the name 'a/b'"),
        ({"duration": -1.0}, ValueError, r"duration is -1\.0"),
        ({"receiver": {"leakage": {"level_db": 3.0}}}, ValueError, r"leakage\.level_db is 3\.0"),
        ({"receiver": {"leekage": {}}}, ValueError, "receiver has the unknown key 'leekage'; known: leakage"),
        ({"receiver": 3}, TypeError, "receiver is 3: a Receiver, a table, the path of a TOML file or None"),
        ({"overwrite": 1}, TypeError, "overwrite is 1: True or False"),
        ({"progress": 1}, TypeError, "progress is 1: True, False or a function"),
        ({"pir_resolution": (0, 4)}, ValueError, r"resolution is \(0, 4\)"),
        ({"output": tmp_path / "none" / "run.h5"}, ValueError, "does not exist"),
    ):
        call = {"output": target, "simulators": sim, "duration": 0.1} | arguments
        with pytest.raises(error, match=said):
            rfgen.record(**call)
    with pytest.raises(ValueError, match=r"radar\.trajectory is a function, which no file can hold: Trajectory"):
        simulator(replace(radar, trajectory=lambda t: (0.1 * t, 0, 1))).record(target, 0.1)
    assert not list(tmp_path.iterdir())


def test_a_bar_shows_the_progress(radar: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulator(radar).record(tmp_path / "run.h5", 0.1, progress=True).close()
    assert "2/2" in capsys.readouterr().out


def test_a_receiver_is_a_table_a_file_or_a_record_everywhere(radar: Any, tmp_path: Path) -> None:
    from rfgen_sionna.signal import DcOffset, Receiver, read_receiver, receive

    table = {"dc_offset": {"level_dbm": -95.0}}
    file = tmp_path / "board.toml"
    file.write_text("[dc_offset]\nlevel_dbm = -95.0\n")
    sim = simulator(radar, ball())
    wanted = sim.adc(0.05, receiver=Receiver(dc_offset=DcOffset(-95.0))).data
    for source in (table, file, str(file), read_receiver(table, radar)):
        np.testing.assert_array_equal(sim.adc(0.05, receiver=source).data, wanted)
        np.testing.assert_array_equal(next(sim.frames(0.05, receiver=source)).samples, wanted[0])
        silent = receive(np.zeros(radar.frame_shape, np.complex128), radar, source, seed=0)
        assert silent.full_scale is not None
        assert np.abs(silent.samples.mean(axis=(0, 1, 3))).min() > 0  # the offset
