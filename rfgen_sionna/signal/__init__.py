"""From paths to the samples of a radar's ADC."""

from rfgen_sionna._deprecation import former_names
from rfgen_sionna.signal.noise import add_thermal_noise, noise_power
from rfgen_sionna.signal.receiver import (
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
    ReceivedFrame,
    Receiver,
    read_receiver,
    receive,
    receiver_from_record,
    receiver_record,
)
from rfgen_sionna.signal.synthesis import synthesize

__all__ = [
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
    "ReceivedFrame",
    "Receiver",
    "add_thermal_noise",
    "noise_power",
    "read_receiver",
    "receive",
    "receiver_from_record",
    "receiver_record",
    "synthesize",
]

__getattr__ = former_names(__name__, {"Capture": "ReceivedFrame"})
