"""The set-up script does what is missing, in order, and says clearly what it may not do."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def bootstrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, with a folder of its own instead of the checkout's `.venv`."""
    spec = importlib.util.spec_from_file_location("bootstrap", ROOT / "bootstrap.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "VENV", tmp_path / ".venv")
    return module


class Machine:
    """Stands for the machine: records commands, and answers the probe and apt-get as told."""

    def __init__(self, bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, **facts: object) -> None:
        self.facts = {"llvm": False, "apt": True, "root": True, "sudo": False, "package": True} | facts
        self.commands: list[str] = []
        monkeypatch.setattr(bootstrap, "probe", lambda: None if self.facts["llvm"] else "Tracing needs LLVM 19.")
        monkeypatch.setattr(bootstrap.os, "geteuid", lambda: 0 if self.facts["root"] else 1000)
        present = {"apt-get": self.facts["apt"], "sudo": True}
        monkeypatch.setattr(bootstrap.shutil, "which", lambda name: f"/bin/{name}" if present[name] else None)
        monkeypatch.setattr(bootstrap.subprocess, "run", self.sudo)
        monkeypatch.setattr(bootstrap.Step, "run", self.step(bootstrap))

    def sudo(self, command: list[str], **_: object) -> SimpleNamespace:
        assert command == ["sudo", "-n", "true"]
        return SimpleNamespace(returncode=0 if self.facts["sudo"] else 1)

    def step(self, bootstrap: ModuleType):
        def run(_: object, command: list[str], check: bool = True) -> None:
            self.commands.append(" ".join(command))
            if "install" in command:
                if not self.facts["package"] and check:
                    raise bootstrap.SetupError("Unable to locate package libllvm19")
                self.facts["llvm"] = True

        return run


def test_a_usable_llvm_is_left_alone(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(bootstrap, monkeypatch, llvm=True)
    bootstrap.ensure_llvm()
    assert machine.commands == []


def test_root_installs_llvm_19_after_refreshing_the_lists(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(bootstrap, monkeypatch)
    bootstrap.ensure_llvm()
    update, install = machine.commands
    assert update.endswith("apt-get update")
    assert install.endswith("apt-get install --yes --no-install-recommends libllvm19")
    assert "sudo" not in install


def test_a_sudo_without_password_will_do(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(bootstrap, monkeypatch, root=False, sudo=True)
    bootstrap.ensure_llvm()
    assert all(command.startswith("sudo -n ") for command in machine.commands)


@pytest.mark.parametrize(
    ("facts", "reason"),
    [
        ({"root": False}, "neither as root nor with a sudo"),
        ({"apt": False}, "apt-get only"),
        ({"package": False}, "Unable to locate package libllvm19"),
    ],
)
def test_where_llvm_may_not_be_installed_one_message_says_why_and_what_to_do(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, facts: dict, reason: str
) -> None:
    Machine(bootstrap, monkeypatch, **facts)
    with pytest.raises(bootstrap.SetupError) as caught:
        bootstrap.ensure_llvm()
    assert "Tracing needs LLVM 19." in str(caught.value)
    assert reason in str(caught.value)


def test_the_probe_is_the_packages_own_and_passes_its_message_on(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With a real child process: a library that is none is refused with the cure, not with an abort."""
    fake = tmp_path / "libLLVM-19.so"
    fake.write_bytes(b"not a library")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(fake))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(bootstrap, "executable", lambda name: {"python": sys.executable}[name])
    message = bootstrap.probe()
    if message is None:
        pytest.skip("this machine traces on a GPU")
    assert "libllvm19" in message
    assert "DRJIT_LIBLLVM_PATH" in message
    assert "brew install llvm@19" in message
    assert "conda" in message


def test_packages_are_installed_once_and_again_when_the_recipe_changes(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(bootstrap.Step, "run", lambda _, command, check=True: commands.append(command))
    bootstrap.VENV.mkdir()
    bootstrap.install_packages("people")
    bootstrap.install_packages("people")
    assert len(commands) == 1
    assert commands[0][-1] == f"{bootstrap.ROOT}[people]"
    assert str(bootstrap.CONSTRAINTS) in commands[0]
    bootstrap.install_packages("dev")
    assert commands[1][-1].endswith("[dev]")
    bootstrap.install_packages("people")
    assert len(commands) == 2, "dev holds people"
    other = tmp_path / "constraints.txt"
    other.write_text("torch==0\n")
    monkeypatch.setattr(bootstrap, "CONSTRAINTS", other)
    bootstrap.install_packages("people")
    assert len(commands) == 3


def test_an_interrupted_installation_is_not_taken_for_a_finished_one(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    bootstrap.VENV.mkdir()
    monkeypatch.setattr(bootstrap.Step, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bootstrap.install_packages("people")
    assert list(bootstrap.VENV.iterdir()) == []


def test_an_environment_from_elsewhere_is_not_used(bootstrap: ModuleType) -> None:
    bootstrap.VENV.mkdir()
    (bootstrap.VENV / "pyvenv.cfg").write_text("command = python -m venv /somewhere/else/.venv\n")
    assert not bootstrap.environment_works()


def test_an_old_python_gets_a_sentence(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bootstrap.sys, "version_info", (3, 9, 2))
    assert bootstrap.main(["demo"]) == 2
    assert "this is Python 3.9, and 3.11 or later is needed" in capsys.readouterr().err


def test_the_script_is_readable_to_an_old_python() -> None:
    ast.parse((ROOT / "bootstrap.py").read_text(), feature_version=(3, 7))


def test_unknown_commands_are_refused(bootstrap: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert bootstrap.main(["tests"]) == 2
    assert "setup, demo, test" in capsys.readouterr().err


def test_the_demo_never_writes_over_an_earlier_one(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    calls: list[list[str]] = []
    monkeypatch.setattr(bootstrap.subprocess, "call", lambda command: calls.append(command) or 0)
    bootstrap.run_demo([])
    (tmp_path / "jacks.png").touch()
    (tmp_path / "jacks-2.h5").touch()
    bootstrap.run_demo(["--duration", "1"])
    bootstrap.run_demo(["--output", "mine.h5"])
    assert calls[0][-2:] == ["--output", "jacks.h5"]
    assert calls[1][-4:] == ["--duration", "1", "--output", "jacks-3.h5"]
    assert calls[2].count("--output") == 1


def test_the_demo_is_a_command_that_the_command_line_knows(bootstrap: ModuleType) -> None:
    import typer

    from rfgen_sionna.cli import app

    generate = typer.main.get_command(app).commands["generate"]
    known = {option for parameter in generate.params for option in parameter.opts}
    assert {word for word in bootstrap.DEMO if word.startswith("--")} <= known


def test_checks_go_on_after_a_failure_and_report_it(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[list[str]] = []

    def call(command: list[str], **_: object) -> int:
        calls.append(command)
        return 1 if command[0].endswith("mypy") else 0

    monkeypatch.setattr(bootstrap.subprocess, "call", call)
    assert bootstrap.run_checks(["-k", "radar"]) == 1
    assert [Path(command[0]).name for command in calls] == ["ruff", "mypy", "lint-imports", "pytest"]
    assert calls[-1][-2:] == ["-k", "radar"]
    assert re.search(r"mypy +FAILED", capsys.readouterr().out)


def test_a_failing_step_shows_the_end_of_its_output(bootstrap: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(bootstrap.SetupError, match=r"exit status 3.*\n.*the reason"), bootstrap.Step("step") as step:
        step.run([sys.executable, "-c", "print('the reason'); raise SystemExit(3)"])
    assert "step ... failed" in capsys.readouterr().out


def test_readme_and_ci_use_the_same_commands() -> None:
    readme = (ROOT / "README.md").read_text()
    ci = (ROOT / ".ci" / "run").read_text()
    for command in ("demo", "test"):
        assert f"python3 bootstrap.py {command}\n" in readme
    assert "python3 bootstrap.py test" in ci
    subprocess.run(["bash", "-n", str(ROOT / ".ci" / "run")], check=True)


def test_every_link_in_the_readme_leads_somewhere() -> None:
    readme = (ROOT / "README.md").read_text()
    links = re.findall(r"\]\((?!https?://|#)([^)]+)\)", readme)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []
