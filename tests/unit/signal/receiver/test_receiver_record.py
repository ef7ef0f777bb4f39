"""Receivers as records and files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal import (
    Chassis,
    Coupling,
    DcOffset,
    Interferer,
    IqImbalance,
    Leakage,
    Mismatch,
    PhaseNoise,
    RampError,
    RangeBias,
    Receiver,
    read_receiver,
    receive,
    receiver_from_record,
    receiver_record,
)

RADAR = Radar.load("awr1843")
FULL = Receiver(
    leakage=Leakage(-30.0, 0.1),
    chassis=Chassis(-40.0, 0.05),
    range_bias=RangeBias(0.065),
    ramp_error=RampError((0.0, 1e5), 1e4, 2e5, 30.0),
    phase_noise=PhaseNoise(((1e5, -85.0), (1e6, -95.0))),
    interferers=(Interferer(Radar.load("awr1843", "bpm", position=(5, 1, 1)), if_band_hz=(0.0, 3e6)),),
    coupling=Coupling.of_neighbours(RADAR, -25.0, 40.0),
    thermal_noise=False,
    mismatch=Mismatch(tx_gain_db=(0.1, 0.2, 0.3), phase_spread_deg=5.0),
    iq_imbalance=IqImbalance(0.5, 2.0),
    dc_offset=DcOffset(-60.0),
    adc=Adc(12, -10.0),
)


@pytest.mark.parametrize("receiver", [Receiver(), Receiver.ideal(), FULL], ids=["default", "ideal", "full"])
def test_records_bring_receivers_back(receiver: Receiver) -> None:
    record = json.loads(json.dumps(receiver_record(receiver)))
    assert receiver_from_record(record, RADAR) == receiver
    assert read_receiver(receiver, RADAR) is receiver


TOML = """
thermal_noise = true
adc = {bits = 14, full_scale_dbm = "auto"}
leakage = {level_db = -30.0}
range_bias = {distance = 0.065}
coupling = {level_db = -25.0, phase_deg = 40.0}

[phase_noise]
points = [[1e5, -85.0], [1e6, -95.0]]

[mismatch]
gain_spread_db = 0.5

[[interferers]]
radar = "awr1843"
preset = "di_gesture"
position = [4.0, 1.0, 1.0]
look_at = [0.0, 0.0, 1.0]
"""


def test_a_file_is_written_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "board.toml"
    path.write_text(TOML)
    found = read_receiver(path, RADAR)
    other = Radar.load("awr1843", "di_gesture", position=(4, 1, 1), look_at=(0, 0, 1))
    assert found == Receiver(
        leakage=Leakage(-30.0),
        range_bias=RangeBias(0.065),
        phase_noise=PhaseNoise(((1e5, -85.0), (1e6, -95.0))),
        mismatch=Mismatch(gain_spread_db=0.5),
        coupling=Coupling.of_neighbours(RADAR, -25.0, 40.0),
        interferers=(Interferer(other),),
        adc=Adc(14, None),
    )
    short = replace(RADAR, waveform=replace(RADAR.waveform, num_loops=2))
    zero = np.zeros(short.frame_shape, complex)
    np.testing.assert_array_equal(receive(zero, short, found).samples, receive(zero, short, found).samples)


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"leakge": {}}, "receiver has the unknown key 'leakge'; known: leakage"),
        ({"leakage": -30.0}, "receiver.leakage is -30.0: a table with keys of level_db, extra_length"),
        ({"leakage": {"level": -30.0}}, "receiver.leakage has the unknown key 'level'"),
        ({"leakage": {}}, "receiver.leakage lacks a key"),
        ({"leakage": {"level_db": 30.0}}, "leakage.level_db is 30.0"),
        ({"phase_noise": {"points": [1.0]}}, "phase_noise.points"),
        ({"thermal_noise": "yes"}, "receiver.thermal_noise is 'yes'"),
        ({"adc": "12 bit"}, "receiver.adc is '12 bit'"),
        ({"adc": {"bits": 1}}, "adc.bits is 1"),
        ({"coupling": {"phase_deg": 3.0}}, "receiver.coupling lacks 'level_db'"),
        ({"coupling": {"real": [["a"]]}}, "two square matrices"),
        ({"coupling": {"real": [[1.0, 0.0], [0.0, 1.0]]}}, "has 4 Rx elements"),
        ({"interferers": {"radar": "awr1843"}}, "a list of tables"),
        ({"interferers": [{"preset": "mmmesh"}]}, "a table with a 'radar'"),
        ({"interferers": [{"radar": "awr1843", "distance": 3}]}, "unknown key 'distance'"),
        ({"interferers": [{"radar": "awr1483"}]}, "awr1843"),
        ({"interferers": [{"radar": "awr1843"}]}, "the position of the radar"),
        ({"mismatch": {"tx_gain_db": [1.0, 2.0]}}, "mismatch.tx_gain_db has 2 values"),
        (3, "receiver is 3"),
    ],
)
def test_what_no_receiver_has_is_named(tmp_path: Path, record: Any, said: str) -> None:
    with pytest.raises((ValueError, TypeError)) as caught:
        read_receiver(record, RADAR)
    assert said in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"receiver file '.*none\.toml' does not exist"):
        read_receiver(tmp_path / "none.toml", RADAR)
    path = tmp_path / "odd.toml"
    path.write_text("leakage = ")
    with pytest.raises(ValueError, match=r"odd\.toml' is not a TOML file"):
        read_receiver(path, RADAR)
    path.write_text("leakage = {level_db = 3}")
    with pytest.raises(ValueError, match=r"odd\.toml': leakage\.level_db is 3"):
        read_receiver(path, RADAR)


def test_a_table_of_the_adc_is_real_where_the_radars_is() -> None:
    radar = Radar.load("awr1843", overrides={"adc.real": True})
    receiver = receiver_from_record({"adc": {"bits": 10}}, radar)
    assert receiver.adc == Adc(10, real=True)
    assert receiver_from_record(json.loads(json.dumps(receiver_record(receiver))), radar) == receiver
    with pytest.raises(ValueError, match=r"receiver.adc.real is False and that of radar 'awr1843' is True"):
        read_receiver({"adc": {"bits": 10, "real": False}}, radar)
