"""Shadows of slabs that are seen through, as each pair of elements sees them: a metal plate half behind a sheet or a
pane, against quadrature of what comes to each of its points and back, each leg with the slab's coefficient where it
goes through it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.scene import MATERIALS, MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.integral.slabs import transmission
from tests.sionna.rectangles import scene_of

SLOW = pytest.mark.slow
PLATE, HALF = 2.0, 0.3
FACES = np.array([[0, 2, 1], [0, 3, 2]])
CLOTH, THIN, PANE, BOARD = ("clothing", 1e-3), ("glass", 0.5e-3), ("glass", 6e-3), ("plasterboard", 12.5e-3)


def array(name, polarization="V"):
    both = {"tx_polarization": polarization, "rx_polarization": polarization}
    return replace(Radar.load(name), pattern=ElementPattern(0.0), **both)


def rectangle(x, left, right, half):
    """Across the boresight, from one y to the other."""
    return np.array([[x, left, -half], [x, right, -half], [x, right, half], [x, left, half]])


class Slab:
    """Across the boresight at x, from one y to the other; of no material, it is opaque."""

    def __init__(self, x, left, right, made_of=None):
        self.x, self.ends, self.made_of = x, (left, right), made_of

    def on_the_plate(self, element, y):
        """Where an element sees a y of the slab fall on the plate."""
        return element[1] + (y - element[1]) * (PLATE - element[0]) / (self.x - element[0])

    def coefficient(self, k, field, frequency):
        """What is left of a wave along `k` by its own polarisation."""
        if self.made_of is None:
            return 0.0
        name, thickness = self.made_of
        eps = complex(MATERIALS[name].relative_permittivity(frequency))
        t_s, t_p = transmission(eps, 1.0, thickness, k[..., 0], frequency)
        across = np.cross(k, [1.0, 0.0, 0.0])
        across /= np.maximum(np.linalg.norm(across, axis=-1), 1e-12)[..., None]
        own = field - k * (k @ field)[..., None]
        share = (across @ field) ** 2 / (own**2).sum(axis=-1)
        return share * t_s + (1.0 - share) * t_p

    def actor(self, name):
        name_of, thickness = self.made_of or ("metal", 0.01)
        material = replace(MATERIALS[name_of], thickness=thickness)
        return MeshActor.from_mesh((rectangle(self.x, *self.ends, 1.0), FACES), material=material, name=name)

    def in_a_scene(self):
        return (rectangle(self.x, *self.ends, 1.0), *(self.made_of or ("metal", 0.01)))


def seen_by(tx, rx, slabs, field, frequency, points=300):
    """Physical optics of the plate: Gauss' points in z, and in y from each edge of a leg's shadow to the next."""
    edges = [slab.on_the_plate(each, y) for slab in slabs for each in (tx, rx) for y in slab.ends]
    bounds = np.unique(np.clip([-HALF, HALF, *edges], -HALF, HALF))
    one, weight = np.polynomial.legendre.leggauss(points)
    total, wavenumber = 0.0, 2 * np.pi * frequency / SPEED_OF_LIGHT
    for low, high in pairwise(bounds):
        count = 16 + int(points * (high - low) / (2 * HALF))
        place, own = np.polynomial.legendre.leggauss(count)
        y = low + 0.5 * (high - low) * (1 + place)
        there = np.stack(np.broadcast_arrays(PLATE, y[:, None], HALF * one), axis=-1)
        waves = np.multiply.outer(0.5 * (high - low) * own, HALF * weight) / (4 * np.pi)
        for each in (tx, rx):
            way = there - each
            distance = np.linalg.norm(way, axis=-1)
            waves = waves * np.exp(-1j * wavenumber * distance) / distance
            for slab in slabs:
                if slab.on_the_plate(each, slab.ends[0]) < 0.5 * (low + high) < slab.on_the_plate(each, slab.ends[1]):
                    waves = waves * slab.coefficient(way / distance[..., None], field, frequency)
        total += (waves * PLATE / np.linalg.norm(there - tx, axis=-1)).sum()
    return -1j * total


def of_the_plate(traced, u=0.0):
    """(tx, rx) what comes back by the plate at a place of the band."""
    total = 0.0
    for paths in (traced.static, traced.moving, *(each.paths for each in traced.shadows)):
        if paths.num_paths and "plate" in paths.object_names:
            mine = paths.object_id == paths.object_names.index("plate")
            a = paths.a[..., mine, 0]
            for order, more in enumerate(() if paths.dispersion is None else paths.dispersion, start=1):
                a = a + more[..., mine, 0] * u**order
            frequency = paths.frequency + u * paths.half_band
            total = total + (a * np.exp(-2j * np.pi * np.mod(frequency * paths.tau[..., mine, 0], 1.0))).sum(axis=-1)
    return np.asarray(total)


def traced(radar, slabs, still=(), rtol=1e-2):
    """With the plate and the slabs moving, but for those that are `still`."""
    panes, actors = {}, []
    for name, slab in slabs.items():
        if name in still:
            panes[name] = slab.in_a_scene()
        else:
            actors.append(slab.actor(name))
    plate = rectangle(PLATE, -HALF, HALF, HALF)
    if "plate" in still:
        panes["plate"] = (plate, "pec", 0.01)
    else:
        actors.append(MeshActor.from_mesh((plate, FACES), material="pec", name="plate"))
    scene = load_scene(scene_of(77e9, **panes).sionna) if panes else None
    return Simulator(scene, radar, actors, rtol=rtol, transmission=True).tracer.trace(0.0, 0.0)


def off(radar, found, slabs, u=0.0, every=1):
    """Largest error of any pair, the least that pairs return, and the most, over what the whole plate returns."""
    paths = found.moving if found.moving.num_paths else found.static
    frequency, field = paths.frequency + u * paths.half_band, np.asarray(radar.tx_field)
    tx, rx = radar.tx_world[::every], radar.rx_world[::every]
    true = np.array([[seen_by(a, b, slabs, field, frequency) for b in rx] for a in tx])
    whole = abs(seen_by(np.zeros(3), np.zeros(3), [], field, frequency))
    error = np.abs(of_the_plate(found, u)[::every, ::every] - true).max()
    return error / whole, np.abs(true).min() / whole, np.abs(true).max() / whole


@pytest.mark.slow
@pytest.mark.parametrize("made_of", [CLOTH, THIN, pytest.param(PANE, marks=SLOW), pytest.param(BOARD, marks=SLOW)])
@pytest.mark.parametrize("edge", [0.0, pytest.param(0.013, marks=SLOW), pytest.param(-0.02, marks=SLOW)])
@pytest.mark.parametrize("still", [(), ("plate", "slab"), pytest.param(("slab",), marks=SLOW)])
def test_each_pair_sees_the_edge_of_a_slab_from_its_own_place(made_of, edge, still):
    """Within the tolerance of what the whole plate returns. Strips as of an opaque slab were up to 38 % off."""
    radar, slab = array("awr1843"), Slab(1.0, edge - 1.0, edge, made_of)
    found = traced(radar, {"slab": slab}, still)
    error, least, most = off(radar, found, [slab])
    assert error < min(0.01, found.report.error * (1.0 if "plate" in still else most))
    assert most > 1.1 * least


@pytest.mark.slow
@pytest.mark.parametrize("u", [-1.0, 1.0])
@pytest.mark.parametrize("polarization", ["H", "+45"])
def test_over_the_band_and_of_any_polarisation(u, polarization):
    radar, slab = array("awr1843", polarization), Slab(1.0, -1.0, 0.0, PANE)
    assert off(radar, traced(radar, {"slab": slab}), [slab], u)[0] < 0.01


@pytest.mark.parametrize("edge", [0.0, pytest.param(-0.02, marks=SLOW)])
@pytest.mark.parametrize("still", [pytest.param((), marks=SLOW), ("plate", "slab")])
def test_so_does_each_pair_of_a_wide_array(edge, still):
    """A wide cascade, a pane 20 cm before the plate: pairs differ by 12 dB."""
    radar, slab = array("mmwcas"), Slab(1.8, edge - 1.0, edge, THIN)
    error, least, most = off(radar, traced(radar, {"slab": slab}, still), [slab], every=8)
    assert error < 0.01
    assert most > 2.5 * least


@pytest.mark.slow
@pytest.mark.parametrize("other", [CLOTH, None])
def test_behind_a_slab_there_may_be_another_one(other):
    """A pane before a sheet, or before a metal screen, which is all the same as that alone, with one edge."""
    radar = array("awr1843")
    slabs = {"slab": Slab(1.0, -1.0, 0.0, THIN), "other": Slab(1.0005, -1.0, 0.0, other)}
    assert off(radar, traced(radar, slabs), list(slabs.values()))[0] < 0.012


def test_an_opaque_edge_is_what_it_was():
    """To the bit, whether slabs are seen through or not."""
    radar, slab = array("awr1843"), Slab(1.0, -1.0, 0.013)
    plate = MeshActor.from_mesh(
        trimesh.Trimesh(rectangle(PLATE, -HALF, HALF, HALF), FACES), material="pec", name="plate"
    )
    pane = Slab(1.0, 2.0, 3.0, THIN).actor("pane")
    here, there = (
        Simulator(None, radar, [plate, slab.actor("slab"), pane], rtol=1e-2, transmission=each).tracer.trace(0.0, 0.0)
        for each in (False, True)
    )
    np.testing.assert_array_equal(of_the_plate(here), of_the_plate(there))
