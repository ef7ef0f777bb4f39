"""Array types and physical constants of the whole package."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
ComplexArray = NDArray[np.complex128]

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s] (exact, SI)."""
