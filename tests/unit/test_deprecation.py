"""Former public names work for one version, and warn."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from rfgen_sionna import scene, signal
from rfgen_sionna.pipeline import generate
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.report import TraceReport


def warns(old: str, new: str):
    return pytest.warns(DeprecationWarning, match=f"^{re.escape(old)} is deprecated .* use {re.escape(new)}$")


def test_attributes_and_methods_of_former_names() -> None:
    report = TraceReport(1, 2, 3, 4, 0.5, 0.25)
    with warns("TraceReport.between", "TraceReport.time_error") as caught:
        assert report.between == report.time_error == 0.25
    assert caught[0].filename == __file__
    with warns("TraceReport.instants", "TraceReport.sample_times"):
        assert report.instants == report.sample_times == 3
    with warns("Simulator.hidden", "Simulator.is_occluded"):
        assert Simulator.hidden is Simulator.is_occluded
    with pytest.raises(AttributeError, match="tests/reference/sbr"):
        _ = Simulator.__new__(Simulator).rays


@pytest.mark.parametrize(
    ("module", "old", "new"), [(scene, "Actor", "MeshActor"), (signal, "Capture", "ReceivedFrame")]
)
def test_former_names_of_modules(module, old: str, new: str) -> None:
    with warns(f"{module.__name__}.{old}", f"{module.__name__}.{new}") as caught:
        assert getattr(module, old) is getattr(module, new)
    assert caught[0].filename == __file__
    assert old not in module.__all__
    with pytest.raises(AttributeError, match=f"module '{module.__name__}' has no attribute 'Acter'"):
        _ = module.Acter
    assert not hasattr(module, "Acter")


def test_an_import_of_a_former_name_is_blamed_on_the_importing_line() -> None:
    program = "from rfgen_sionna.signal import Capture"
    done = subprocess.run([sys.executable, "-W", "default", "-c", program], capture_output=True, text=True, check=True)
    assert "<string>:1: DeprecationWarning: rfgen_sionna.signal.Capture is deprecated" in done.stderr


def test_the_source_of_surroundings_as_an_argument_of_its_own() -> None:
    refused = pytest.raises(ValueError, match="'painted' is no source of surroundings")
    with warns("generate(surroundings=…)", "environment='furnished: …'") as caught, refused:
        generate("a person walks", environment="an office", surroundings="painted")
    assert caught[0].filename == __file__
