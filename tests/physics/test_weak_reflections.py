"""Of what a static scene's parts show of one another, what returns next to nothing is left out, and no more."""

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import load_scene, tabulated
from rfgen_sionna.tracing.static import static_reflections as static_bounces
from rfgen_sionna.tracing.tracer import Tracer
from tests.physics.test_ghosts import channel

SCENE = """<scene version="2.1.0">
    <bsdf type="itu-radio-material" id="mat-metal">
        <string name="type" value="metal"/><float name="thickness" value="0.01"/>
    </bsdf>
    <shape type="rectangle" id="wall">
        <transform name="to_world">
            <scale x="1.5" y="1"/><rotate y="1" angle="-90"/><translate x="4" y="2" z="1"/>
        </transform>
        <ref id="mat-metal" name="bsdf"/>
    </shape>
    {plates}
</scene>"""
SHAPE = """<shape type="obj" id="{name}"><string name="filename" value="{name}.obj"/>
    <boolean name="face_normals" value="true"/><ref id="mat-metal" name="bsdf"/></shape>"""


def dihedral(folder, cells, size=0.1):
    """A metal dihedral of so many cells along each edge, open to the radar, turned by four degrees, beside a wall."""
    step = size / cells
    first, second = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (0.77 * np.pi, 1.27 * np.pi))
    for name, along in (("left", first), ("right", second)):
        corner = [3.0, 0.0, 1.0 - 0.5 * size]
        rows = [
            corner + i * step * along + j * step * np.array([0, 0, 1.0])
            for i in range(cells + 1)
            for j in range(cells + 1)
        ]
        lines = ["v " + " ".join(f"{value:.9f}" for value in row) for row in rows]
        for i in range(cells):
            for j in range(cells):
                a = i * (cells + 1) + j + 1
                b, c, d = a + cells + 1, a + cells + 2, a + 1
                lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
        (folder / f"{name}.obj").write_text("\n".join(lines))
    file = folder / "scene.xml"
    file.write_text(SCENE.format(plates="".join(SHAPE.format(name=name) for name in ("left", "right"))))
    return load_scene(str(file))


def traced(scene, radar, rtol):
    tracer = Tracer(scene, radar, [], rtol, max_bounces=2)
    return tracer.static.level, tracer.static_indirect[0].paths


def test_a_fine_mesh_s_faces_are_faint_only_by_themselves(tmp_path, monkeypatch):
    """Of a dihedral in 20,000 faces none returns as much as may be left out, and all of them in phase six times what
    everything returns directly. Of their edges, and of what the wall shows of them, something is left out."""
    radar = Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))
    scene, allowed = dihedral(tmp_path, 100), static_bounces.NEGLIGIBLE * 1e-2
    level, found = traced(scene, radar, 1e-2)
    assert np.abs(found.a[0, 0, :, 0]).max() < allowed * level
    monkeypatch.setattr(static_bounces, "NEGLIGIBLE", 0.0)
    _, whole = traced(scene, radar, 1e-2)
    one, other = channel(found), channel(whole)
    assert np.abs(other).min() > level
    assert np.abs(one - other).max() < allowed * level


@pytest.mark.slow
def test_what_is_left_out_is_less_than_allowed(monkeypatch):
    """A furnished room: a third of the paths are left, and what they return differs by less than twice what is stated
    of it for any pair, in the middle of the band."""
    isotropic = {"pattern": {"kind": "sionna:iso"}}
    radar = tabulated(Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1), overrides=isotropic))
    scene, allowed = load_scene("living_room"), static_bounces.NEGLIGIBLE * 3e-2
    level, found = traced(scene, radar, 3e-2)
    monkeypatch.setattr(static_bounces, "NEGLIGIBLE", 0.0)
    _, whole = traced(scene, radar, 3e-2)
    assert found.num_paths < 0.4 * whole.num_paths
    missed = np.abs(channel(found) - channel(whole))
    assert np.sqrt((missed**2).mean()) < allowed * level
    assert missed.max() < 2 * allowed * level
