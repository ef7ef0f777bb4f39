"""Settings of the boards behind public data sets, as their points show them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from rfgen_sionna.processing.boards.out_of_box import OutOfBoxChain

CHAINS: Mapping[str, OutOfBoxChain] = MappingProxyType(
    {
        # TI's profile for three Tx: no point has a neighbour in Doppler, every other one has one in range; static
        # points are 93 %; levels of neighbouring range bins are those of Blackman's window.
        "radhar": OutOfBoxChain(),
        # Points of one range fill neighbouring Doppler bins. Without removal of static clutter, simulated people have
        # a Doppler histogram at five times the distance from the recorded one. The full scale gives the intensities.
        "mars": OutOfBoxChain(group_doppler=False, clutter_removal=True, full_scale_dbm=-13.0),
    }
)
"""Chain by data set: RadHAR (Singh et al., mmNets 2019) and MARS (An and Ogras, ACM TECS 2021), both of an IWR1443.

Fitted on the first recording of each activity of RadHAR's training part, and on subject 2 of MARS; `docs/evaluation.md`
has what speaks for each setting, `tests/unit/processing/test_board_recordings.py` holds them against the recordings.
"""
