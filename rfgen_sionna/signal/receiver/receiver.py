"""The receiver: its impairments and its ADC."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal.receiver.channels import Coupling, DcOffset, IqImbalance, Mismatch
from rfgen_sionna.signal.receiver.interference import Interferer
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.static_paths import Chassis, Leakage, RangeBias, static_paths

PARTS: dict[str, type] = {
    "leakage": Leakage,
    "chassis": Chassis,
    "range_bias": RangeBias,
    "ramp_error": RampError,
    "phase_noise": PhaseNoise,
    "mismatch": Mismatch,
    "iq_imbalance": IqImbalance,
    "dc_offset": DcOffset,
}
"""Field of a :class:`Receiver` -> class of the impairment, for those that are plain tables."""


@dataclass(frozen=True, repr=False)
class Receiver(ShortRepr):
    """Hardware from the echoes to the ADC's words, in the order of the signal.

    By default only thermal noise and the radar's own ADC are on. For example:

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
    """Whether noise of power k T F B is added."""
    mismatch: Mismatch | None = None
    iq_imbalance: IqImbalance | None = None
    dc_offset: DcOffset | None = None
    adc: Adc | Literal["radar"] | None = "radar"
    """Converters; "radar" takes `radar.adc`, None does not quantise."""

    def __post_init__(self) -> None:
        for name, kind in (PARTS | {"coupling": Coupling}).items():
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
        """Receiver without impairments, noise and quantisation."""
        return cls(thermal_noise=False, adc=None)

    def without_noise(self) -> Receiver:
        """The same receiver without thermal noise."""
        return replace(self, thermal_noise=False)

    def converter(self, radar: Radar) -> Adc | None:
        """ADC for `radar`; None does not quantise."""
        return radar.adc if isinstance(self.adc, str) else self.adc

    def tx_gains(self, radar: Radar, seed: int) -> ComplexArray | None:
        """(tx,) gains of the Tx chains for :func:`~rfgen_sionna.signal.synthesize`, of a radar whose elements radiate
        at once; None where :func:`~rfgen_sionna.signal.receive` applies them."""
        wave = radar.waveform
        if self.mismatch is None or not wave.slots or wave.separated:
            return None
        return self.mismatch.factors(radar, seed)[0]

    def check(self, radar: Radar) -> None:
        """Raise a ValueError, naming field, value and cure, if something does not fit `radar`."""
        static_paths(radar, self.leakage, self.chassis, self.range_bias)
        if isinstance(self.adc, Adc) and self.adc.real != radar.adc.real:
            raise ValueError(
                f"receiver.adc.real is {self.adc.real} and that of radar '{radar.name}' is {radar.adc.real}: the radar "
                f"determines whether samples are real; take Adc(..., real={radar.adc.real})"
            )
        flat = any(profile.slope == 0 for profile in radar.waveform.profiles)
        if flat and (self.ramp_error is not None or self.phase_noise is not None):
            raise ValueError(
                "waveform.slope is 0: receiver.ramp_error and receiver.phase_noise need a ramp, whose beat frequencies "
                "are delays"
            )
        for part in (self.coupling, self.mismatch, self.iq_imbalance, self.dc_offset, *self.interferers):
            if part is not None:
                part.check(radar)
