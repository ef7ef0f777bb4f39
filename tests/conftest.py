"""Set-up shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# One thread per process: tests measure results, not speed, and machines that run them are small.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

if "PYTEST_XDIST_WORKER" in os.environ:
    import drjit

    # Beside other processes a second thread waits for work most of the time, on a core that they need.
    drjit.set_thread_count(1)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--data", default=None, help="folder of recordings by others, for the tests that need them")


@pytest.fixture(scope="session")
def recordings(request: pytest.FixtureRequest) -> Path:
    """Folder of recordings by others: `--data FOLDER`, with `mars/` (github.com/SizheAn/MARS) and the like."""
    given = request.config.getoption("--data")
    if given is None:
        pytest.skip("needs recordings by others: --data FOLDER")
    folder = Path(given)
    assert folder.is_dir(), f"--data: no folder {given}"
    return folder
