"""Points as a board's firmware reports them: bins, quantised coordinates, peak and signal-to-noise ratio."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray


@dataclass(frozen=True, repr=False)
class BoardPoints(ShortRepr):
    """Points of several frames, in the order in which the firmware lists them."""

    frame: NDArray[np.int64]
    """(point,) number of the frame, ascending."""
    range_bin: NDArray[np.int64]
    """(point,) bin of the range transform."""
    doppler_bin: NDArray[np.int64]
    """(point,) signed bin of the Doppler transform; positive is receding."""
    position: FloatArray
    """(point, 3) in the device frame [m]: x boresight, y left, z up."""
    range: FloatArray
    """(point,) [m]"""
    velocity: FloatArray
    """(point,) radial velocity [m/s]; positive is receding."""
    peak: FloatArray
    """(point,) magnitude of the strongest azimuth beam, in the unit of the chain's samples."""
    snr_db: FloatArray
    """(point,) level of the detection map over the noise of its CFAR window [dB]."""
    frames: int
    """Number of frames, those without points included."""

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def counts(self) -> NDArray[np.int64]:
        """(frame,) number of points."""
        return np.bincount(self.frame, minlength=self.frames)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> BoardPoints:
        """Points of a mask or of indices."""
        own = {name: value[chosen] for name, value in vars(self).items() if name != "frames"}
        return BoardPoints(**own, frames=self.frames)

    def _facts(self) -> Iterable[str]:
        yield f"{len(self)} points in {self.frames} frames"
