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
    with pytest.raises(
        MaterialError,
        match=r"wall: unknown .*'granite', did you mean 'marble'.*known are abs .*asphalt_concrete \(1-40 GHz\)",
    ):
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


WATER = ((24.0, 30.23 - 35.27j), (60.0, 10.88 - 19.72j), (77.0, 8.80 - 15.91j))
"""Frequency [GHz] and permittivity of water of 20 °C by ITU-R P.527-6."""


@pytest.mark.parametrize(("ghz", "expected"), WATER)
def test_water_has_two_debye_relaxations(ghz, expected):
    """The first relaxation, of 17 GHz at 20 °C, by itself gives the permittivity within what the second adds."""
    eps = complex(material("water").relative_permittivity(ghz * GHZ))
    assert eps == pytest.approx(expected, abs=0.01)
    theta = 300 / 293.15 - 1
    static, first = 77.66 + 103.3 * theta, 20.20 - 146.4 * theta + 316 * theta**2
    alone = 0.0671 * static + 0.9329 * static / (1 + 1j * ghz / first)
    assert abs(eps - alone) < 0.0671 * static * ghz / (39.8 * first) + 0.2


@pytest.mark.parametrize(
    ("name", "at_24", "at_60", "at_77"),
    [
        ("sea_water", 33.60 - 36.71j, 12.11 - 22.38j, 9.45 - 18.29j),
        ("ice", 3.1793 - 0.0018j, 3.1793 - 0.0045j, 3.1793 - 0.0058j),
        ("snow", 1.57 - 0.0004j, 1.57 - 0.0009j, 1.57 - 0.0011j),
        ("wet_snow", 1.816 - 0.040j, 1.778 - 0.069j, 1.763 - 0.073j),
        ("dry_soil", 3.645 - 0.223j, 3.251 - 0.120j, 3.199 - 0.0964j),
        ("wet_soil", 9.014 - 4.459j, 5.383 - 2.475j, 4.940 - 1.996j),
        ("abs", 2.7 - 0.0216j, 2.7 - 0.0216j, 2.7 - 0.0216j),
        ("pla", 2.75 - 0.033j, 2.75 - 0.033j, 2.75 - 0.033j),
        ("pet", 2.85 - 0.0285j, 2.85 - 0.0285j, 2.85 - 0.0285j),
        ("pmma", 2.61 - 0.0261j, 2.61 - 0.0261j, 2.61 - 0.0261j),
        ("polycarbonate", 2.76 - 0.0193j, 2.76 - 0.0193j, 2.76 - 0.0193j),
        ("pvc", 2.71 - 0.0163j, 2.71 - 0.0163j, 2.71 - 0.0163j),
        ("pom", 2.73 - 0.0164j, 2.73 - 0.0164j, 2.73 - 0.0164j),
        ("polyethylene", 2.37 - 0.0005j, 2.37 - 0.0005j, 2.37 - 0.0005j),
        ("polypropylene", 2.27 - 0.0002j, 2.27 - 0.0002j, 2.27 - 0.0002j),
        ("polystyrene", 2.505 - 0.0006j, 2.505 - 0.0006j, 2.505 - 0.0006j),
        ("nylon", 3.0 - 0.054j, 3.0 - 0.054j, 3.0 - 0.054j),
        ("ptfe", 2.05 - 0.001j, 2.05 - 0.001j, 2.05 - 0.001j),
        ("paper", 2.8 - 0.224j, 2.8 - 0.224j, 2.8 - 0.224j),
        ("ceramic", 5.5 - 0.055j, 5.5 - 0.055j, 5.5 - 0.055j),
    ],
)
def test_everyday_things_have_the_values_of_their_sources(name, at_24, at_60, at_77):
    for ghz, expected in ((24, at_24), (60, at_60), (77, at_77)):
        eps = complex(material(name, outside="raise").relative_permittivity(ghz * GHZ))
        assert eps.real == pytest.approx(expected.real, rel=5e-3), (name, ghz)
        assert eps.imag == pytest.approx(expected.imag, rel=3e-2, abs=6e-5), (name, ghz)


@pytest.mark.parametrize(
    ("name", "eps", "share"),
    [
        ("denim", 3 - 0.24j, 0.6),
        ("wool", 3 - 0.24j, 0.25),
        ("cardboard", 2.8 - 0.224j, 0.25),
        ("styrofoam", 2.505 - 0.0006j, 0.03),
    ],
)
def test_mixtures_with_air_lie_within_wieners_bounds(name, eps, share):
    """Layers along and across the field bound any mixture (Wiener 1912)."""
    found = complex(material(name).relative_permittivity(77 * GHZ))
    along, across = 1 - share + share * eps, 1 / (1 - share + share / eps)
    assert across.real < found.real < along.real
    assert along.imag < found.imag < across.imag


def test_carbon_fibre_reflects_like_metal():
    assert front_db("carbon_fibre", 60 * GHZ) == pytest.approx(0.0, abs=0.5)
    assert front_db("water", 77 * GHZ) == pytest.approx(-3.5, abs=0.1)


def test_temperature_changes_water_and_ice_only():
    """Warm water relaxes faster: its loss is larger at 77 GHz."""
    loss = [-material("water", temperature=t).relative_permittivity(77 * GHZ).imag for t in (0.0, 20.0, 37.0)]
    assert loss[0] < loss[1] < loss[2]
    with pytest.raises(MaterialError, match=r"temperature: 99 °C given, allowed are -4 … 40 °C"):
        material("water", temperature=99)
    with pytest.raises(MaterialError, match=r"'metal': temperature has an effect on .*water.* only"):
        material("metal", temperature=20)


def test_an_own_material_is_one_line():
    f = np.array([24.0, 77.0]) * GHZ
    resin = material("my_resin", permittivity=2.9, conductivity=0.3)
    np.testing.assert_allclose(resin.relative_permittivity(f), 2.9 - 0.3j / (2 * np.pi * f * epsilon_0))
    for lossy in (
        material("r", permittivity=2.9, loss_tangent=0.02),
        material("r", permittivity=2.9 - 0.058j),
    ):
        np.testing.assert_allclose(lossy.relative_permittivity(f), 2.9 - 0.058j)
    pane = material("glass", thickness=0.004)
    assert (pane.thickness, pane.source) == (0.004, MATERIALS["glass"].source)
    assert material("x", 77 * GHZ, "raise", permittivity=3.0).covers(77 * GHZ)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"permittivity": -1.0}, "permittivity -1.0, a real part above 0"),
        ({"permittivity": 3 + 1j}, "an imaginary part of at most 0"),
        ({"permittivity": 3, "conductivity": -1}, "conductivity -1, a finite number that is not negative"),
        ({"permittivity": 3 - 1j, "loss_tangent": 0.1}, "give its loss once"),
        ({"permittivity": [2.9, 3.0]}, "one number is needed"),
        ({"conductivity": 1.0}, "permittivity is needed, too"),
        ({"permittivity": 3, "temperature": 20}, "leave temperature out"),
    ],
)
def test_an_own_material_is_checked(arguments, message):
    with pytest.raises(MaterialError, match=f"'my_resin'.*{message}"):
        material("my_resin", **arguments)


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("human", "skin"),
        ("Concrete_Wall.001", "concrete"),
        ("tyres", "rubber"),
        ("CarWindow", "metal|glass"),
        ("granite", "marble"),
        ("concret", "concrete"),
        ("road", "asphalt_concrete"),
        ("watre", "water"),
    ],
)
def test_hints_go_by_the_meaning(word, meant):
    with pytest.raises(MaterialError, match=rf"unknown material '{word}', did you mean '(?:{meant})'\?"):
        material(word)


@pytest.mark.parametrize("word", ["hair", "oil", "bone", "blinn1"])  # not air, soil, bronze, linen
def test_another_word_of_similar_letters_is_no_hint(word):
    with pytest.raises(MaterialError, match=rf"unknown material '{word}'; "):
        material(word)


def test_a_word_without_a_meaning_gets_the_recipe_of_an_own_material():
    with pytest.raises(
        MaterialError,
        match=r"'zorp'; rfgen_sionna\.material\('my_resin', permittivity=.*; known are abs",
    ):
        material("zorp")


@pytest.mark.parametrize("word", ["teflon", "plexiglass", "acrylic", "copper", "seawater", "cfrp", "jeans", "hdpe"])
def test_other_spellings_are_defined_at_radar_frequencies(word):
    for ghz in (24, 60, 77):
        material(word, ghz * GHZ, outside="raise")
