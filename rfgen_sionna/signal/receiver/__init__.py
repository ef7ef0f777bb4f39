"""The receiver: impairments from the antennas to the ADC's words, each a small configuration of its own.

All levels are referred to the receiver input, where samples are square roots of watts.
"""

from rfgen_sionna.signal.receiver.channels import Coupling, Mismatch
from rfgen_sionna.signal.receiver.converter import ReceivedFrame, convert
from rfgen_sionna.signal.receiver.interference import Interferer
from rfgen_sionna.signal.receiver.mixer import DcOffset, IqImbalance
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.receiver import Receiver, receive
from rfgen_sionna.signal.receiver.receiver_record import read_receiver, receiver_from_record, receiver_record
from rfgen_sionna.signal.receiver.static_paths import Chassis, Leakage, RangeBias

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
    "convert",
    "read_receiver",
    "receive",
    "receiver_from_record",
    "receiver_record",
]
