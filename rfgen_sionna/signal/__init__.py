"""From paths to the samples of a radar's ADC."""

from rfgen_sionna.signal.noise import add_thermal_noise, noise_power
from rfgen_sionna.signal.receiver import (
    Capture,
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
from rfgen_sionna.signal.synthesis import synthesize

__all__ = [
    "Capture",
    "Chassis",
    "Coupling",
    "DcOffset",
    "Interferer",
    "IqImbalance",
    "Leakage",
    "Mismatch",
    "PhaseNoise",
    "RampError",
    "RangeBias",
    "Receiver",
    "add_thermal_noise",
    "noise_power",
    "read_receiver",
    "receive",
    "receiver_from_record",
    "receiver_record",
    "synthesize",
]
