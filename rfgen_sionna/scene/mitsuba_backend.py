"""Choice of the Mitsuba variant, and search for an LLVM that Dr.Jit can use.

On the CPU Dr.Jit compiles its kernels with the system's LLVM. LLVM 15 and 16 abort the process on any float minimum,
and Dr.Jit refuses older ones, so a child process tries a library before its first use. The import runs nothing: call
:func:`ensure_backend` before the first use of Mitsuba. ``python -m rfgen_sionna.scene.mitsuba_backend`` reports the
variant, or exits with 1 and the cure.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from rfgen_sionna.scene.scene_errors import BackendError

PREFERRED_LLVM = 19
"""Version tested with the Dr.Jit release in use."""
OLDEST_LLVM = 17
"""Oldest usable version: 15 and 16 abort the process, Dr.Jit refuses 14 and older."""
VARIANTS = ("cuda_ad_mono_polarized", "llvm_ad_mono_polarized")
"""Mitsuba variants in order of choice, as in Sionna; a variant set by the user comes first."""

_ENVIRONMENT = "DRJIT_LIBLLVM_PATH"
_CURE = (
    "Install LLVM 19 (Debian and Ubuntu: `apt-get install libllvm19`; where the distribution does not have it, the "
    "LLVM project's own Debian packages do; conda: `conda install -c conda-forge 'libllvm19'`; macOS: "
    f"`brew install llvm@19`), or set the environment variable {_ENVIRONMENT} to the file of an existing libLLVM of "
    f"version {OLDEST_LLVM} or later before Python starts."
)
_PROBE = """
import drjit as dr
from drjit.llvm import Float
a, b = Float(1.0, 4.0), Float(3.0, 2.0)
dr.eval(a, b)
c = dr.minimum(a, b)
print("probe", c[0] + 10.0 * c[1])
"""
_PROBE_ANSWER = "probe 21.0"
_chosen: str | None = None


def ensure_backend() -> str:
    """Make Mitsuba usable and return the active variant.

    A variant that is already set stays. Otherwise CUDA is taken with a usable device, else LLVM, for which the process
    gets `DRJIT_LIBLLVM_PATH` unless it is set.

    Raises:
        BackendError: no usable LLVM and no CUDA device, a scalar variant is set, or Mitsuba is not installed; the
            message names the cure.
    """
    global _chosen
    if _chosen is not None:
        import mitsuba

        if mitsuba.variant() == _chosen:
            return _chosen
    active = _active_variant()
    if active is None:
        active = _set_variant()
    elif not active.startswith(("llvm", "cuda", "metal")):
        raise BackendError(f"Mitsuba variant {active!r} cannot trace arrays of rays: set one of {', '.join(VARIANTS)}.")
    elif active.startswith("llvm"):
        _check_loaded_llvm()
    _chosen = active
    return active


def ensure_llvm() -> None:
    """Make Dr.Jit's kernels on the CPU usable, without Mitsuba.

    Raises:
        BackendError: no usable LLVM; the message names the cure.
    """
    if _chosen is not None and _chosen.startswith("llvm"):
        return
    if not os.environ.get(_ENVIRONMENT):
        os.environ[_ENVIRONMENT] = str(usable_llvm())
    _check_loaded_llvm()


def find_llvm() -> list[Path]:
    """Candidate LLVM libraries, best first: `DRJIT_LIBLLVM_PATH` alone if set, else version 19, newer ones, 18, 17."""
    explicit = os.environ.get(_ENVIRONMENT)
    if explicit:
        return [Path(explicit)]
    versions: dict[Path, int] = {}
    for path in _system_libraries():
        version = _version_of(path)
        if version is not None and version >= OLDEST_LLVM:
            versions.setdefault(path.resolve(), version)
    return sorted(versions, key=lambda path: (_preference(versions[path]), str(path)))


def probe_llvm(library: Path) -> str | None:
    """Try `library` with Dr.Jit in a child process. None is a success, which is cached per user until the library or
    Dr.Jit changes; else the problem."""
    if not library.is_file():
        return "no such file"
    key = _cache_key(library)
    if key in _read_cache():
        return None
    try:
        result = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env={**os.environ, _ENVIRONMENT: str(library)},
            capture_output=True,
            text=True,
            timeout=120,
        )
    except subprocess.TimeoutExpired:
        return "the probe did not end within 120 s"
    if result.returncode == 0 and _PROBE_ANSWER in result.stdout:
        _remember(key)
        return None
    if result.returncode < 0:
        return f"Dr.Jit ends the process with signal {-result.returncode}"
    lines = (result.stderr or result.stdout).strip().splitlines()
    return lines[-1] if lines else f"exit status {result.returncode}"


def usable_llvm() -> Path:
    """The best LLVM library that works.

    Raises:
        BackendError: no library works.
    """
    failures = []
    for library in find_llvm():
        problem = probe_llvm(library)
        if problem is None:
            return library
        failures.append(f"{library}: {problem}")
    if os.environ.get(_ENVIRONMENT):
        found = f"{_ENVIRONMENT} names a library that does not work ({failures[0]})."
    elif failures:
        found = "None of the LLVM libraries found works (" + "; ".join(failures) + ")."
    else:
        old = sorted({v for v in map(_version_of, _system_libraries()) if v is not None})
        found = f"No LLVM library of version {OLDEST_LLVM} or later was found" + (
            f" (only {', '.join(map(str, old))}, with which Dr.Jit aborts)." if old else "."
        )
    raise BackendError(f"Tracing on the CPU needs LLVM. {found} {_CURE}")


def _active_variant() -> str | None:
    if "mitsuba" not in sys.modules:
        return None
    import mitsuba

    return mitsuba.variant()


def _set_variant() -> str:
    cuda = has_cuda()
    if not cuda and not os.environ.get(_ENVIRONMENT):
        os.environ[_ENVIRONMENT] = str(usable_llvm())
    elif not cuda:
        usable_llvm()
    try:
        import mitsuba
    except ImportError as error:
        raise BackendError(f"Mitsuba cannot be imported ({error}): install `sionna-rt`.") from error
    try:
        mitsuba.set_variant(*(VARIANTS if cuda else VARIANTS[1:]))
    except ImportError as error:
        raise BackendError(f"Mitsuba offers none of {', '.join(VARIANTS)}: {error}. {_CURE}") from error
    variant = str(mitsuba.variant())
    if variant.startswith("llvm"):
        _check_loaded_llvm()
    return variant


def _check_loaded_llvm() -> None:
    """Refuse an LLVM that would abort the process: Dr.Jit prefers one that another library has loaded."""
    import drjit

    version = tuple(drjit.detail.llvm_version())
    if version and 0 < version[0] < OLDEST_LLVM:
        raise BackendError(
            f"Dr.Jit runs on LLVM {version[0]} in this process and would abort it. {_CURE} If another library or an "
            "earlier import of mitsuba or sionna.rt has loaded it, import rfgen_sionna's backend first."
        )


def has_cuda() -> bool:
    """Whether the CUDA driver is installed and has a device."""
    name = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
    try:
        driver = ctypes.CDLL(name)
    except OSError:
        return False
    count = ctypes.c_int(0)
    return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0


def _system_libraries() -> Iterable[Path]:
    search = os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep)
    folders = [Path(sys.prefix) / "lib", *(Path(entry) for entry in search if entry)]
    for root in ("/usr/lib", "/usr/lib64", "/usr/local/lib", "/lib", "/usr/lib/wsl/lib"):
        folders += [Path(root), *sorted(Path(root).glob("*-linux-gnu*"))]
    for pattern in ("/usr/lib/llvm*/lib", "/usr/lib64/llvm*/lib64", "/opt/homebrew/opt/llvm*/lib"):
        folders += sorted(Path("/").glob(pattern.lstrip("/")))
    folders += sorted(Path("/usr/local/opt").glob("llvm*/lib"))
    for folder in dict.fromkeys(folders):
        for pattern in ("libLLVM*.so*", "libLLVM*.dylib", "LLVM-C.dll"):
            yield from sorted(folder.glob(pattern))


def _version_of(path: Path) -> int | None:
    """Major version in the name of the file or of its folder; None without one."""
    for text in (path.resolve().name, path.name, str(path.resolve().parent)):
        match = re.search(r"(?:libLLVM[-.](?:so\.)?|llvm[-@]?)(\d+)", text)
        if match:
            return int(match[1])
    return None


def _preference(version: int) -> int:
    """Sort key: the tested version, newer ones in order, older ones last."""
    return version - PREFERRED_LLVM if version >= PREFERRED_LLVM else 1000 - version


def _cache_file() -> Path:
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", "~/AppData/Local"))
    elif sys.platform == "darwin":
        base = Path("~/Library/Caches")
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    return base.expanduser() / "rfgen_sionna" / "llvm-probe.json"


def _cache_key(library: Path) -> str:
    stat = library.stat()
    try:
        drjit = metadata.version("drjit")
    except metadata.PackageNotFoundError:
        drjit = "none"
    return f"{library.resolve()}|{stat.st_mtime_ns}|{stat.st_size}|drjit {drjit}"


def _read_cache() -> list[str]:
    try:
        content = json.loads(_cache_file().read_text())
    except (OSError, ValueError):
        return []
    return [str(key) for key in content] if isinstance(content, list) else []


def _remember(key: str) -> None:
    """Add `key` to the cache; a read-only folder only costs the next process another try."""
    file = _cache_file()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps([*_read_cache()[-15:], key]))
        partial.replace(file)
    except OSError:
        return


def main() -> int:
    """Print the variant and return 0, or print the cure and return 1."""
    try:
        variant = ensure_backend()
    except BackendError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    library = f", LLVM {os.environ.get(_ENVIRONMENT)}" if variant.startswith("llvm") else ""
    sys.stdout.write(f"Mitsuba variant {variant}{library}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
