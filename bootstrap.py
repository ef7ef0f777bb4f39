#!/usr/bin/env python3
"""From a bare clone to a result, with nothing but Python 3.11 or later.

    python3 bootstrap.py demo [OPTIONS OF rfgen generate]   radar data and pictures of a person doing jumping jacks
    python3 bootstrap.py test [OPTIONS OF pytest]           every check and test of the project
    python3 bootstrap.py setup                              only the set-up: .venv with everything in it, and LLVM

Each sets up what is missing first: a virtual environment in `.venv` next to this file, the dependencies, and the
LLVM library that ray tracing on a CPU needs. What is already there is left alone, so each may be run again.
"""

# Runs on whatever `python3` is, so that an old one gets a sentence and not a syntax error: no new syntax here.
import hashlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

OLDEST_PYTHON = (3, 11)
ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
CONSTRAINTS = ROOT / "constraints.txt"
EXTRAS = {"setup": "people", "demo": "people", "test": "dev"}
PROMPT = "a person doing jumping jacks"
DEMO = ["--environment", "living_room", "--radar", "awr1843", "--preset", "mmmesh"]
DEMO += ["--duration", "3", "--seed", "0"]
CHECKS = {
    "ruff": ["ruff", "check", "."],
    "mypy": ["mypy"],
    "import-linter": ["lint-imports"],
    "pytest": ["pytest", "--numprocesses", "auto", "--maxprocesses", "4", "--dist", "loadfile"],
}


class SetupError(Exception):
    """The set-up cannot go on; the text says what to do."""


def main(arguments):
    if sys.version_info < OLDEST_PYTHON:
        print(
            f"bootstrap: this is Python {sys.version_info[0]}.{sys.version_info[1]}, and 3.11 or later is needed. "
            f"Run it with another one, for example\n    python3.12 bootstrap.py {' '.join(arguments) or 'demo'}",
            file=sys.stderr,
        )
        return 2
    command, rest = (arguments[0], arguments[1:]) if arguments else ("--help", [])
    if command in ("-h", "--help"):
        print(__doc__.strip())
        return 0
    if command not in EXTRAS:
        print("bootstrap: unknown command {!r}; known: {}".format(command, ", ".join(EXTRAS)), file=sys.stderr)
        return 2
    try:
        create_environment()
        install_packages(EXTRAS[command])
        ensure_llvm()
        prepare_bodies()
        if command == "demo":
            return run_demo(rest)
        if command == "test":
            return run_checks(rest)
    except SetupError as error:
        print(f"\nbootstrap: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nbootstrap: interrupted; running it again goes on from here", file=sys.stderr)
        return 130
    return 0


def create_environment():
    """A virtual environment with pip in `.venv`, unless there is one that works."""
    if environment_works():
        return
    try:
        import ensurepip  # noqa: F401
    except ImportError:
        package = "python{}.{}-venv".format(*sys.version_info[:2])
        problem = install_system_package(package)
        if problem:
            raise SetupError(
                f"Python's venv module is incomplete here (no ensurepip). {problem}\n"
                f"On Debian and Ubuntu: apt-get install {package}"
            ) from None
    with Step("virtual environment in .venv") as step:
        shutil.rmtree(str(VENV), ignore_errors=True)
        step.run([sys.executable, "-m", "venv", str(VENV)])


def environment_works():
    """Whether `.venv` was made here (a moved checkout breaks its scripts) and its Python starts and knows pip."""
    try:
        made_here = str(VENV) in (VENV / "pyvenv.cfg").read_text()
        return (
            made_here
            and subprocess.run([executable("python"), "-c", "import pip"], capture_output=True).returncode == 0
        )
    except OSError:
        return False


def install_packages(extra):
    """The package, editable, with its dependencies, unless exactly that has been done before."""
    stamp = VENV / "rfgen-setup"
    recipe = (ROOT / "pyproject.toml").read_bytes() + CONSTRAINTS.read_bytes() + str(ROOT).encode()
    digest = hashlib.sha256(recipe).hexdigest()
    satisfied = {f"{digest} {extra}", f"{digest} dev"}  # `dev` holds all the others
    if stamp.exists() and stamp.read_text() in satisfied:
        return
    with Step("dependencies (a few minutes, once)") as step:
        pip = [executable("python"), "-m", "pip", "install", "--disable-pip-version-check"]
        step.run([*pip, "--constraint", str(CONSTRAINTS), "--editable", f"{ROOT}[{extra}]"])
    stamp.write_text(f"{digest} {extra}")


def ensure_llvm():
    """An LLVM that Dr.Jit runs on; the package itself knows how to tell, by a probe in a child process."""
    if probe() is None:
        return
    problem = install_system_package("libllvm19")
    cure = probe()
    if cure is not None:
        raise SetupError(cure + ("\n" + problem if problem else ""))


def prepare_bodies():
    """The body model's cache in the user's home, which its first start builds."""
    stamp = VENV / "rfgen-bodies"
    if stamp.exists():
        return
    with Step("body model (0.8 GB of cache, once)") as step:
        load = "from rfgen_sionna.generative.bodies.anny_rig import load_model; load_model()"
        step.run([executable("python"), "-c", load])
    stamp.touch()


def probe():
    """None where the ray tracing back end works, else what the package says about it."""
    result = subprocess.run(
        [executable("python"), "-m", "rfgen_sionna.scene.mitsuba_backend"],
        capture_output=True,
        text=True,
        cwd=str(ROOT),
    )
    return None if result.returncode == 0 else (result.stderr or result.stdout).strip()


def install_system_package(package):
    """Install a Debian package where that is allowed; returns None on success, else why not."""
    if shutil.which("apt-get") is None:
        return "(bootstrap installs system packages by apt-get only, which is not here.)"
    if os.geteuid() == 0:
        prefix = []
    elif shutil.which("sudo") and subprocess.run(["sudo", "-n", "true"], capture_output=True).returncode == 0:
        prefix = ["sudo", "-n"]
    else:
        return "(bootstrap may not install it: it runs neither as root nor with a sudo that asks no password.)"
    prefix += ["env", "DEBIAN_FRONTEND=noninteractive"]
    try:
        with Step(f"{package} by apt-get") as step:
            # A broken third-party source must not stop an installation from the others.
            step.run([*prefix, "apt-get", "update"], check=False)
            step.run([*prefix, "apt-get", "install", "--yes", "--no-install-recommends", package])
    except SetupError as error:
        return f"(apt-get could not install {package}: {error})"
    return None


def run_demo(options):
    """The main job: data and pictures in the current folder, under a name that is still free."""
    if "--output" not in options and not any(option.startswith("--output=") for option in options):
        options = [*options, "--output", free_name("jacks", ".h5")]
    return subprocess.call([executable("rfgen"), "generate", PROMPT, *DEMO, *options])


def free_name(stem, suffix):
    number = 1
    while True:
        name = "{}{}".format(stem, "" if number == 1 else f"-{number}")
        if not list(Path.cwd().glob(name + ".*")):
            return name + suffix
        number += 1


def run_checks(options):
    """Every check, also after one has failed; the last lines say how each ended."""
    results = {}
    for name, command in CHECKS.items():
        print(f"\n== {name}", flush=True)
        start = time.monotonic()
        code = subprocess.call(
            [executable(command[0]), *command[1:], *(options if name == "pytest" else [])], cwd=str(ROOT)
        )
        results[name] = (code, time.monotonic() - start)
    print()
    for name, (code, seconds) in results.items():
        print("{:<14} {:<7} {:6.1f} s".format(name, "ok" if code == 0 else "FAILED", seconds))
    return int(any(code for code, _ in results.values()))


def executable(name):
    folder, suffix = ("Scripts", ".exe") if os.name == "nt" else ("bin", "")
    return str(VENV / folder / (name + suffix))


class Step:
    """One step of the set-up: a line with its name and how long it took, its output only where it fails."""

    def __init__(self, name):
        self.name = name

    def __enter__(self):
        self.start = time.monotonic()
        print(f"{self.name} ...", end="", flush=True)
        return self

    def run(self, command, check=True):
        output = []
        shown = time.monotonic()
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=str(ROOT)
        ) as process:
            for line in process.stdout:
                output.append(line.rstrip())
                if time.monotonic() - shown > 15:
                    shown = time.monotonic()
                    print(f" {shown - self.start:.0f} s ...", end="", flush=True)
        if process.returncode != 0 and check:
            raise SetupError(
                "`{}` failed (exit status {}):\n{}".format(
                    " ".join(command), process.returncode, "\n".join("    " + line for line in output[-15:])
                )
            )

    def __exit__(self, kind, error, trace):
        print(" {} ({:.0f} s)".format("done" if kind is None else "failed", time.monotonic() - self.start), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
