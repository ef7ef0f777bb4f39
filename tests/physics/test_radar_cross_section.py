"""Radar cross-sections in one call, against closed forms of physical and geometrical optics."""

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.scene import MATERIALS

FREQUENCY = 77e9
WAVELENGTH = 299792458.0 / FREQUENCY
SIDE = 0.1
"""Edge of plates and corners [m]."""
PLATE = trimesh.Trimesh(
    0.5 * SIDE * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]), [[0, 1, 2], [0, 2, 3]], process=False
)
"""Square that faces +x."""
SPECULAR = 4 * np.pi * SIDE**4 / WAVELENGTH**2
"""Cross-section of a square along its normal [m^2]."""


def dihedral():
    """Two squares that meet at 90° along z and open towards +x."""
    one = SIDE * np.array([np.sqrt(0.5), np.sqrt(0.5), 0])
    other, up = one * [1, -1, 1], np.array([0, 0, 0.5 * SIDE])
    vertices = np.array([-up, up, one - up, one + up, other - up, other + up])
    return trimesh.Trimesh(vertices, [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]], process=False)


def trihedral():
    """Three triangles with legs along the axes."""
    return trimesh.Trimesh([[0, 0, 0], *(SIDE * np.eye(3))], [[0, 1, 2], [0, 2, 3], [0, 3, 1]], process=False)


def test_lobes_of_a_plate():
    """Main lobe, first null and sidelobes: 4 pi A^2 / lambda^2 cos^2 sinc^2, also off the middle of the mesh."""
    degrees = np.array([0.0, 0.4, 0.9, 1.6, 2.8])
    found = rfgen.rcs(PLATE, FREQUENCY, degrees, material="pec")
    phase = 2 * np.pi * SIDE / WAVELENGTH * np.sin(np.radians(degrees))
    exact = SPECULAR * np.cos(np.radians(degrees)) ** 2 * np.sinc(phase / np.pi) ** 2
    np.testing.assert_allclose(found.rcs, exact, rtol=0.02, atol=1e-4 * SPECULAR)
    np.testing.assert_allclose(found.dbsm, 10 * np.log10(found.rcs))
    assert (np.abs(found.rcs - exact) < found.error * exact + 1e-4 * SPECULAR).all()
    away = PLATE.copy()
    away.apply_translation((0.3, 0.2, 0.1))
    moved = rfgen.rcs(away, FREQUENCY, degrees, material="pec")
    np.testing.assert_allclose(moved.rcs, found.rcs, rtol=1e-3)
    wavenumber = 2 * np.pi / WAVELENGTH
    path = 0.3 * np.cos(np.radians(degrees)) + 0.2 * np.sin(np.radians(degrees))
    turned = moved.amplitude / found.amplitude * np.exp(-2j * wavenumber * path)
    np.testing.assert_allclose(turned, 1.0, atol=0.02)


def test_sphere_from_any_side():
    """pi a^2, as the error says."""
    radius = 0.04
    ball = trimesh.creation.icosphere(4, radius)
    found = rfgen.rcs(ball, FREQUENCY, [0.0, 40.0], [0.0, 25.0], material="pec")
    missed = np.abs(found.rcs / (np.pi * radius**2) - 1)
    assert (missed < found.error).all()
    assert (found.error < 0.1).all()


@pytest.mark.parametrize("polarization", ["VV", pytest.param("HH", marks=pytest.mark.slow)])
def test_dihedral(polarization):
    """8 pi a^2 b^2 / lambda^2 by two reflections, of which single ones have next to nothing."""
    found = rfgen.rcs(dihedral(), FREQUENCY, material="pec", max_bounces=2, polarization=polarization)
    exact = 8 * np.pi * SIDE**4 / WAVELENGTH**2
    assert abs(found.rcs / exact - 1) < min(float(found.error), 0.05)
    single = rfgen.rcs(dihedral(), FREQUENCY, material="pec", polarization=polarization)
    assert single.rcs < 0.01 * exact


def test_trihedral():
    """4 pi L^4 / (3 lambda^2) along its axis, by three reflections."""
    axis = float(np.degrees(np.arctan(np.sqrt(0.5))))
    found = rfgen.rcs(trihedral(), FREQUENCY, 45.0, axis, material="pec", max_bounces=3)
    assert abs(found.rcs / (4 * np.pi * SIDE**4 / (3 * WAVELENGTH**2)) - 1) < 0.03


def test_bistatic_plate_of_a_dielectric():
    """Its specular lobe is that of a conductor times Fresnel's reflectance of the polarisation."""
    angle, permittivity = np.radians(40.0), 4.0
    resin = rfgen.material("resin", permittivity=permittivity)
    cos, root = np.cos(angle), np.sqrt(permittivity - np.sin(angle) ** 2)
    fresnel = {"VV": (cos - root) / (cos + root), "HH": (permittivity * cos - root) / (permittivity * cos + root)}
    for polarization, coefficient in fresnel.items():
        given = {"material": resin, "incident": (40.0, 0.0), "polarization": polarization}
        found = rfgen.rcs(PLATE, FREQUENCY, [-40.0, -37.0], **given)
        assert found.rcs[0] == pytest.approx(SPECULAR * cos**2 * coefficient**2, rel=1e-3)
        assert found.rcs[1] < 0.02 * found.rcs[0]
    normal = rfgen.rcs(PLATE, FREQUENCY, material=resin)
    assert normal.rcs == pytest.approx(SPECULAR / 9.0, rel=0.01)


def test_a_file_gives_its_materials(tmp_path):
    """A pane named so returns the power of glass; a plate without a known name is metal."""
    eps = complex(MATERIALS["glass"].relative_permittivity(FREQUENCY))
    shares = {"Glass.001": abs((1 - np.sqrt(eps)) / (1 + np.sqrt(eps))) ** 2, "Material.001": 1.0}
    for name, share in shares.items():
        pane = trimesh.Trimesh(PLATE.vertices, PLATE.faces)
        pane.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name))
        pane.export(tmp_path / "pane.glb")  # y up: +x of the file is the left
        found = rfgen.rcs(tmp_path / "pane.glb", FREQUENCY, 90.0)
        assert found.rcs == pytest.approx(share * SPECULAR, rel=0.01)
    actor = rfgen.Actor.from_mesh(PLATE, material="glass")
    with pytest.raises(ValueError, match="material is 'metal': the actor 'mesh' has its own"):
        rfgen.rcs(actor, FREQUENCY, material="metal")


def test_bistatic_of_one_direction_is_monostatic():
    """Cross-section and phase, by two independent ways."""
    box = trimesh.creation.box((0.05, 0.08, 0.06))
    alone = rfgen.rcs(box, FREQUENCY, 12.0, 7.0, material="pec")
    both = rfgen.rcs(box, FREQUENCY, 12.0, 7.0, material="pec", incident=(12.0, 7.0))
    np.testing.assert_allclose(both.amplitude, alone.amplitude, rtol=0.03)


def test_actors_and_records():
    """An actor's shape and material count, not its place; the record prints in a line or two."""
    actor = rfgen.Actor.from_mesh(PLATE, material="pec", position=(3, 1, 1), orientation=(0.4, 0, 0), name="plate")
    found = rfgen.rcs(actor, FREQUENCY, np.linspace(-1, 1, 3))
    assert found.rcs[1] == pytest.approx(SPECULAR, rel=1e-3)
    assert "77 GHz VV, monostatic" in repr(found)
    assert len(repr(found)) < 200
    near = rfgen.rcs(actor, FREQUENCY, distance=0.5)
    assert near.rcs < 0.5 * SPECULAR  # far field begins at 5 m


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frequency": 1e9}, r"k a is .* physical optics needs at least 3, 0\.286 m"),
        ({"frequency": 77.0}, r"frequency is 77\.0 Hz: a value in 1e8 … 1e12 Hz"),
        ({"azimuth": [0, np.nan]}, "finite angles"),
        ({"azimuth": []}, "no angles given"),
        ({"elevation": 91.0}, r"elevations of -90 … 90"),
        ({"azimuth": 180.0, "incident": (0, 0)}, "bistatic angle is 180°, up to 150°"),
        ({"incident": (0, 0), "max_bounces": 2}, "max_bounces is 2: bistatic"),
        ({"incident": 3.0}, r"incident is 3\.0: a pair"),
        ({"polarization": "V"}, "polarization is 'V': 'VV'"),
        ({"distance": 0.01}, r"distance is 0\.01: more than"),
    ],
)
def test_mistakes_are_named(given, message):
    with pytest.raises(ValueError, match=message):
        rfgen.rcs(PLATE, **{"frequency": FREQUENCY} | given)
