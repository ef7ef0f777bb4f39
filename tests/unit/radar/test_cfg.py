"""TI's `.cfg` files as people have them: each line counts for what its user guide says, or is refused by its name."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.board_frames import RadarConfigWarning
from rfgen_sionna.radar.config import RadarConfigError

Load = Callable[..., Radar]

SDK1_1443 = """\
% ***************************************************************
% Created for SDK ver:01.01
% Frequency:77
% ***************************************************************
sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg 0 1 0 1
profileCfg 0 77 7 7 57.14 0 0 70 1 240 4884 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 4
chirpCfg 2 2 0 0 0 0 0 2
frameCfg 0 2 16 0 33.333 1 0
guiMonitor 1 1 0 0 0 1
cfarCfg 0 2 8 4 3 0 1280
peakGrouping 1 0 0 1 229
multiObjBeamForming 1 0.5
calibDcRangeSig 0 -5 8 256
sensorStart
"""

PEOPLE_6843 = """\
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg -1 0 1 1 1
lowPower 0 0
bpmCfg -1 1 0 2
profileCfg 0 60.75 30.00 25.00 59.10 0 0 54.71 1 96 2950.00 2 1 36
chirpCfg 0 0 0 0 0 0 0 5
chirpCfg 1 1 0 0 0 0 0 2
chirpCfg 2 2 0 0 0 0 0 5
frameCfg 0 2 48 0 55.00 1 0
dynamicRACfarCfg -1 4 4 2 2 8 12 4 8 4.00 8.00 0.40 1 1
staticRACfarCfg -1 6 2 2 2 8 8 6 4 5.00 15.00 0.30 0 0
dynamicRangeAngleCfg -1 0.75 0.0010 1 0
fineMotionCfg -1 1
antGeometry0 0 -1 -2 -3 -2 -3 -4 -5 -4 -5 -6 -7
antPhaseRot 1 1 1 1 1 1 1 1 1 1 1 1
fovCfg -1 70.0 20.0
staticBoundaryBox -3 3 0.5 7.5 0 3
trackingCfg 1 2 800 30 46 96 55
presenceBoundaryBox -3 3 0.5 7.5 0 3
sensorStart
"""

PLAIN = """\
channelCfg 15 7 0
adcCfg 2 1
profileCfg 0 77 7 6 65 0 0 60.012 1 256 4400 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 4
chirpCfg 2 2 0 0 0 0 0 2
frameCfg 0 2 128 0 100 1 0
"""

SUBFRAMES = """\
dfeDataOutputMode 3
channelCfg 15 5 0
adcCfg 2 1
adcbufCfg -1 0 1 1 1
profileCfg 0 60 7 2 16 0 0 250 1 128 9200 0 0 30
profileCfg 1 60 7 3 25 0 0 150 1 256 12000 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 4
chirpCfg 2 2 1 0 0 0 0 1
chirpCfg 3 3 1 0 0 0 0 4
advFrameCfg 2 0 0 1 0
subFrameCfg 0 0 0 2 32 60 0 1 1 60
subFrameCfg 1 0 2 2 16 40 0 1 1 40
guiMonitor 0 1 1 1 0 0 1
cfarCfg 0 0 2 8 4 3 0 15.0 0
"""

DDM_2944 = """\
sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 15 0
adcCfg 2 0
adcbufCfg -1 1 0 1 1
lowPower 0 0
profileCfg 0 77 12 7 20.81 0 0 8.883 0 384 30000 0 0 164
chirpCfg 0 5 0 0 0 0 0 15
frameCfg 0 5 128 0 384 50 1 0
ddmPhaseShiftAntOrder 0 2 3 1
antGeometryCfg 0 6 1 8 1 9 1 10 0.5 0.8
antennaCalibParams 1 0 1 0
rangeProcCfg 0 0 0 0 0
"""


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Load a text as a `.cfg`, on the AWR1843BOOST unless another board is named."""

    def read(text: str, preset: str | None = None, board: str | None = "awr1843", **options: object) -> Radar:
        path = tmp_path / "profile.cfg"
        path.write_bytes(text.encode())
        return Radar.load(path, preset, board=board, **options)  # type: ignore[arg-type]

    return read


def test_the_demonstration_of_a_first_generation_board(load: Load) -> None:
    """SDK 1 has four arguments in adcbufCfg, and no subframes elsewhere."""
    radar = load(SDK1_1443, board="iwr1443boost")
    wave = radar.waveform
    assert (radar.name, radar.preset) == ("iwr1443boost", "frame")
    assert (wave.start_frequency, wave.slope, wave.sample_rate) == (77e9, 70e12, 4.884e6)
    assert (wave.idle_time, wave.adc_start_time, wave.ramp_end_time) == (7e-6, 7e-6, 57.14e-6)
    assert (wave.num_samples, wave.num_loops, wave.frame_period) == (240, 16, 33.333e-3)
    assert [radar.tx_names[tx] for tx in wave.tx_order] == ["TX1", "TX3", "TX2"]
    # c / 2B of 240 samples at 4.884 Msps; wavelength / (2 loops chirps of 64.14 us).
    assert radar.range_resolution == pytest.approx(299_792_458 / (2 * 70e12 * 240 / 4.884e6))
    assert radar.velocity_resolution == pytest.approx(radar.wavelength / (2 * 16 * 3 * 64.14e-6))


def test_it_is_the_preset_that_has_the_same_numbers(load: Load) -> None:
    assert load(PLAIN).waveform == Radar.load("awr1843", "mmmesh").waveform
    np.testing.assert_array_equal(load(PLAIN).tx_positions, Radar.load("awr1843").tx_positions)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: "".join(f"  {line}   % a comment\n\n# another\n" for line in text.splitlines()),
        lambda text: "profileCfg 0 60 7 6 65 0 0 60 1 256 4400 0 0 30\nsensorStop\nflushCfg\n" + text,
        lambda text: text.replace("profileCfg 0 77 7", "profileCfg 0 77.0 7.00").replace("2 128 0", "2 0x80 0"),
        lambda text: text + "frameCfg 0 2 128 0 100 1 0\n",
    ],
)
def test_writing_does_not_matter(load: Load, change: Callable[[str], str]) -> None:
    """Line ends, comments, spaces, numbers; a board forgets all before flushCfg."""
    assert load(change(PLAIN)).waveform == Radar.load("awr1843", "mmmesh").waveform


def test_comments_of_an_older_code_page(tmp_path: Path) -> None:
    path = tmp_path / "latin"
    path.write_bytes("% Öffnungswinkel 60°\n".encode("latin-1") + PLAIN.encode())
    assert Radar.load(path, board="awr1843").frame_shape == (128, 3, 4, 256)


def test_people_counting_with_bpm(load: Load) -> None:
    """TX1 and TX3 together with equal, then with opposite sign; TX2 alone between them."""
    radar = load(PEOPLE_6843, board="iwr6843isk")
    assert radar.axis_names == ("0:TX1+TX3", "1:TX2", "2:TX1-TX3")
    assert radar.waveform.multiplexing == "bpm"
    assert radar.frame_shape == (48, 3, 4, 96)
    assert (radar.waveform.slope, radar.waveform.idle_time) == (54.71e12, 30e-6)


def test_bpm_that_is_switched_off_is_none(load: Load) -> None:
    text = PLAIN.replace("0 0 0 1\n", "0 0 0 5\n").replace("0 0 0 4\n", "0 0 0 5\n")
    assert load(text + "bpmCfg -1 0 0 1\n").axis_names == ("0:TX1+TX3", "1:TX1+TX3", "2:TX2")
    assert load(text + "bpmCfg -1 1 0 1\n").axis_names == ("0:TX1+TX3", "1:TX1-TX3", "2:TX2")
    # Bits of constBpmVal: a pair for each Tx, the upper one during the chirp.
    assert load(text + "bpmCfgAdvanced 0 0 2\n").axis_names == ("0:-TX1+TX3", "1:TX1+TX3", "2:TX2")
    with pytest.raises(RadarConfigError, match=r"bpmCfg \(line 8\): both chirps need the same Tx"):
        load(text + "bpmCfg -1 1 0 2\n")


def test_subframes_are_presets(load: Load) -> None:
    near, far = (load(SUBFRAMES, f"subframe{number}", "iwr6843isk") for number in range(2))
    assert (near.waveform.slope, near.waveform.num_loops, near.waveform.num_samples) == (250e12, 32, 128)
    assert (far.waveform.slope, far.waveform.num_loops, far.waveform.num_samples) == (150e12, 16, 256)
    for radar in (near, far):  # each subframe comes once a frame
        assert radar.waveform.frame_period == 0.1
        assert radar.tx_names == ("TX1", "TX3")
    with pytest.raises(RadarConfigError, match="2 kinds of frames: name one as preset, subframe0, subframe1"):
        load(SUBFRAMES, None, "iwr6843isk")
    with pytest.raises(RadarConfigError, match="preset is 'subframe2'; presets: subframe0, subframe1"):
        load(SUBFRAMES, "subframe2", "iwr6843isk")
    forced = SUBFRAMES.replace("advFrameCfg 2 0 0", "advFrameCfg 2 1 0").replace("subFrameCfg 1 0", "subFrameCfg 1 1")
    assert (
        load(forced.replace("subFrameCfg 0 0", "subFrameCfg 0 1"), "subframe0", "iwr6843isk").waveform.slope == 150e12
    )
    bursts = SUBFRAMES.replace("0 0 2 32 60 0 1 1 60", "0 0 2 32 60 0 2 1 60")
    with pytest.raises(RadarConfigError, match=r"subFrameCfg \(line 12\): numOfBurst 2 .*one burst a subframe"):
        load(bursts, "subframe0", "iwr6843isk")


def test_variations_are_profiles_of_their_own(load: Load) -> None:
    """startFreqVar [Hz], freqSlopeVar [kHz/us], idleTimeVar and adcStartTimeVar [us] are added to the profile's."""
    text = PLAIN.replace("chirpCfg 1 1 0 0 0 0 0 4", "chirpCfg 1 1 0 1000000 48 3 0.5 4")
    radar = load(text)
    first, varied = radar.waveform.profiles
    assert first.start_frequency == 77e9
    assert (varied.start_frequency, varied.slope) == (77.001e9, 60.06e12)
    assert (varied.idle_time, varied.adc_start_time) == (10e-6, 6.5e-6)
    assert [slot.profile for slot in radar.waveform.slots] == [0, 1, 0]
    # Three ramps of 65 us; idle 7, 10 and 7 us.
    assert radar.waveform.loop_period == pytest.approx(3 * 65e-6 + 24e-6)


def test_ddm_of_the_awr2944(load: Load) -> None:
    """Four Tx turn by 0, -60, -120 and -180 degrees a chirp in the order TX1, TX3, TX4, TX2: six Doppler bands."""
    radar = load(DDM_2944, board="awr2944evm")
    (slot,) = radar.waveform.slots
    assert radar.adc.real
    assert radar.frame_shape == (768, 1, 4, 384)
    np.testing.assert_allclose(np.mod(slot.advance_deg, 360), [0, 180, 300, 240])
    assert radar.waveform.multiplexing == "ddm"
    assert radar.waveform.doppler_bands == pytest.approx(6)
    with pytest.raises(RadarConfigError, match=r"ddmPhaseShiftAntOrder.* a multiple of 6 chirps"):
        load(
            DDM_2944.replace("chirpCfg 0 5", "chirpCfg 0 4").replace("frameCfg 0 5", "frameCfg 0 4"), board="awr2944evm"
        )
    with pytest.raises(RadarConfigError, match=r"frameCfg \(line 10\): numAdcSamples 256; profileCfg has \[384\]"):
        load(DDM_2944.replace("128 0 384 50", "128 0 256 50"), board="awr2944evm")


def test_repeated_chirps_are_loops(load: Load) -> None:
    """128 equal chirps in one loop are 128 loops of one."""
    text = PLAIN.replace("chirpCfg 0 0 0", "chirpCfg 0 127 0").replace("chirpCfg 1", "%").replace("chirpCfg 2", "%")
    radar = load(text.replace("frameCfg 0 2 128", "frameCfg 0 127 2"))
    assert radar.frame_shape == (256, 1, 4, 256)
    assert radar.tx_names == ("TX1",)


def test_the_frame_takes_the_chirps_that_it_names(load: Load) -> None:
    assert load(PLAIN.replace("frameCfg 0 2", "frameCfg 1 2")).tx_names == ("TX2", "TX3")
    with pytest.raises(RadarConfigError, match=r"frameCfg \(line 7\) takes chirp 3; there is no chirpCfg for it"):
        load(PLAIN.replace("frameCfg 0 2", "frameCfg 0 3"))


def test_receivers_that_are_off(load: Load) -> None:
    radar = load(PLAIN.replace("channelCfg 15", "channelCfg 10"))
    assert radar.rx_names == ("RX2", "RX4")
    np.testing.assert_array_equal(radar.rx_positions, Radar.load("awr1843").rx_positions[[1, 3]])


def test_kinds_of_samples(load: Load) -> None:
    assert load(PLAIN.replace("adcCfg 2 1", "adcCfg 2 0")).adc.real
    assert not load(PLAIN.replace("adcCfg 2 1", "adcCfg 2 2")).adc.real
    assert load(PLAIN.replace("adcCfg 2 1", "adcCfg 0 1")).adc.bits == 12
    with pytest.raises(
        RadarConfigError, match=r"samples are complex; the receivers of 'awr2944evm' have one converter"
    ):
        load(PLAIN, board="awr2944evm")
    with pytest.raises(RadarConfigError, match=r"adcCfg \(line 2\) and adcbufCfg \(line 8\) contradict each other"):
        load(PLAIN + "adcbufCfg -1 1 1 1 1\n")
    with pytest.raises(RadarConfigError, match=r"adcOutputFmt 3; 0 \(real\), 1 or 2 \(complex\)"):
        load(PLAIN.replace("adcCfg 2 1", "adcCfg 2 3"))


def test_power_and_phases_of_the_profile(load: Load) -> None:
    """txOutPower has a byte for each Tx [dB], txPhaseShifter six bits in each byte's upper part [5.625 degrees]."""
    three = 3 | 3 << 8 | 3 << 16
    assert load(PLAIN.replace("65 0 0 60", f"65 {three} 0 60")).tx_power_dbm == 9.0
    with pytest.warns(RadarConfigWarning, match="txOutPower differs from Tx to Tx"):
        assert load(PLAIN.replace("65 0 0 60", "65 3 0 60")).tx_power_dbm == 12.0
    quarter = 16 << 2 + 8  # TX2 by 90 degrees
    radar = load(PLAIN.replace("65 0 0 60", f"65 0 {quarter} 60"))
    assert radar.axis_names == ("0:TX1", "1:TX3", "2:TX2@90")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("adcCfg 2 1\n", "", "adcCfg is missing"),
        (PLAIN, "sensorStop\nchannelCfg 15 7 0\n", "adcCfg, profileCfg, chirpCfg, frameCfg are missing"),
        ("0 0 30\n", "0 0\n", "profileCfg (line 3) has 13 arguments; 14 are needed: profileCfg profileId startFreq"),
        ("60.012", "steep", "profileCfg (line 3): freqSlopeConst is 'steep'; a number is needed"),
        ("adcCfg 2 1", "adcCfg 2 1\ndfeDataOutputMode 2", "dfeDataOutputMode (line 3) 2 is a continuous wave"),
        ("adcCfg 2 1", "adcCfg 2 1\ncontModeCfg 77 0 0 5000 0 0 30 0 0", "contModeCfg (line 3) is a continuous wave"),
        (PLAIN, "chirpComnCfg 20 0 0 128 4 58 0\nframeCfg 2 0 200 64 250 0\n", "(line 1) is of TI's low-power"),
        ("channelCfg 15 7", "channelCfg 15 3", "(line 5): txEnable 4; at least one of the Tx in txChannelEn 3"),
        ("channelCfg 15 7", "channelCfg 0 7", "rxChannelEn is 0"),
        ("chirpCfg 1 1 0", "chirpCfg 1 1 2", "chirpCfg (line 5) takes profile 2; there is no such profileCfg"),
        ("chirpCfg 1 1 0", "chirpCfg 0 1 0", "chirpCfg (line 5): another chirpCfg has chirp 0 too"),
        ("adcCfg 2 1", "adcCfg 2 1\nadcCfg 2 0", "adcCfg (line 2) and adcCfg (line 3) contradict each other"),
        ("2 128 0", "2 0 0", "0 loops of 3 chirps"),
        ("frameCfg 0 2 128 0 100", "frameCfg 0 2 128 0 10", "frame_period is 10 ms but 128 loops of 3 slots"),
        ("1 256 4400", "1 300 4400", "at most 259 samples fit"),
    ],
)  # fmt: skip
def test_what_is_missing_or_wrong_is_named(load: Load, old: str, new: str, said: str) -> None:
    with pytest.raises(RadarConfigError) as caught:
        load(PLAIN.replace(old, new))
    assert said in str(caught.value)
    assert "profile.cfg" in str(caught.value)


def test_all_that_is_missing_or_incomplete_is_told_at_once(load: Load) -> None:
    text = PLAIN.replace("adcCfg 2 1\n", "").replace(" 100 1 0", " 100").replace("60.012", "?")
    with pytest.raises(RadarConfigError) as caught:
        load(text)
    for said in ("adcCfg is missing", "frameCfg (line 6) has 5 arguments; 7 are needed", "freqSlopeConst is '?'"):
        assert said in str(caught.value)


def test_commands_that_nobody_knows_are_named(load: Load) -> None:
    with pytest.warns(RadarConfigWarning, match=r"profile\.cfg: ditherCfg, fancyCfg are not known and left out"):
        load(PLAIN + "ditherCfg 1\nfancyCfg 3 4\nditherCfg 2\ncalibDcRangeSig -1 0 -5 8 256\n")


def test_the_board_is_asked_for_among_those_that_can(load: Load) -> None:
    with pytest.raises(RadarConfigError) as caught:
        load(PLAIN, board=None)
    assert "profile.cfg gives no board" in str(caught.value)
    assert "boards at 77.36 … 80.85 GHz with TX3 and RX4: awr1843, iwr1443boost" in str(caught.value)
    with pytest.raises(RadarConfigError, match=r"with TX3 and RX4: iwr6843aop, iwr6843isk, iwr6843isk_ods$"):
        load(PEOPLE_6843, board=None)
    with pytest.raises(RadarConfigError, match=r"TX3 fires; radar 'awr1642boost' has TX1, TX2; boards .*: awr1843"):
        load(PLAIN, board="awr1642boost")
    with pytest.raises(RadarConfigError, match=r"samples 77\.36.*'iwr6843isk' reaches 60 … 64 GHz: boards .*awr1843"):
        load(PLAIN, board="iwr6843isk")
    with pytest.raises(ValueError, match=r"no radar is called 'iwr9999'"):
        load(PLAIN, board="iwr9999")


def test_overrides_change_what_the_file_says(load: Load) -> None:
    radar = load(PLAIN, overrides={"preset.frame.num_loops": 8, "receiver.noise_figure_db": 3.0}, position=(0, 0, 2))
    assert (radar.waveform.num_loops, radar.noise_figure_db, radar.position) == (8, 3.0, (0.0, 0.0, 2.0))


def test_a_board_of_ones_own(load: Load, radar_file: object) -> None:
    radar_file.set("name", "mine")  # type: ignore[attr-defined]
    radar_file.load()  # type: ignore[attr-defined]
    assert load(PLAIN, board=str(radar_file.path)).name == "mine"  # type: ignore[attr-defined]


@pytest.mark.parametrize(("stream", "warned"), [("-1 0 1 0", False), ("-1 1 1 1", True), ("-1 0 4 0", True)])
def test_streams_of_more_than_samples_are_told(load: Load, stream: str, warned: bool) -> None:
    """Headers (enableHeader 1), quality data (dataFmt 4) and user data (enableSW 1) stand among the samples."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load(PLAIN + f"lvdsStreamCfg {stream}\n")
    assert any("lvdsStreamCfg" in str(each.message) for each in caught) == warned
