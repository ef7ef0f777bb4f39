"""Capture files of radars' own tools, written and read, with the scale that restores units.

`write_capture` and `read_capture` choose the format by name; `open_capture` reads frame by frame. Formats:

=============== ================================================== ==========================================
dca1000         one device of TI through a DCA1000                  `adc_data.bin`, `.mmwave.json`, `.setup.json`
cascade         TI MMWCAS-RF-EVM through its TDA2 host              `master|slaveN_NNNN_data.bin`, `_idx.bin`
position2go     Infineon Position2Go                                `.raw`, `.xml`
infineon        Infineon BGT60TR13C and its kin                     `radar.npy`, `config.json`
rfgenesis       RF Genesis (Chen and Zhang, 2023)                   `radar_frames.npy`
matlab          MATLAB, version 5, or 7.3 above 2 GB                `.mat`
=============== ================================================== ==========================================
"""

from rfgen_sionna.signal.formats.api import FORMATS, open_capture, read_capture, write_capture
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport, CaptureWarning
from rfgen_sionna.signal.formats.losses import Loss
from rfgen_sionna.signal.formats.mmwave_studio import radar_from_studio

__all__ = [
    "FORMATS",
    "Capture",
    "CaptureFormatError",
    "CaptureReport",
    "CaptureWarning",
    "Loss",
    "open_capture",
    "radar_from_studio",
    "read_capture",
    "write_capture",
]
