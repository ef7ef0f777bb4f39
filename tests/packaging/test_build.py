"""Wheel, source distribution, editable installation and bare tree all find the radars and scenes."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIND = (
    "from rfgen_sionna.resources import available, resolve;"
    "print(*available('radars'), *available('scenes'), resolve('scenes', 'living_room'), sep='\\n')"
)


def tracked(*folders: str) -> set[str]:
    """Paths of the files that git knows in these folders."""
    result = subprocess.run(["git", "ls-files", "-z", *folders], cwd=ROOT, capture_output=True, text=True, check=False)
    files = {name for name in result.stdout.split("\0") if name}
    if not files:  # an unpacked source distribution
        files = {str(p.relative_to(ROOT)) for f in folders for p in (ROOT / f).rglob("*") if p.is_file()}
    return {name for name in files if (ROOT / name).exists()}


def build(kind: str, source: Path, target: Path) -> Path:
    """Build `kind` ("wheel" or "sdist") of `source` with the build back end itself, without network."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(target)]
    subprocess.run(command, cwd=source, check=True, capture_output=True, text=True)
    return next(iter(target.glob("*.whl" if kind == "wheel" else "*.tar.gz")))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


def expected() -> set[str]:
    names = set()
    for name in tracked("rfgen_sionna", "radars", "scenes"):
        folder = name.partition("/")[0]
        names.add(name if folder == "rfgen_sionna" else f"rfgen_sionna/_data/{name}")
    return names


def contents(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def test_a_wheel_holds_the_package_with_its_radars_and_scenes(wheel: Path) -> None:
    held = contents(wheel)
    assert expected() <= held
    assert "rfgen_sionna/_data/radars/awr1843.toml" in held
    assert "rfgen_sionna/_data/scenes/living_room/scene.xml" in held
    assert "rfgen_sionna/py.typed" in held
    assert not [name for name in held if not name.startswith("rfgen_sionna/")]


def test_a_wheel_holds_no_training_code(wheel: Path) -> None:
    assert tracked("training")
    held = contents(wheel)
    assert not [name for name in held if name.startswith(("training/", "tests/", "rfgen_sionna/training/"))]
    with zipfile.ZipFile(wheel) as archive:
        code = [archive.read(name).decode() for name in held if name.endswith(".py")]
    assert not [text for text in code if re.search(r"^\s*(?:from|import) training\b", text, re.MULTILINE)]


def test_a_wheel_carries_the_licence(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        licence = next(name for name in archive.namelist() if name.endswith("licenses/LICENSE"))
        assert "Apache License" in archive.read(licence).decode()
        metadata = archive.read(next(name for name in archive.namelist() if name.endswith("METADATA"))).decode()
    assert "License-Expression: Apache-2.0" in metadata
    assert "Requires-Python: >=3.11" in metadata


def test_a_wheel_from_a_source_distribution_is_the_same(wheel: Path, tmp_path: Path) -> None:
    with tarfile.open(build("sdist", ROOT, tmp_path)) as archive:
        # Python before 3.11.4 has no filters.
        archive.extractall(tmp_path, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    source = next(path for path in tmp_path.iterdir() if path.is_dir())
    assert (source / "bootstrap.py").exists()
    assert contents(build("wheel", source, tmp_path / "again")) == contents(wheel)


def find_from(path: Path) -> list[str]:
    """What the resolver finds when the package is imported from `path` alone."""
    code = f"import sys; sys.path.insert(0, {str(path)!r}); {FIND}"
    result = subprocess.run([sys.executable, "-c", code], cwd=path.parent, capture_output=True, text=True, check=True)
    return result.stdout.splitlines()


def test_radars_and_scenes_are_found_in_an_unpacked_wheel(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    *names, scene = find_from(site)
    assert {"awr1843", "living_room"} <= set(names)
    assert Path(scene) == site / "rfgen_sionna" / "_data" / "scenes" / "living_room" / "scene.xml"
    assert Path(scene).is_file()


def test_radars_and_scenes_are_found_in_a_bare_tree() -> None:
    *names, scene = find_from(ROOT)
    assert {"awr1843", "living_room"} <= set(names)
    assert Path(scene) == ROOT / "scenes" / "living_room" / "scene.xml"


def test_an_editable_installation_points_at_the_checkout(tmp_path: Path) -> None:
    with zipfile.ZipFile(editable_wheel(tmp_path)) as archive:
        links = [archive.read(name).decode() for name in archive.namelist() if name.endswith(".pth")]
    assert [line for text in links for line in text.splitlines()] == [str(ROOT)]


def editable_wheel(target: Path) -> Path:
    code = "import sys; from hatchling.build import build_editable; print(build_editable(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(target)], cwd=ROOT, check=True, capture_output=True)
    return next(target.glob("*.whl"))
