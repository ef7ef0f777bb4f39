"""From paths to the samples of a radar's ADC."""

from rfgen_sionna._deprecation import former_names
from rfgen_sionna.signal.noise import add_thermal_noise, noise_power
from rfgen_sionna.signal.receiver.channels import Coupling, DcOffset, IqImbalance, Mismatch
from rfgen_sionna.signal.receiver.interference import Interferer
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.receiver import Receiver
from rfgen_sionna.signal.receiver.receiver_record import read_receiver, receiver_from_record, receiver_record
from rfgen_sionna.signal.receiver.reception import ReceivedFrame, receive
from rfgen_sionna.signal.receiver.static_paths import Chassis, Leakage, RangeBias
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
