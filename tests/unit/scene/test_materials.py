"""Materials have the permittivities of their sources, and say where those end."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import epsilon_0

from rfgen_sionna.scene import MATERIALS, MaterialError, MaterialRangeWarning, canonical_name, material
from rfgen_sionna.scene.materials import warn_uncovered
from rfgen_sionna.scene.scattering import ScatteringPattern

GHZ = 1e9


def front_db(name: str, frequency: float, outside="extrapolate") -> float:
    """Power reflected at normal incidence by a half-space [dB]."""
    n = np.sqrt(material(name, outside=outside).relative_permittivity(frequency))
    return float(20 * np.log10(abs((1 - n) / (1 + n))))


@pytest.mark.parametrize(
    ("ghz", "expected"),
    [(24.125, 18.91 - 17.10j), (60.0, 7.98 - 10.90j), (77.0, 6.57 - 8.91j), (79.0, 6.45 - 8.72j)],
)
def test_dry_skin_is_gabriels(ghz, expected):
    """Values of the IFAC tissue calculator, three digits."""
    assert material("skin").relative_permittivity(ghz * GHZ) == pytest.approx(expected, abs=0.011)


def test_wet_skin_is_gabriels():
    assert material("wet_skin").relative_permittivity(77 * GHZ) == pytest.approx(8.54 - 10.03j, abs=0.011)


@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("skin", -4.68),
        ("concrete", -8.1),
        ("plasterboard", -12.2),
        ("wood", -15.3),
        ("glass", -7.3),
        ("ceiling_board", -20.2),
        ("chipboard", -12.6),
        ("floorboard", -10.0),
        ("pec", 0.0),
        ("metal", 0.0),
    ],
)
def test_normal_incidence_levels_at_77_ghz(name, level):
    assert front_db(name, 77 * GHZ) == pytest.approx(level, abs=0.06 if name != "skin" else 0.006)


def test_penetration_depth_of_skin():
    """The power falls to 1/e within 1 / (2 k |Im n|), 0.21 mm at 77 GHz."""
    n = np.sqrt(material("skin").relative_permittivity(77 * GHZ))
    k = 2 * np.pi * 77 * GHZ / 299_792_458.0
    assert 1 / (2 * k * -n.imag) == pytest.approx(0.21e-3, abs=0.01e-3)


@pytest.mark.parametrize(
    ("name", "thickness", "low", "high"), [("plasterboard", 0.012, 0.19, 0.30), ("glass", 0.006, 0.31, 0.51)]
)
def test_a_slab_ripples_over_the_radar_band(name, thickness, low, high):
    """|Gamma| of a slab at normal incidence from its two faces, 76-81 GHz."""
    f = np.linspace(76, 81, 501) * GHZ
    n = np.sqrt(material(name).relative_permittivity(f))
    front = (1 - n) / (1 + n)
    turn = np.exp(-2j * (2 * np.pi * f / 299_792_458.0) * n * thickness)
    slab = np.abs(front * (1 - turn) / (1 - front**2 * turn))
    assert slab.min() == pytest.approx(low, abs=0.01)
    assert slab.max() == pytest.approx(high, abs=0.01)


@pytest.mark.parametrize("name", sorted(MATERIALS))
@pytest.mark.parametrize("outside", ["extrapolate", "clamp"])
def test_everything_is_passive_and_finite_at_all_radar_frequencies(name, outside):
    f = np.geomspace(1, 300, 400) * GHZ
    eps = material(name, outside=outside).relative_permittivity(f)
    assert np.isfinite(eps).all()
    assert (eps.real >= 1.0).all()
    assert (eps.imag <= 0.0).all()
    assert MATERIALS[name].source
    assert MATERIALS[name].model.ranges


def test_extrapolation_bridges_gaps_without_steps():
    """From one edge of a gap between measured ranges to the other the values run continuously and stay between."""
    for name, low, high in (("brick", 40, 110), ("plywood", 40, 100), ("marble", 60, 100)):
        f = np.geomspace(low * 0.9999, high * 1.0001, 2000) * GHZ
        eps = material(name).relative_permittivity(f)
        sigma = material(name).conductivity(f)
        assert np.abs(np.diff(eps.real)).max() < 0.01
        assert np.abs(np.diff(np.log(sigma))).max() < 0.01
        edges = material(name).relative_permittivity(np.array([low, high]) * GHZ).real
        assert edges.min() - 1e-9 <= eps.real.min()
        assert eps.real.max() <= edges.max() + 1e-9


def test_clamping_holds_permittivity_and_conductivity_of_the_edge():
    clamped = material("vinyl_tile", outside="clamp")
    edge = 40 * GHZ
    assert clamped.conductivity(77 * GHZ) == pytest.approx(clamped.conductivity(edge))
    assert clamped.relative_permittivity(77 * GHZ).real == pytest.approx(3.62)
    skin = material("skin", outside="clamp")
    assert skin.conductivity(140 * GHZ) == pytest.approx(skin.conductivity(100 * GHZ))
    extrapolated = material("vinyl_tile").conductivity(77 * GHZ)
    assert extrapolated == pytest.approx(0.0051 * 77**0.8422)


def test_raising_names_object_material_frequency_and_choices():
    with pytest.raises(MaterialError, match=r"shed: material 'brick' is not defined at 77 GHz.*1-40 GHz.*extrapolate"):
        material("brick", 77 * GHZ, outside="raise", owner="shed")
    strict = material("brick", outside="raise")
    assert strict.relative_permittivity(24 * GHZ).real == pytest.approx(3.91)
    with pytest.raises(MaterialError, match="brick"):
        strict.relative_permittivity([24 * GHZ, 77 * GHZ])


def test_extrapolating_and_clamping_are_said():
    with pytest.warns(MaterialRangeWarning, match=r"extrapolated to 77 GHz.*brick \(1-40 GHz, 110-330 GHz\)"):
        material("brick", 77 * GHZ)
    with pytest.warns(MaterialRangeWarning, match="clamped to 24 GHz"):
        warn_uncovered([material("floorboard", outside="clamp")], 24 * GHZ)
    warn_uncovered([material("concrete")], 77 * GHZ)  # covered: a warning would be an error here


def test_names_and_aliases():
    for name in ("metal", "itu_metal", "mat-itu_metal", "ITU Metal", "steel", "car_body"):
        assert canonical_name(name) == "metal"
        assert material(name).name == "metal"
    assert material("Ceiling board").name == "ceiling_board"
    with pytest.raises(MaterialError, match=r"wall: unknown .*'granite', did you mean 'marble'.*known are abs .*asphalt_concrete \(1-40 GHz\)"):
        material("granite", owner="wall")
    with pytest.raises(MaterialError, match="allowed are 'extrapolate', 'clamp', 'raise'"):
        material("metal", outside="guess")


@pytest.mark.parametrize("frequency", [0.0, -77e9, np.nan, np.inf])
def test_frequencies_are_positive(frequency):
    with pytest.raises(ValueError, match="positive finite"):
        material("metal").relative_permittivity(frequency)


def test_arrays_keep_their_shape_and_losses_match_the_conductivity():
    f = np.array([[24.0, 60.0], [77.0, 79.0]]) * GHZ
    eps = material("concrete").relative_permittivity(f)
    assert eps.shape == f.shape
    np.testing.assert_allclose(-eps.imag * 2 * np.pi * f * epsilon_0, 0.0462 * (f / GHZ) ** 0.7822)
    assert material("concrete").relative_permeability(f).shape == f.shape


@pytest.mark.parametrize("mu", [0.0, np.inf, np.nan, -1.0, 2.0 + 0.5j])
def test_permeabilities_that_nothing_has_are_refused(mu):
    with pytest.raises(MaterialError, match=r"'skin': permeability .* is needed"):
        replace(material("skin"), permeability=mu)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("thickness", "a"),
        ("thickness", -0.1),
        ("thickness", np.nan),
        ("thickness", np.array([0.1, 0.2])),
        ("scattering_coefficient", "x"),
        ("scattering_coefficient", None),
        ("scattering_coefficient", 1.5),
        ("xpd_coefficient", "x"),
        ("permeability", "a"),
        ("permeability", "1"),
        ("permeability", None),
        ("permeability", np.array([1.0, 2.0])),
        ("name", 3),
        ("name", None),
        ("scattering_pattern", "lambertian"),
        ("scattering_pattern", None),
        ("model", "concrete"),
        ("outside", np.array(["clamp", "raise"])),
    ],
)
def test_fields_of_materials_that_cannot_be_are_named(field, value):
    with pytest.raises(MaterialError, match=rf"{field}:? .*(needed|allowed)"):
        replace(material("skin"), **{field: value})


@pytest.mark.parametrize("thickness", [None, 0, 0.013, np.float32(0.1)])
def test_slabs_have_a_thickness_or_are_none(thickness):
    assert replace(material("skin"), thickness=thickness).thickness == thickness


@pytest.mark.parametrize("change", [{"kind": np.array(["a", "b"])}, {"lambda_": "x"}, {"lambda_": np.nan}])
def test_so_are_those_of_scattering_patterns(change):
    with pytest.raises(MaterialError, match=next(iter(change))):
        ScatteringPattern(**change)


@pytest.mark.parametrize("found", [(np.nan, 0.0), (2.0, np.nan), (2.0, -1.0)])
def test_so_are_permittivities(found):
    """NaN would count as a perfect conductor, and what amplifies returns more than it gets."""

    class Odd:
        ranges = ((1e9, 1e12),)

        def evaluate(self, frequency, outside):
            return found

    odd = replace(material("skin"), name="odd", model=Odd())
    with pytest.raises(MaterialError, match=r"'odd': permittivity .* at 7.7e\+10 Hz"):
        odd.relative_permittivity(77e9)
