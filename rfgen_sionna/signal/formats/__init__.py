"""Capture files, both ways: the bytes that a radar's own tools write, with the scale that restores the units.

`write_capture` and `read_capture` choose the format by name; `open_capture` reads frame by frame. Formats:

=============== ================================================== ==========================================
dca1000         TI xWR16xx/18xx/68xx through a DCA1000              `adc_data.bin`, `.mmwave.json`, `.setup.json`
cascade         TI MMWCAS-RF-EVM through its TDA2 host              `master|slaveN_NNNN_data.bin`, `_idx.bin`
position2go     Infineon Position2Go                                `.raw`, `.xml`
rfgenesis       RF Genesis (Chen and Zhang, 2023)                   `radar_frames.npy`
matlab          MATLAB, version 5, or 7.3 above 2 GB                `.mat`
=============== ================================================== ==========================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.signal.formats.api import FORMATS, open_capture, read_capture, write_capture
    from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport, CaptureWarning
    from rfgen_sionna.signal.formats.studio import radar_from_studio

_HOME = {
    "FORMATS": "api",
    "Capture": "capture",
    "CaptureFormatError": "capture",
    "CaptureReport": "capture",
    "CaptureWarning": "capture",
    "open_capture": "api",
    "radar_from_studio": "studio",
    "read_capture": "api",
    "write_capture": "api",
}

__all__ = [
    "FORMATS",
    "Capture",
    "CaptureFormatError",
    "CaptureReport",
    "CaptureWarning",
    "open_capture",
    "radar_from_studio",
    "read_capture",
    "write_capture",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
