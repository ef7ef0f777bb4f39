"""The back end is probed before it can abort the process, and its absence is one clear message."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rfgen_sionna.scene import mitsuba_backend
from rfgen_sionna.scene.scene_errors import BackendError


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_versions_are_read_from_names():
    for name, version in {
        "/x/libLLVM.so.19.1": 19,
        "/x/libLLVM-15.so.1": 15,
        "/x/libLLVM-14.0.6.so.1": 14,
        "/opt/homebrew/opt/llvm@19/lib/libLLVM.dylib": 19,
        "/usr/lib/llvm-17/lib/libLLVM.so": 17,
        "/x/libLLVM.so": None,
    }.items():
        assert mitsuba_backend._version_of(Path(name)) == version, name


def test_the_tested_version_comes_first_and_old_ones_not_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    for name in ("libLLVM-15.so.1", "libLLVM-18.so.1", "libLLVM.so.20.1", "libLLVM.so.19.1", "libLLVM-17.so"):
        (tmp_path / name).touch()
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(mitsuba_backend, "_system_libraries", lambda: sorted(tmp_path.glob("libLLVM*")))
    assert [path.name for path in mitsuba_backend.find_llvm()] == [
        "libLLVM.so.19.1",
        "libLLVM.so.20.1",
        "libLLVM-18.so.1",
        "libLLVM-17.so",
    ]


def test_a_named_library_is_the_only_candidate(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/somewhere/libLLVM.so")
    assert mitsuba_backend.find_llvm() == [Path("/somewhere/libLLVM.so")]
    with pytest.raises(BackendError, match=r"(?s)/somewhere/libLLVM.so: no such file.*apt-get install libllvm19"):
        mitsuba_backend.usable_llvm()


def test_no_library_at_all_names_the_cure(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(mitsuba_backend, "_system_libraries", lambda: [Path("/x/libLLVM-15.so.1")])
    with pytest.raises(BackendError, match=r"only 15, with which Dr.Jit aborts.*libllvm19.*DRJIT_LIBLLVM_PATH"):
        mitsuba_backend.usable_llvm()


def test_a_library_that_kills_the_process_is_reported_not_suffered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    library = tmp_path / "libLLVM-19.so"
    library.touch()
    monkeypatch.setattr(mitsuba_backend, "_PROBE", "import os; os.abort()")
    assert "signal 6" in str(mitsuba_backend.probe_llvm(library))
    monkeypatch.setattr(mitsuba_backend, "_PROBE", "raise OSError('not an LLVM')")
    assert "not an LLVM" in str(mitsuba_backend.probe_llvm(library))
    monkeypatch.setattr(mitsuba_backend, "_PROBE", "print('probe', 3.0)")
    assert mitsuba_backend.probe_llvm(library) is not None, "a wrong answer is a failure too"


def test_success_is_remembered_until_the_library_changes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    library = tmp_path / "libLLVM-19.so"
    library.write_text("one")
    monkeypatch.setattr(mitsuba_backend, "_PROBE", f"print({mitsuba_backend._PROBE_ANSWER!r})")
    assert mitsuba_backend.probe_llvm(library) is None
    monkeypatch.setattr(mitsuba_backend, "_PROBE", "raise SystemExit(3)")
    assert mitsuba_backend.probe_llvm(library) is None, "the second probe comes from the cache"
    library.write_text("another one")
    assert mitsuba_backend.probe_llvm(library) == "exit status 3"


def test_a_cache_that_cannot_be_written_does_no_harm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    library = tmp_path / "libLLVM-19.so"
    library.touch()
    monkeypatch.setattr(mitsuba_backend, "_PROBE", f"print({mitsuba_backend._PROBE_ANSWER!r})")
    assert mitsuba_backend.probe_llvm(library) is None


def _python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {k: v for k, v in os.environ.items() if k != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**clean, **environment})


def test_the_command_says_what_is_wrong_and_fails():
    result = subprocess.run(
        [sys.executable, "-m", "rfgen_sionna.scene.mitsuba_backend"],
        capture_output=True,
        text=True,
        env={**os.environ, "DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so", "CUDA_VISIBLE_DEVICES": "-1"},
    )
    assert result.returncode == 1
    assert "libllvm19" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_variant_that_the_user_set_is_kept():
    code = """
from rfgen_sionna.scene.mitsuba_backend import ensure_backend, usable_llvm
import os, mitsuba
os.environ["DRJIT_LIBLLVM_PATH"] = str(usable_llvm())
mitsuba.set_variant("llvm_ad_rgb")
print(ensure_backend(), mitsuba.variant())
"""
    assert _python(code).stdout.split() == ["llvm_ad_rgb", "llvm_ad_rgb"]


def test_a_scalar_variant_is_refused():
    code = """
import mitsuba
mitsuba.set_variant("scalar_rgb")
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
ensure_backend()
"""
    assert "BackendError: Mitsuba variant 'scalar_rgb' cannot trace" in _python(code).stderr


def test_importing_scenes_starts_nothing_heavy():
    code = (
        "import sys, rfgen_sionna.scene; print({'mitsuba', 'drjit', 'sionna', 'torch', 'trimesh'} & set(sys.modules))"
    )
    assert _python(code).stdout.strip() == "set()"
