"""A frame as the `.cfg` of TI's mmWave SDK 3, or of its MCU+ SDK where that one is needed (four Tx, DDM).

Limits of the devices follow the mmWaveLink interface and the data sheets of xWR16xx, xWR18xx and xWR68xx. Values are
written as they are; where the device has steps, a comment states what it makes of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.profile import Profile
from rfgen_sionna.radar.ti_cfg import DDM_BANDS
from rfgen_sionna.radar.ti_chirps import MOST_CHIRPS, MOST_PROFILES, TiChirp, Variation, chirps_of, decimal
from rfgen_sionna.radar.waveform import Waveform

_BANDS = {60: (60e9, 64e9), 77: (76e9, 81e9)}
"""Bands of the devices [Hz]."""
_FREQUENCY_STEP = {60: Decimal(2_700_000_000) / 2**26, 77: Decimal(3_600_000_000) / 2**26}
"""Steps of the start frequency [Hz]; those of the slope are 900 of them a microsecond."""
_MOST_LOOPS = 255
_SAMPLE_RATE = (2e6, 37.5e6)
_RATES = ((r"wr16", 6.25e6), (r"wr(18|68|64)", 12.5e6), (r"wr(12|14)|2944", 18.75e6))
"""Highest sample rate [Hz] by the name of a device, twice that of real samples (datasheets SWRS203; SWRS222, SWRS219;
SWRS211, SWRS273)."""
_BUFFER = 16384
"""Bytes of a chirp's samples of all receivers (`numAdcSamples` of mmWaveLink)."""
_LONGEST_FRAME = 1.342
_ADC_BITS = {12: 0, 14: 1, 16: 2}
_MOST_TX, _MOST_RX = 4, 4
_MOST_BACKOFF = 30  # [dB]
_LONGEST = {"idle_time": 5.24287e-3, "adc_start_time": 40.95e-6, "ramp_end_time": 5e-3}
"""Longest times of a profile [s]."""
_STEEPEST = {60: 6905, 77: 5510}
"""Steepest slope in steps; 2072 of the 77 GHz devices named in `_FIRST`."""
_FIRST = re.compile(r"wr1[2468]", re.IGNORECASE)
_MOST_VARIED = (Decimal("450e6"), Decimal("3.04e12"), Decimal("655.35e-6"), Decimal("655.35e-6"))
"""Largest variations of start frequency [Hz], slope [Hz/s], idle time, ADC start time [s]."""
_MCUPLUS = re.compile(r"2[59]44|am27", re.IGNORECASE)
"""Names of devices of the MCU+ SDK."""
_OTHER_MAKERS = re.compile(r"^(bgt|position2go|distance2go)", re.IGNORECASE)


def cfg_text(
    name: str,
    preset: str,
    waveform: Waveform,
    transmitters: Sequence[int],
    receivers: Sequence[int],
    *,
    feeds: ComplexArray,
    backoff_db: float,
    real: bool,
    bits: int,
    streamed: bool,
) -> str:
    """Text of a `.cfg` with all commands that the demonstrations need.

    Parameters
    ----------
    name, preset
        Names of the radar and of its preset, for the comment.
    waveform
        The frame.
    transmitters, receivers
        Numbers of the elements, from 1.
    feeds
        (tx, rx) factors that undo the phases of the elements' feeds in the samples.
    backoff_db
        Tx power below the board's [dB]; whole numbers are written, others stated.
    real, bits
        Kind and bits of the samples.
    streamed
        Whether the board streams its samples by LVDS.

    Raises
    ------
    RadarConfigError
        A device has no such frame; the message names field, value and limit.
    """
    if _OTHER_MAKERS.match(name):
        raise RadarConfigError(f"radar '{name}' is not of TI, and has no .cfg")
    band = _check(name, waveform, transmitters, receivers, bits, real)
    ddm = any(slot.advance_deg for slot in waveform.slots)
    if ddm and not real:
        raise RadarConfigError(
            "waveform.slots advance phases (DDM), and samples are complex; TI's DDM demonstration is for the AWR2944 "
            "with real samples"
        )
    mcuplus = bool(_MCUPLUS.search(name)) or max(transmitters) > 3 or ddm
    chirps, loops, order = _chirps(waveform, transmitters)
    profiles, chirps = _within_profiles(waveform.profiles, chirps)
    lines = [f"% {name}, preset {preset}, by rfgen_sionna", *_rounding(waveform, band)]
    code = int(backoff_db) if 0 <= backoff_db <= _MOST_BACKOFF and backoff_db == int(backoff_db) else 0
    if code != backoff_db:
        lines.append(
            f"% the Tx power is {-backoff_db:+g} dB from the board's, which steps of 1 dB downwards cannot give"
        )
    power = sum(code << 8 * (number - 1) for number in range(1, 5 if mcuplus else 4))
    lines += ["sensorStop", "flushCfg", "dfeDataOutputMode 1"]
    masks = [sum(1 << number - 1 for number in numbers) for numbers in (receivers, transmitters)]
    lines += [
        f"channelCfg {masks[0]} {masks[1]} 0",
        f"adcCfg {_ADC_BITS[bits]} {0 if real else 1}",
        f"adcbufCfg -1 {1 if real else 0} 1 1 1",
    ]
    lines += [_profile(index, profile, waveform.num_samples, band, power) for index, profile in enumerate(profiles)]
    for first, last, chirp in _runs(chirps):
        mask = sum(1 << number - 1 for number in chirp.phases)
        varied = " ".join(map(_number, chirp.variation, (0, -9, 6, 6)))
        lines.append(f"chirpCfg {first} {last} {chirp.profile} {varied} {mask}")
    samples = f" {waveform.num_samples}" if mcuplus else ""
    lines.append(f"frameCfg 0 {len(chirps) - 1} {loops} 0{samples} {_number(waveform.frame_period, 3)} 1 0")
    if order:
        rest = [number for number in range(1, _MOST_TX + 1) if number not in order]
        lines.append(f"ddmPhaseShiftAntOrder {' '.join(str(number - 1) for number in (*order, *rest))}")
    factors = np.ones((max(transmitters) if mcuplus else 2 if max(transmitters) < 3 else 3, _MOST_RX), np.complex128)
    factors[np.ix_([number - 1 for number in transmitters], [number - 1 for number in receivers])] = feeds
    pairs = " ".join(f"{factor.real + 0.0:.6g} {factor.imag + 0.0:.6g}" for factor in factors.ravel())
    lines += [
        "lowPower 0 0",
        "guiMonitor -1 1 1 0 0 0 1",
        "cfarCfg -1 0 2 8 4 3 0 15 1",
        "cfarCfg -1 1 0 4 2 3 1 15 1",
        "multiObjBeamForming -1 1 0.5",
        "clutterRemoval -1 0",
        "calibDcRangeSig -1 0 -5 8 256",
        "extendedMaxVelocity -1 0",
        "% lvdsStreamCfg -1 0 1 0 streams raw samples by LVDS" + ("" if real else ", Q before I"),
        f"lvdsStreamCfg -1 0 {int(streamed)} 0",
        _bpm(chirps, order),
        f"compRangeBiasAndRxChanPhase 0.0 {pairs}",
        "measureRangeBiasAndRxChanPhase 0 1.5 0.2",
        "CQRxSatMonitor 0 3 5 121 0",
        "CQSigImgMonitor 0 127 4",
        "analogMonitor 0 0",
        "aoaFovCfg -1 -90 90 -90 90",
        f"cfarFovCfg -1 0 0 {min(waveform.max_range, 1e4):.2f}",
        f"cfarFovCfg -1 1 {-waveform.max_velocity:.2f} {waveform.max_velocity:.2f}",
        "calibData 0 0 0",
        "sensorStart",
    ]
    return "\n".join(lines) + "\n"


def _check(
    name: str, wave: Waveform, transmitters: Sequence[int], receivers: Sequence[int], bits: int, real: bool
) -> int:
    """Band of the device [GHz], after all limits are checked."""
    low, high = wave.sampled_band
    band = next((band for band, (first, last) in _BANDS.items() if first <= low and high <= last), None)
    if band is None:
        bands = " and ".join(f"{first / 1e9:g} … {last / 1e9:g} GHz" for first, last in _BANDS.values())
        raise RadarConfigError(f"waveform samples {low / 1e9:.5g} … {high / 1e9:.5g} GHz; TI's devices have {bands}")
    limits = [
        ("the largest Tx number", max(transmitters), _MOST_TX),
        ("the largest Rx number", max(receivers), _MOST_RX),
        ("waveform.frame_period [s]", wave.frame_period, _LONGEST_FRAME),
    ]
    for what, value, most in limits:
        if value > most:
            raise RadarConfigError(f"{what} is {value:g}; a device of TI has at most {most:g}")
    most = _BUFFER // (len(receivers) * (2 if real else 4))
    if wave.num_samples > most:
        raise RadarConfigError(
            f"waveform.num_samples is {wave.num_samples}; the buffer of a device of TI has {most} "
            f"{'real' if real else 'complex'} samples of {len(receivers)} receivers"
        )
    fastest = next((rate for pattern, rate in _RATES if re.search(pattern, name, re.IGNORECASE)), 22.5e6)
    fastest = min(fastest * 2, _SAMPLE_RATE[1]) if real else fastest
    for profile in wave.profiles:
        if not _SAMPLE_RATE[0] <= profile.sample_rate <= fastest:
            raise RadarConfigError(
                f"waveform.sample_rate is {profile.sample_rate / 1e6:g} Msps; '{name}' has 2 … {fastest / 1e6:g} Msps "
                f"of {'real' if real else 'complex'} samples"
            )
        for field, longest in _LONGEST.items():
            if (time := getattr(profile, field)) > longest:
                raise RadarConfigError(
                    f"waveform.{field} is {time * 1e6:g} us; a device of TI has at most {longest * 1e6:g} us"
                )
        steps = 2072 if band == 77 and _FIRST.search(name) else _STEEPEST[band]
        steepest = float(steps * _FREQUENCY_STEP[band] * 900 * 10**6)
        if abs(profile.slope) > steepest:
            raise RadarConfigError(
                f"waveform.slope is {profile.slope / 1e12:g} MHz/us; '{name}' has at most {steepest / 1e12:.4g}"
            )
    if bits not in _ADC_BITS:
        raise RadarConfigError(f"adc.bits is {bits}; a device of TI has 12, 14 or 16")
    return band


def _chirps(wave: Waveform, transmitters: Sequence[int]) -> tuple[list[TiChirp], int, list[int]]:
    """Chirps of a loop, loops, and for DDM the Tx in the order of their phases."""
    order: list[int] = []
    if any(slot.advance_deg for slot in wave.slots):
        order = _ddm_order(wave, transmitters)
        bands = DDM_BANDS[len(order)]
        if wave.num_loops % bands:
            raise RadarConfigError(
                f"waveform.num_loops is {wave.num_loops}; the DDM demonstration needs a multiple of {bands} chirps"
            )
        chirps, loops = [TiChirp(0, dict.fromkeys(order, 0.0))] * bands, wave.num_loops // bands
    else:
        chirps, loops = chirps_of(wave, transmitters, MOST_CHIRPS)
    # A loop counter of 8 bits: longer loops of fewer repetitions.
    repeats = next(
        (
            count
            for count in range(1, MOST_CHIRPS // len(chirps) + 1)
            if loops % count == 0 and loops // count <= _MOST_LOOPS
        ),
        None,
    )
    if repeats is None:
        raise RadarConfigError(
            f"waveform.num_loops is {loops} of {len(chirps)} chirps; a device of TI has {MOST_CHIRPS} chirps a loop "
            f"and {_MOST_LOOPS} loops"
        )
    return chirps * repeats, loops // repeats, order


def _within_profiles(profiles: Sequence[Profile], chirps: Sequence[TiChirp]) -> tuple[list[Profile], list[TiChirp]]:
    """At most 4 profiles, with further ones as variations of those that have the same sample rate and ramp."""
    if len(profiles) <= MOST_PROFILES:
        return list(profiles), list(chirps)
    kinds = list(dict.fromkeys((profile.sample_rate, profile.ramp_end_time) for profile in profiles))
    bases: list[Profile] = []
    place: dict[int, tuple[int, Variation]] = {}
    for kind in kinds:
        own = [index for index, each in enumerate(profiles) if (each.sample_rate, each.ramp_end_time) == kind]
        least = {field: min(getattr(profiles[index], field) for index in own) for field in _VARIED}
        for index in own:
            start, slope, idle, adc_start = (
                decimal(getattr(profiles[index], field), 0) - decimal(least[field], 0) for field in _VARIED
            )
            variation = (start, slope, idle, adc_start)
            if any(change > most for change, most in zip(variation, _MOST_VARIED, strict=True)):
                raise RadarConfigError(
                    f"the frame has {len(profiles)} profiles; a device of TI has {MOST_PROFILES}, and varies them by "
                    "at most 450 MHz, 3.04 MHz/us, 655.35 us and 655.35 us"
                )
            place[index] = len(bases), variation
        bases.append(replace(profiles[own[0]], **least))
    if len(bases) > MOST_PROFILES:
        raise RadarConfigError(
            f"the frame has {len(bases)} profiles of different sample rates or ramps; a device of TI has "
            f"{MOST_PROFILES}"
        )
    return bases, [
        replace(chirp, profile=place[chirp.profile][0], variation=place[chirp.profile][1]) for chirp in chirps
    ]


_VARIED = ("start_frequency", "slope", "idle_time", "adc_start_time")


def _ddm_order(wave: Waveform, transmitters: Sequence[int]) -> list[int]:
    if len(wave.slots) != 1 or wave.other_profiles or wave.separated:
        raise RadarConfigError("waveform.slots: DDM with several slots or profiles, which no demonstration of TI has")
    slot = wave.slots[0]
    on = slot.on
    bands = DDM_BANDS.get(len(on), 0)
    turns = [round(-slot.advance_deg[tx] / 360 * bands, 9) % max(bands, 1) for tx in on]
    if not bands or sorted(turns) != list(range(len(on))) or any(slot.phases_deg[tx] for tx in on):
        raise RadarConfigError(
            f"waveform.slots[0].advance_deg is {[slot.advance_deg[tx] for tx in on]}; TI's DDM demonstration turns 2 "
            f"to 4 Tx by multiples of {-360 / bands if bands else -60:g} degrees, from 0 on"
        )
    return [transmitters[on[turns.index(turn)]] for turn in range(len(on))]


def _bpm(chirps: Sequence[TiChirp], order: Sequence[int]) -> str:
    """The `bpmCfg` of the chirps' signs, which must be those of TI's demonstrations."""
    phased = [index for index, chirp in enumerate(chirps) if any(chirp.phases.values())]
    if not phased or order:
        return "bpmCfg -1 0 0 1"
    index = phased[0]
    minus = chirps[index]
    last = max(minus.phases)
    plus = replace(minus, phases=dict.fromkeys(minus.phases, 0.0))
    wanted = {tx: 180.0 * (tx == last) for tx in minus.phases}
    if len(phased) > 1 or len(minus.phases) < 2 or dict(minus.phases) != wanted or plus not in chirps:
        raise RadarConfigError(
            f"waveform.slots have the phases {[dict(chirps[index].phases) for index in phased[:3]]} degrees by Tx; a "
            ".cfg has one pair of chirps with the same Tx, the last of which is inverted in the second one (bpmCfg)"
        )
    return f"bpmCfg -1 1 {list(chirps).index(plus)} {index}"


def _runs(chirps: Sequence[TiChirp]) -> Iterator[tuple[int, int, TiChirp]]:
    """First and last index of chirps in a row that have the same profile and Tx."""
    first = 0
    for index in range(1, len(chirps) + 1):
        here = chirps[first]
        if (
            index == len(chirps)
            or replace(chirps[index], phases=here.phases) != here
            or (set(chirps[index].phases) != set(here.phases))
        ):
            yield first, index - 1, here
            first = index


def _profile(index: int, profile: Profile, samples: int, band: int, power: int) -> str:
    values = (
        (profile.start_frequency, -9),
        (profile.idle_time, 6),
        (profile.adc_start_time, 6),
        (profile.ramp_end_time, 6),
    )
    times = " ".join(_number(value, exponent) for value, exponent in values)
    slope, rate, gain = _number(profile.slope, -12), _number(profile.sample_rate, -3), 158 if band == 60 else 30
    return f"profileCfg {index} {times} {power} 0 {slope} 1 {samples} {rate} 0 0 {gain}"


def _rounding(wave: Waveform, band: int) -> Iterator[str]:
    """Comments on values that are no multiples of the device's steps."""
    step = _FREQUENCY_STEP[band]
    steps = {
        "start_frequency": (step, "GHz", -9),
        "slope": (step * 900 * 10**6, "MHz/us", -12),
        "idle_time": (Decimal("1e-8"), "us", 6),
        "adc_start_time": (Decimal("1e-8"), "us", 6),
        "ramp_end_time": (Decimal("1e-8"), "us", 6),
        "sample_rate": (Decimal(1000), "ksps", -3),
    }
    for index, profile in enumerate(wave.profiles):
        for field, (unit, name, exponent) in steps.items():
            value = decimal(getattr(profile, field), 0)
            taken = int(value / unit) * unit  # the demonstration cuts off
            if taken != value:
                yield (
                    f"% profile {index}: {field} {_plain(value.scaleb(exponent))} {name}; the device takes "
                    f"{taken.scaleb(exponent):.12g}, in steps of {unit.scaleb(exponent):.5g}"
                )


def _number(value: float | Decimal, exponent: int) -> str:
    """`value` times 10 to the `exponent`, exactly."""
    return _plain(decimal(value, exponent))


def _plain(value: Decimal) -> str:
    text = f"{value:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
