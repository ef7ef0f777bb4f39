"""The receiver as a whole: which impairments there are, and their order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal.noise import add_thermal_noise
from rfgen_sionna.signal.random_streams import frame_stream
from rfgen_sionna.signal.receiver.channels import Coupling, Mismatch
from rfgen_sionna.signal.receiver.converter import ReceivedFrame, convert
from rfgen_sionna.signal.receiver.delay_phase_errors import generator_error
from rfgen_sionna.signal.receiver.interference import Interferer
from rfgen_sionna.signal.receiver.mixer import DcOffset, IqImbalance
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.static_paths import Chassis, Leakage, RangeBias, static_paths, tone


@dataclass(frozen=True)
class Receiver:
    """The hardware between the echoes and the ADC's words, in the order in which a signal meets it.

    Everything is off but thermal noise and the radar's own ADC. A board as it comes, with numbers of one's own:

    >>> Receiver(
    ...     leakage=Leakage(level_db=-30.0),
    ...     range_bias=RangeBias(0.065),
    ...     phase_noise=PhaseNoise(((1e5, -85.0), (1e6, -95.0), (1e7, -115.0))),
    ...     mismatch=Mismatch(gain_spread_db=0.5, phase_spread_deg=5.0),
    ... ).thermal_noise
    True
    """

    leakage: Leakage | None = None
    chassis: Chassis | None = None
    range_bias: RangeBias | None = None
    ramp_error: RampError | None = None
    phase_noise: PhaseNoise | None = None
    interferers: tuple[Interferer, ...] = ()
    coupling: Coupling | None = None
    thermal_noise: bool = True
    """kTBF of the radar's temperature, noise figure and sample rate."""
    mismatch: Mismatch | None = None
    iq_imbalance: IqImbalance | None = None
    dc_offset: DcOffset | None = None
    adc: Adc | Literal["radar"] | None = "radar"
    """Converters; "radar" takes `radar.adc`, None leaves the samples as they are."""

    def __post_init__(self) -> None:
        kinds: dict[str, type] = {
            "leakage": Leakage,
            "chassis": Chassis,
            "range_bias": RangeBias,
            "ramp_error": RampError,
            "phase_noise": PhaseNoise,
            "coupling": Coupling,
            "mismatch": Mismatch,
            "iq_imbalance": IqImbalance,
            "dc_offset": DcOffset,
        }
        for name, kind in kinds.items():
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                raise TypeError(f"receiver.{name} is {value!r}: None or a {kind.__name__} is needed")
        if isinstance(self.interferers, Interferer):
            object.__setattr__(self, "interferers", (self.interferers,))
        try:
            object.__setattr__(self, "interferers", tuple(self.interferers))
        except TypeError:
            raise TypeError(f"receiver.interferers is {self.interferers!r}: a list of Interferer is needed") from None
        for other in self.interferers:
            if not isinstance(other, Interferer):
                raise TypeError(f"receiver.interferers holds {other!r}: an Interferer is needed")
        if not isinstance(self.thermal_noise, bool):
            raise TypeError(f"receiver.thermal_noise is {self.thermal_noise!r}: True or False is needed")
        if not (self.adc is None or isinstance(self.adc, Adc) or self.adc == "radar"):
            raise TypeError(f'receiver.adc is {self.adc!r}: an Adc, "radar" or None is needed')

    @classmethod
    def ideal(cls) -> Receiver:
        """A receiver that changes nothing: switch on what is to be looked at with `dataclasses.replace`."""
        return cls(thermal_noise=False, adc=None)

    def without_noise(self) -> Receiver:
        """The same receiver without thermal noise."""
        return replace(self, thermal_noise=False)

    def converter(self, radar: Radar) -> Adc | None:
        """The ADC that is in effect for `radar`."""
        return radar.adc if isinstance(self.adc, str) else self.adc

    def tx_gains(self, radar: Radar, seed: int) -> ComplexArray | None:
        """(tx,) gains of the Tx chains that :func:`~rfgen_sionna.signal.synthesize` must know of.

        They are those of a radar whose elements radiate together; None where :func:`receive` puts them in.
        """
        wave = radar.waveform
        if self.mismatch is None or not wave.slots or wave.separated:
            return None
        return self.mismatch.factors(radar, seed)[0]

    def check(self, radar: Radar) -> None:
        """Raise if something does not fit `radar`, before any work is done.

        Raises
        ------
        ValueError
            Naming the field, its value and what is allowed.
        """
        static_paths(radar, self.leakage, self.chassis, self.range_bias)
        flat = any(profile.slope == 0 for profile in radar.waveform.profiles)
        if flat and (self.ramp_error is not None or self.phase_noise is not None):
            raise ValueError(
                "waveform.slope is 0: receiver.ramp_error and receiver.phase_noise need a ramp, whose beat frequencies "
                "tell delays apart"
            )
        for part in self._parts():
            part.check(radar)

    def _parts(self) -> Iterator[Any]:
        for part in (self.coupling, self.mismatch, self.iq_imbalance, self.dc_offset, *self.interferers):
            if part is not None:
                yield part


def receive(
    samples: ComplexArray,
    radar: Radar,
    receiver: Receiver,
    *,
    seed: int = 0,
    frame: int = 0,
    full_scale: float | None = None,
) -> ReceivedFrame:
    """Samples of one frame behind the receiver.

    The order is that of the signal: leakage and chassis join the echoes, all of them late by the range bias; the
    generator's ramp error and phase noise act on each by its delay; the Tx chains; interference; coupling of the Rx
    antennas; thermal noise; the Rx chains, which noise goes through as well; IQ imbalance; DC offset; ADC.

    Parameters
    ----------
    samples
        (chirp, tx, rx, sample) of :func:`~rfgen_sionna.signal.synthesize`, in square roots of watts; left as they are.
        Where several Tx elements radiate at once they hold `receiver.tx_gains` already.
    seed, frame
        Draws depend on these, on the radar's name and pose (at t = 0) and on the name of the impairment alone: radars
        of one scene draw independently, and switching an impairment on leaves the others' as they were. What belongs to
        the device (mismatch, phase of the DC offset, the interferers' clocks) depends on `seed` and the radar alone.
    full_scale
        Range of an automatic ADC [sqrt(W)], for instance that of the run's first frame; None sets it from this frame.

    Raises
    ------
    ValueError
        If the samples are not those of `radar`, or the receiver does not fit it.
    """
    if samples.shape != radar.frame_shape:
        raise ValueError(f"samples have the shape {samples.shape}; radar '{radar.name}' makes {radar.frame_shape}")
    for name, value in (("seed", seed), ("frame", frame)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
            raise ValueError(f"{name} is {value!r}: a whole number of at least 0 is needed")
    receiver.check(radar)
    seed, frame = int(seed), int(frame)
    out = np.array(samples, dtype=np.complex128)
    wave = radar.waveform
    tx_gain, rx_gain = (None, None) if receiver.mismatch is None else receiver.mismatch.factors(radar, seed)
    for number in range(len(wave.profiles)):
        axis = list(wave.profile_axis(number)) if wave.other_profiles else slice(None)
        gains = None if tx_gain is None else tx_gain[list(wave.profile_tx(number))]
        out[:, axis] = _one_profile(out[:, axis], radar.of_profile(number), receiver, gains, seed, frame, number)
    if receiver.coupling is not None:
        out = receiver.coupling.apply(out)
    if receiver.thermal_noise:
        add_thermal_noise(out, radar, seed, frame)
    if rx_gain is not None:
        out *= rx_gain[:, None]
    if receiver.iq_imbalance is not None:
        out = receiver.iq_imbalance.apply(out, radar)
    if receiver.dc_offset is not None:
        out += receiver.dc_offset.offsets(radar, seed)[:, None]
    adc = receiver.converter(radar)
    return ReceivedFrame(out) if adc is None else convert(out, radar, adc, full_scale)


def _one_profile(
    samples: ComplexArray,
    radar: Radar,
    receiver: Receiver,
    tx_gains: ComplexArray | None,
    seed: int,
    frame: int,
    number: int,
) -> ComplexArray:
    """Generator, Tx chains and interference for chirps of one kind, the `number`-th; `samples` may change."""
    wave = radar.waveform
    together = bool(wave.slots) and not wave.separated
    weights = np.conj(wave.axis_weights) if together else None
    if weights is not None and tx_gains is not None:
        weights = weights * tx_gains
    name = "phase_noise" + (f".{number}" if number else "")
    samples = _generator(samples, radar, receiver, weights, seed, frame, name)
    if tx_gains is not None and not together:
        samples *= tx_gains[:, None, None]
    for index, other in enumerate(receiver.interferers):
        samples += other.samples(radar, seed=seed, frame=frame, index=index, profile=number)
    return samples


def _generator(
    samples: ComplexArray,
    radar: Radar,
    receiver: Receiver,
    weights: ComplexArray | None,
    seed: int,
    frame: int,
    name: str,
) -> ComplexArray:
    """Echoes, leakage and chassis with the delay that they share and the generator's errors; `samples` may change.

    `weights` (loop or 1, slot, tx) say what each slot holds of each Tx element; None is one element a slot.
    """
    if receiver.range_bias is not None:
        samples *= receiver.range_bias.phasor(radar)
    statics = static_paths(radar, receiver.leakage, receiver.chassis, receiver.range_bias)
    error = None
    if receiver.ramp_error is not None or receiver.phase_noise is not None:
        rng = frame_stream(seed, name, frame, radar)
        error = generator_error(samples, statics, radar, receiver.ramp_error, receiver.phase_noise, rng, weights)
    for path in statics:
        signal = path.amplitude * tone(radar, radar.waveform.sample_times, path.delay)
        samples += signal if weights is None else np.einsum("lat,trs->lars", weights, signal)
    if error is not None:
        samples += error
    return samples
