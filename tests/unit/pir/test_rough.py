"""What rough surfaces return to a PIR: as much as to the tracer's paths, at the same ranges."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.pir import render_pir
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer

HEIGHT = 1.0


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, HEIGHT), look_at=(3, 0, HEIGHT))


def rough(share, name="concrete"):
    return replace(MATERIALS[name], thickness=None, scattering_coefficient=float(np.sqrt(share)))


def plate(width, height, cells=8):
    """A net of triangles in the plane x = 0."""
    y, z = np.meshgrid(
        np.linspace(-width / 2, width / 2, cells + 1), np.linspace(-height / 2, height / 2, cells + 1), indexing="ij"
    )
    points = np.stack([np.zeros_like(y), y, z], -1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(cells + 1, cells + 1)
    a, b, c, d = (m.ravel() for m in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return points, np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])


def decibels(ratio):
    return 10 * np.log10(ratio)


def test_energies_over_range_are_those_of_the_paths(radar):
    """A matt board that runs away from the radar: in each 0.25 m of range, pixels and facets return the same.

    Without a coherent part energies simply add up. A PIR is for any radar: it has the mean of both polarisations.
    Pixels at the ends of a bin put all their energy to one side: 0.5 dB.
    """
    board = MeshActor.from_mesh(
        plate(3.0, 1.0, 24), material=rough(1.0), position=(3, 0.4, HEIGHT), orientation=(0.9, 0, 0)
    )
    sim = Simulator(None, radar, [board], rtol=0.005)
    paths, pir = sim.paths(), sim.pir(0.0, (48, 320), (80, 40))
    flat = Simulator(None, replace(radar, tx_polarization="H", rx_polarization="H"), [board], rtol=0.005).paths()
    np.testing.assert_allclose(flat.tau, paths.tau)
    bins = np.arange(2.35, 4.15, 0.25)  # the board runs from 2.3 to 4.2 m
    ranges = [SPEED_OF_LIGHT / 2 * tau for tau in (paths.tau[0, 0, :, 0], np.nan_to_num(pir.time_of_arrival).ravel())]
    energies = 0.5 * sum(np.abs(each.a[0, 0, :, 0]) ** 2 for each in (paths, flat)), pir.energy.ravel()
    facets, pixels = (np.histogram(r, bins, weights=e)[0] for r, e in zip(ranges, energies, strict=True))
    np.testing.assert_allclose(decibels(pixels / facets), 0.0, atol=0.5)
    assert decibels(energies[1].sum() / energies[0].sum()) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_roughness_divides_the_energy(radar, share):
    """A sphere: (1 - S^2) of the smooth one's energy, and what its facets return diffusely on top."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.15)

    def simulator(of, seed=0):
        actor = MeshActor.from_mesh(ball, material=rough(of), position=(2, 0, HEIGHT))
        return Simulator(None, radar, [actor], rtol=0.01, seed=seed)

    smooth, found = (simulator(of).pir(0.0, (24, 24), 12).energy for of in (0.0, share))
    first, second = (simulator(share, seed).paths().a[0, 0, :, 0] for seed in (1, 2))
    diffuse = 0.5 * (np.abs(first - second) ** 2).sum()  # the coherent parts are the same, the phases are not
    # A thousand facets with random phases: 5 % one way or the other.
    assert (found - (1 - share) * smooth).sum() == pytest.approx(diffuse, rel=0.15)
    # Where the sphere faces the radar both meet in one pixel.
    row, column = np.unravel_index(smooth.argmax(), smooth.shape)
    assert found[row, column] > (1 - share) * smooth[row, column]


def test_lambertian_wall_falls_off_as_the_law_says(radar):
    """A pixel on a large matt wall: (lambda / 4 pi)^2 |Gamma|^2 cos(theta) / pi times its solid angle over R^2."""
    wall = MeshActor.from_mesh(plate(8.0, 0.6, 2), material=rough(1.0, "metal"), position=(2.5, 0, HEIGHT))
    pir = Simulator(None, radar, [wall], rtol=0.1).pir(0.0, (3, 61), (90, 3))
    y = np.tan(np.radians(45)) * (1 - 2 * (np.arange(61) + 0.5) / 61)
    cos = 1 / np.sqrt(1 + y**2)
    solid = (2 / 61) * (2 * np.tan(np.radians(1.5)) / 3) * cos**3
    expected = (radar.wavelength / (4 * np.pi)) ** 2 * cos / np.pi * solid / (2.5 / cos) ** 2
    # Metal reflects all but 0.1 %; three beams across a pixel instead of an integral.
    np.testing.assert_allclose(pir.energy[1], expected, rtol=0.01)


def test_coherent_returns_left_out_are_small(radar, monkeypatch):
    """Where surfaces are rough, leaving out the coherent part of pixels away from their mirror directions changes no
    pixel by more than 0.1 dB, bar a few at edges."""
    board = MeshActor.from_mesh(
        plate(3.0, 2.0, 16), material=rough(0.4), position=(2.5, 0, HEIGHT), orientation=(0.3, 0, 0)
    )
    tracer = Tracer(None, radar, [board], rtol=1e-3)
    quick = render_pir(tracer, 0.0, (48, 48), 50)
    monkeypatch.setattr("rfgen_sionna.pir.render.NEGLIGIBLE", 0.0)
    full = render_pir(tracer, 0.0, (48, 48), 50)
    hit = full.energy > 0
    difference = decibels(full.energy[hit] / quick.energy[hit])
    assert np.quantile(np.abs(difference), 0.95) < 0.1
    assert decibels(full.energy.sum() / quick.energy.sum()) == pytest.approx(0.0, abs=0.05)
    # At the rim fine patches hit where the middles of nine beams do not.
    assert np.mean(np.isfinite(full.time_of_arrival) != np.isfinite(quick.time_of_arrival)) < 0.01


@pytest.mark.slow
def test_a_mirror_shows_what_stands_beside_the_radar(radar):
    """Two bounces: a metal wall shows a matt board behind the radar, as far away as its image; one bounce does not."""
    mirror = MeshActor.from_mesh(plate(3, 3, 2), material=rough(0.0, "metal"), position=(2, 0, HEIGHT), name="mirror")
    board = MeshActor.from_mesh(
        plate(0.6, 0.6, 2), material=rough(1.0, "metal"), position=(-0.5, 0.9, HEIGHT), name="board"
    )
    tracer = Tracer(None, radar, [mirror, board], rtol=1e-3)
    options = {"resolution": (31, 31), "fov_deg": 60}
    once, twice = (render_pir(tracer, 0.0, bounces=bounces, **options) for bounces in (1, 2))
    column = 10
    # Where its middle meets the board's image, 4.5 m ahead.
    image = 4.5 * np.array([1.0, np.tan(np.radians(30)) * (1 - 2 * (column + 0.5) / 31)])
    assert 0.6 < image[1] < 1.2
    assert once.time_of_arrival[15, column] * SPEED_OF_LIGHT / 2 == pytest.approx(2.04, abs=0.03)
    ranges = twice.time_of_arrival * SPEED_OF_LIGHT / 2
    assert twice.energy[15, column] > 3 * once.energy[15, column]
    # By the mirror both ways, 4.59 m; one way by the mirror and one straight, (0.98 m + 4.58 m) / 2.
    distance = np.hypot(*image)
    straight = np.hypot(0.5, image[1])
    solid = (2 * np.tan(np.radians(30)) / 31) ** 2 * (image[0] / distance) ** 3
    scale = (radar.wavelength / (4 * np.pi)) ** 2 / np.pi * solid
    both_ways = scale * (image[0] / distance) / distance**2
    one_way = scale * (0.5 / straight) / straight**2
    assert twice.energy[15, column] == pytest.approx(both_ways + one_way, rel=0.05)  # the pixel is 0.17 m wide there
    mean = np.average([distance, 0.5 * (distance + straight)], weights=[both_ways, one_way])
    assert ranges[15, column] == pytest.approx(mean, abs=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bounces": 0}, "bounces is 0: a whole number of 1 … 3"),
        ({"bounces": True}, "bounces is True"),
        ({"patch_wavelengths": 0.0}, "0.25 … 100"),
    ],
)
def test_bad_options(radar, options, message):
    with pytest.raises(ValueError, match=message):
        render_pir(Tracer(None, radar, ()), 0.0, **options)


@pytest.mark.slow
def test_a_furnished_room_returns_over_range_what_its_paths_do(radar):
    """A living room: in 0.25 m steps from 1.25 to 5.5 m, what pixels receive is what facets return diffusely.

    Of the paths only the diffuse part is taken, by the difference of two seeds: facets that differ in nothing but their
    phases. A PIR has the mean of both polarisations; from floor and ceiling next to nothing comes back of an upright
    field, towards the angle of Brewster. The far wall's mirror return, in a range of its own, is left to other laws.
    Pixels put all their energy at one range: 0.6 dB.
    """
    scene = furnished("living room", 1)
    scene.tune(radar.center_frequency)
    pir = render_pir(Tracer(scene, radar, (), rtol=1e-3), 0.0, (128, 128), 100)
    bins, half = np.arange(1.25, 5.51, 0.25), np.tan(np.radians(50))
    facets = np.zeros(len(bins) - 1)
    for field in ("V", "H"):
        turned = replace(radar, tx_polarization=field, rx_polarization=field)
        first, second = (Tracer(scene, turned, (), rtol=0.05, seed=seed).instant(0.0) for seed in (0, 1))
        ahead, left, up = first.direction[:, 0].T
        inside = (ahead > 0) & (np.abs(left) < half * ahead) & (np.abs(up) < half * ahead) & (first.bounces == 1)
        diffuse = 0.5 * np.abs(first.a[0, 0, inside, 0] - second.a[0, 0, inside, 0]) ** 2
        facets += 0.5 * np.histogram(SPEED_OF_LIGHT / 2 * first.tau[0, 0, inside, 0], bins, weights=diffuse)[0]
    ranges = SPEED_OF_LIGHT / 2 * pir.time_of_arrival.ravel()
    pixels = np.histogram(ranges, bins, weights=pir.energy.ravel())[0]
    difference = decibels(pixels / facets)
    assert np.abs(difference).max() < 1.0
    assert np.sqrt(np.mean(difference**2)) < 0.5
