"""Every format in turn."""

from __future__ import annotations

import pytest

from tests.unit.signal.formats.captures import RADARS


@pytest.fixture(params=list(RADARS))
def capture_format(request: pytest.FixtureRequest) -> str:
    return str(request.param)
