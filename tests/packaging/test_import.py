"""Importing the package is quick and brings no tracer and no learning framework along."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import rfgen_sionna

PACKAGE = Path(rfgen_sionna.__file__).parent
HEAVY = {"torch", "anny", "diffusers", "transformers", "mitsuba", "drjit", "sionna", "matplotlib", "numba"}


def modules_after(code: str) -> set[str]:
    """Top-level names in `sys.modules` of a fresh interpreter after `code`."""
    code += "\nimport json, sys; print(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(result.stdout.splitlines()[-1]))


def test_importing_the_package_imports_nothing_heavy() -> None:
    assert not modules_after("import rfgen_sionna") & (HEAVY | {"numpy", "scipy", "h5py"})


def test_importing_a_subpackage_imports_no_tracer_and_no_framework() -> None:
    """All of them in one interpreter, which notes after each what it brought along."""
    names = [*sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py")), "records", "resources", "cli"]
    code = f"""
import importlib, json, sys
heavy = {HEAVY - {"matplotlib"}!r}
brought = {{}}
for name in {[*names, "simulation"]!r}:
    before = set(sys.modules)
    importlib.import_module("rfgen_sionna." + name)
    brought[name] = sorted((set(sys.modules) - before) & heavy)
print(json.dumps(brought))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    brought = json.loads(result.stdout)
    assert len(brought) > 10
    assert not {name: modules for name, modules in brought.items() if modules}


def test_a_radar_needs_no_tracer() -> None:
    assert not modules_after("import rfgen_sionna; rfgen_sionna.Radar.load('awr1843')") & HEAVY


@pytest.mark.parametrize("name", rfgen_sionna.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name: str) -> None:
    value = getattr(rfgen_sionna, name)
    assert value if name == "__version__" else value.__doc__


def test_public_names_are_listed_and_others_refused() -> None:
    assert set(rfgen_sionna.__all__) <= set(dir(rfgen_sionna))
    with pytest.raises(AttributeError, match="'rfgen_sionna' has no attribute 'Rader'"):
        _ = rfgen_sionna.Rader


def test_type_checkers_see_the_names_that_are_loaded_lazily() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    seen = {alias.asname for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert set(rfgen_sionna.__all__) - {"__version__"} <= seen


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_module_imports_the_package_root(path: Path) -> None:
    """It would tie every module to every other; import-linter doesn't see it, since the root holds them all."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            assert "rfgen_sionna" not in {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "rfgen_sionna":
            modules = {p.stem for p in PACKAGE.glob("*.py")} | {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
            assert {alias.name for alias in node.names} <= modules


def test_a_simulation_without_a_prompt_needs_no_torch():
    """Torch and the body model are blocked; a metal ball is traced, imaged and sampled all the same."""
    program = """
import sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("torch", "anny", "diffusers", "transformers"):
            raise ImportError(name + " is blocked")

sys.meta_path.insert(0, Block())
import trimesh
import rfgen_sionna as rfgen

radar = rfgen.Radar.load("awr1843", "di_gesture", position=(0, 0, 1), look_at=(3, 0, 1))
mesh = trimesh.creation.icosphere(2, 0.1)
ball = rfgen.Actor.from_mesh(mesh, material="metal", position=(2, 0, 1), velocity=(1, 0, 0))
sim = rfgen.Simulator(None, radar, [ball], rtol=1e-2)
print(sim.adc(0.05).data.shape, sim.paths(0.01).num_paths > 0, sim.pir(0.0, (16, 16)).energy.max() > 0)
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split("\n")[0] == "(1, 64, 2, 4, 128) True True"


def imports_of(path: Path, modules: set[str]) -> set[str]:
    """Modules of the package that a file imports anywhere, under TYPE_CHECKING as well."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: relative import"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= names & modules or {str(node.module)}
    return found & modules


def test_no_import_circles() -> None:
    paths = {path.relative_to(PACKAGE.parent).with_suffix(""): path for path in PACKAGE.rglob("*.py")}
    named = {".".join(parts.parts).removesuffix(".__init__"): path for parts, path in paths.items()}
    del named["rfgen_sionna"]  # it names all others for type checkers, and none of them imports it
    sorter = TopologicalSorter({name: imports_of(path, set(named)) - {name} for name, path in named.items()})
    try:
        sorter.prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))
