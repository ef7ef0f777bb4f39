"""The radar as a whole: array, pose in Sionna's convention, checks and storage."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.radar import rotation_matrix


@pytest.fixture(scope="module")
def radar() -> Radar:
    return Radar.load("awr1843", "mmmesh")


HALF = 299_792_458.0 / 77e9 / 2


def test_the_virtual_array_is_the_published_one(radar: Radar) -> None:
    """TX1 gives columns 0..3, TX3 4..7, TX2 2..5 one row up; the index grows to the left, which is +y."""
    virtual = radar.virtual_positions / HALF
    assert virtual.shape == (3, 4, 3)
    tx1, tx2, tx3 = (radar.tx_names.index(name) for name in ("TX1", "TX2", "TX3"))
    columns = virtual[..., 1] - virtual[tx1, 0, 1]
    np.testing.assert_allclose(columns[tx1], [0, 1, 2, 3], atol=1e-9)
    np.testing.assert_allclose(columns[tx3], [4, 5, 6, 7], atol=1e-9)
    np.testing.assert_allclose(columns[tx2], [2, 3, 4, 5], atol=1e-9)
    np.testing.assert_allclose(virtual[[tx1, tx3], :, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(virtual[tx2, :, 2], 1.0, atol=1e-9)
    np.testing.assert_array_equal(virtual[..., 0], 0.0)
    # 1.4 … 1.5 wavelengths between RX4 and TX1, from TI's photograph.
    gap = (radar.tx_positions[tx1] - radar.rx_positions[-1])[1] / (2 * HALF)
    assert 1.4 <= gap <= 1.5
    # The array is centred on the device's origin, so that the phase centre is the radar's position.
    np.testing.assert_allclose(virtual[[tx1, tx3], :, 1].mean(), 0.0, atol=1e-9)


def test_only_elements_that_fire_are_listed() -> None:
    radar = Radar.load("awr1843", "di_gesture")
    assert radar.tx_names == ("TX1", "TX3")
    assert len(radar.tx_positions) == 2
    np.testing.assert_allclose(np.diff(radar.tx_positions, axis=0), [[0, 4 * HALF, 0]], atol=1e-12)


def test_element_positions_turn_and_move_with_the_radar(radar: Radar) -> None:
    placed = radar.placed(position=(1.0, 2.0, 3.0), look_at=(1.0, 5.0, 3.0))  # looks along +y: its left is -x
    np.testing.assert_allclose(placed.tx_world[0], [1.0 - radar.tx_positions[0, 1], 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(placed.rx_world[0], [1.0 - radar.rx_positions[0, 1], 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(placed.tx_field, [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -2, 0), (1, 1, 1), (0, 0, 1), (0, 0, -3)])
def test_look_at_turns_the_boresight_there_and_keeps_the_array_level(radar: Radar, axis: tuple[float, ...]) -> None:
    place = np.array([10.0, -3.0, 1.0])
    placed = radar.placed(position=tuple(place), look_at=tuple(place + axis))
    np.testing.assert_allclose(placed.rotation[:, 0], np.array(axis) / np.linalg.norm(axis), atol=1e-12)
    assert placed.rotation[2, 1] == pytest.approx(0.0, abs=1e-12)  # left is level
    assert placed.rotation[2, 2] >= -1e-12  # up is not down
    np.testing.assert_allclose(np.linalg.det(placed.rotation), 1.0)


def test_orientation_is_sionnas() -> None:
    """Same matrix, and the same angles for the same point to look at, as a Sionna radio device."""
    from rfgen_sionna.scene.mitsuba_backend import ensure_backend

    ensure_backend()
    import mitsuba as mi
    import sionna.rt
    from sionna.rt.utils import rotation_matrix as sionna_rotation

    for angles in ((0.3, -0.2, 0.5), (2.9, 1.1, -0.7), (-1.0, 0.0, 3.0)):
        theirs = np.array(sionna_rotation(mi.Point3f(*angles)), np.float64).reshape(3, 3)
        np.testing.assert_allclose(rotation_matrix(angles), theirs, atol=1e-6)
    for target in ((3.0, -1.0, 0.5), (-3.0, 4.0, 6.0)):
        device = sionna.rt.Receiver("radar", position=(0.0, 1.0, 2.0))
        device.look_at(mi.Point3f(*target))
        ours = Radar.load("awr1843", position=(0, 1, 2), look_at=target)
        np.testing.assert_allclose(ours.orientation, np.array(device.orientation).ravel(), atol=1e-6)


def test_orientation_by_hand(radar: Radar) -> None:
    yaw = radar.placed(orientation=(np.pi / 2, 0, 0)).rotation
    np.testing.assert_allclose(yaw[:, 0], [0, 1, 0], atol=1e-12)  # turned to the left
    pitch = radar.placed(orientation=(0, np.pi / 2, 0)).rotation
    np.testing.assert_allclose(pitch[:, 0], [0, 0, -1], atol=1e-12)  # positive pitch looks down
    roll = radar.placed(orientation=(0, 0, np.pi / 2)).rotation
    np.testing.assert_allclose(roll[:, 1], [0, 0, 1], atol=1e-12)  # its left rises


@pytest.mark.parametrize("field", ["position", "orientation", "look_at"])
@pytest.mark.parametrize("value", [(0, 0), (0, 0, float("nan")), "here", (1, 2, "up"), 3.0, (None, 0, 0)])
def test_poses_that_are_none_are_named(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^radar\.{field} is .*three finite numbers"):
        Radar.load("awr1843", **{field: value})


def test_a_radar_cannot_look_at_itself() -> None:
    with pytest.raises(ValueError, match=r"look_at .* own position"):
        Radar.load("awr1843", position=(1, 2, 3), look_at=(1, 2, 3))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tx_positions": np.zeros((3, 2))}, r"tx_positions has shape \(3, 2\)"),
        ({"rx_positions": np.full((4, 3), np.nan)}, "rx_positions .* finite"),
        ({"rx_positions": np.zeros((0, 3))}, "rx_positions"),
        ({"tx_positions": np.array([[0, 0, 0], [0, 1e-3, 0], [0, 0, 0.0]])}, "elements 0 and 2 .* same place"),
        ({"tx_positions": 3e3 * np.eye(3)}, "3000 m: elements lie within 10 m"),
        ({"tx_positions": np.eye(2, 3), "tx_names": ("a", "b")}, "2 Tx elements; waveform.tx_order fires 3"),
        ({"rx_names": ("a", "b")}, "rx_names"),
        ({"rx_names": ("a", "b", "c", "a")}, "rx_names"),
        ({"rx_polarization": "RHCP"}, r"'RHCP'; allowed: V, H"),
        ({"tx_power_dbm": 1e3}, "tx_power_dbm is 1000.0"),
        ({"noise_figure_db": -1.0}, "noise_figure_db is -1.0"),
        ({"temperature": float("nan")}, "temperature is nan"),
    ],
)
def test_impossible_radars_are_named(radar: Radar, change: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(radar, **change)


def test_positions_cannot_be_changed_behind_its_back(radar: Radar) -> None:
    mine = np.array(radar.tx_positions)
    again = replace(radar, tx_positions=mine)
    mine[0] += 1.0
    assert again == radar
    with pytest.raises(ValueError, match="read-only"):
        radar.rx_positions[0] = 0.0


@pytest.mark.parametrize("preset", ["mmmesh", "di_gesture"])
def test_a_radar_survives_json(preset: str) -> None:
    radar = Radar.load("awr1843", preset, position=(0.1, 0.2, 1 / 3), orientation=(0.1, 0.2, 0.3))
    record = json.loads(json.dumps(radar.to_dict()))
    again = Radar.from_dict(record)
    assert again == radar
    assert hash(again) == hash(radar)
    np.testing.assert_array_equal(again.tx_world, radar.tx_world)
    assert again.waveform == radar.waveform
    assert again.pattern == radar.pattern
    assert again != radar.placed(position=(0, 0, 0))
    assert again != "radar"


def test_records_are_read_strictly(radar: Radar) -> None:
    def changed(section: str | None, **changes: Any) -> dict[str, Any]:
        record = radar.to_dict()
        (record if section is None else record[section]).update(changes)
        return record

    for section in (None, "waveform", "pattern"):
        with pytest.raises(ValueError, match="unknown key 'loudness'; known: "):
            Radar.from_dict(changed(section, loudness=3))
    for section, key in ((None, "tx_power_dbm"), ("waveform", "slope"), ("pattern", "azimuth_db")):
        record = radar.to_dict()
        del (record if section is None else record[section])[key]
        with pytest.raises(ValueError, match=f"lacks the key '{key}'"):
            Radar.from_dict(record)
    with pytest.raises(ValueError, match=r"waveform is \[\]"):
        Radar.from_dict(changed(None, waveform=[]))
    with pytest.raises(ValueError, match=r"waveform\.num_loops is 0"):
        Radar.from_dict(changed("waveform", num_loops=0))


def test_a_real_adc_reaches_half_as_far() -> None:
    plain, real = (Radar.load("awr1843", "mmmesh", overrides={"adc.real": flag}) for flag in (False, True))
    assert real.range_window == pytest.approx(0.5 * plain.range_window)
    assert real.max_range == real.range_window
    assert plain.max_range == plain.waveform.range_window
    assert (real.sample_type, plain.sample_type) == (np.float32, np.complex64)
    assert Radar.from_dict(json.loads(json.dumps(real.to_dict()))) == real != plain
    near = replace(real, waveform=replace(real.waveform, range_limit=2.0))
    assert near.max_range == 2.0
    with pytest.raises(ValueError, match=r"'adc.real' is 1; bool is needed"):
        Radar.load("awr1843", overrides={"adc.real": 1})
    with pytest.raises(ValueError, match=r"adc.real is 'yes': True"):
        replace(real, adc=replace(real.adc, real="yes"))


def test_phases_of_feeds_go_with_their_elements() -> None:
    """The file has a phase for each element of the board, the radar those of the elements that fire."""
    phases = {"array.tx_phases_deg": [0, 180, 90], "array.rx_phases_deg": [0, 180, 0, -180]}
    radar = Radar.load("awr1843", "di_gesture", overrides=phases)
    assert radar.tx_names == ("TX1", "TX3")
    assert radar.tx_phases_deg == (0.0, 90.0)
    tx, rx = radar.feed_factors
    np.testing.assert_array_equal(tx, [1, 1j])
    np.testing.assert_array_equal(rx, [1, -1, 1, -1])
    assert Radar.from_dict(json.loads(json.dumps(radar.to_dict()))) == radar
    plain = Radar.load("awr1843", "di_gesture")
    assert plain != radar
    assert "tx_phases_deg" not in plain.to_dict(), "records of boards without such feeds stay as they were"
    assert replace(radar, tx_phases_deg=(0, 0), rx_phases_deg=()) == plain


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("array.rx_phases_deg", [0, 180], r"array.rx_phases_deg is \[0, 180\]: an angle for each of RX1"),
        ("array.tx_phases_deg", [0, 0, 720], r"array.tx_phases_deg is 720; 0 or, in magnitude, 0.4 … 360"),
        ("array.tx_phases_deg", [0, 0, "turned"], "'array.tx_phases_deg' is 'turned'"),
    ],
)
def test_phases_that_do_not_fit_are_refused(key: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Radar.load("awr1843", "mmmesh", overrides={key: value})


def test_phases_in_code_are_checked(radar: Radar) -> None:
    with pytest.raises(ValueError, match=r"radar.tx_phases_deg is \(180.0,\): one angle .* for each of TX1, TX2, TX3"):
        replace(radar, tx_phases_deg=(180.0,))
    with pytest.raises(ValueError, match="angles in -360 … 360 degrees"):
        replace(radar, rx_phases_deg=(0, 0, 0, float("nan")))
