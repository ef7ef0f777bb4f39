"""Set-up shared by all tests."""

from __future__ import annotations

import os

# One thread per process: tests measure results, not speed, and machines that run them are small.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

if "PYTEST_XDIST_WORKER" in os.environ:
    import drjit

    # Beside other processes a second thread waits for work most of the time, on a core that they need.
    drjit.set_thread_count(1)
