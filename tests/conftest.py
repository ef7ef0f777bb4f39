"""Set-up shared by all tests."""

from __future__ import annotations

import os

# One thread per process: tests measure results, not speed, and machines that run them are small.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
