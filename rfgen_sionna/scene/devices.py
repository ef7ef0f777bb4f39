"""Radars as transmitters and receivers of Sionna scenes, and antenna patterns of Sionna's registry."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna.radar import NamedPattern, Radar, TablePattern
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.scene.mitsuba_file import FARTHEST
from rfgen_sionna.scene.scene import RadarScene

if TYPE_CHECKING:
    from rfgen_sionna.scene.sionna_array import ArrayEnd, RadarReceiver, RadarTransmitter

TABLE_STEP = 2.0
"""Grid step of tables of registered patterns [degrees]: the 3GPP pattern errs by 0.003 dB."""


def tabulated(radar: Radar) -> Radar:
    """The radar with a table in place of a pattern of Sionna's registry; other radars are returned unchanged.

    Raises
    ------
    ValueError
        Sionna's registry has no such pattern.
    """
    if not isinstance(radar.pattern, NamedPattern):
        return radar
    ensure_backend()
    import mitsuba as mi
    from sionna.rt.antenna_pattern import antenna_pattern_registry as registry

    from rfgen_sionna.scene.sionna_array import grid_directions

    name = radar.pattern.name.partition(":")[2]
    if name not in registry.list():
        raise ValueError(
            f"radar '{radar.name}': pattern '{radar.pattern.name}' is not in Sionna's registry; "
            f"it has {', '.join(f'sionna:{known}' for known in registry.list())}"
        )
    azimuth, elevation, directions = grid_directions(TABLE_STEP)
    theta = np.arccos(np.clip(directions[..., 2], -1.0, 1.0)).ravel()
    phi = np.arctan2(directions[..., 1], directions[..., 0]).ravel()
    fields = registry.get(name)(polarization="V")[0](mi.Float(theta), mi.Float(phi))
    power = sum(np.square(part.numpy().astype(np.float64)) for field in fields for part in (field.real, field.imag))
    with np.errstate(divide="ignore"):
        gain = 10 * np.log10(np.broadcast_to(power, theta.shape).reshape(directions.shape[:2]))
    return replace(radar, pattern=TablePattern.of(azimuth, elevation, gain, radar.pattern.name))


def sionna_scene(scene: Any) -> Any:
    """The `sionna.rt.Scene` of a `RadarScene`, or the `sionna.rt.Scene` itself.

    Raises
    ------
    TypeError
        `scene` is neither.
    """
    ensure_backend()
    import sionna.rt

    inside = scene.sionna if isinstance(scene, RadarScene) else scene
    if not isinstance(inside, sionna.rt.Scene):
        raise TypeError(f"scene: {type(scene).__name__} given, a RadarScene or a sionna.rt.Scene is needed")
    return inside


def _check_radar(radar: Any) -> None:
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: {type(radar).__name__} given, an rfgen_sionna.Radar is needed")


def add_radar(scene: RadarScene | Any, radar: Radar, name: str | None = None) -> tuple[RadarTransmitter, RadarReceiver]:
    """Put a radar into a Sionna scene as a transmitter and a receiver for `sionna.rt.PathSolver`.

    Element positions, orientation, element pattern, polarisation and power are the radar's; path gains include the
    element patterns. Call the solver with `synthetic_array=False`: a plane wave across the array errs by degrees of
    phase at indoor ranges.

    Several radars of one kind may share a scene. Sionna keeps one transmit array, one receive array and one frequency
    per scene: radars of different kinds take turns (:func:`radar_alone`). Simulators have no such limit.

    Parameters
    ----------
    scene
        A scene of :func:`~rfgen_sionna.scene.load.load_scene`, or a `sionna.rt.Scene`.
    name
        Prefix of the devices `<name>_tx` and `<name>_rx`; None takes the radar's name.

    Raises
    ------
    TypeError
        `scene` is no scene, or `radar` no radar.
    ValueError
        The scene has devices of that name, or arrays of another radar.
    """
    inside = sionna_scene(scene)
    _check_radar(radar)
    from rfgen_sionna.scene.sionna_array import RadarArray, RadarReceiver, RadarTransmitter

    radar = tabulated(radar)
    far = float(np.abs(radar.position).max())
    if far > FARTHEST:
        warnings.warn(
            f"radar '{radar.name}' is {far:.10g} m from the origin, where the 32-bit floats of Sionna's solvers are "
            f"{np.spacing(np.float32(far)):.2g} m apart: move scene and radar to the origin (a Simulator needs no such "
            "move)",
            stacklevel=2,
        )
    name = radar.name if name is None else name
    known: dict[ArrayEnd, Any] = {"tx": inside.transmitters, "rx": inside.receivers}
    for end in known:
        if f"{name}_{end}" in known[end]:
            raise ValueError(f"name is {name!r}: the scene has a device '{name}_{end}' already; choose another name")
    arrays = {end: getattr(inside, f"{end}_array") for end in known}
    other = [end for end in known if not (isinstance(arrays[end], RadarArray) and arrays[end].matches_end(radar, end))]
    for end in other:
        if known[end]:
            raise ValueError(
                f"radar '{radar.name}': the scene's {end}_array serves the devices {', '.join(known[end])} and has "
                "other elements; Sionna keeps one array per scene: radars of different kinds take turns, in "
                "radar_alone(scene, radar)"
            )
    for end in other:
        setattr(inside, f"{end}_array", RadarArray(radar, end))
    devices = RadarTransmitter(radar, f"{name}_tx"), RadarReceiver(radar, f"{name}_rx")
    inside.add(list(devices))
    return devices


@contextmanager
def radar_alone(
    scene: RadarScene | Any, radar: Radar, name: str | None = None
) -> Iterator[tuple[RadarTransmitter, RadarReceiver]]:
    """A radar as the scene's only transmitter and receiver within a `with` block.

    >>> for radar in radars:  # doctest: +SKIP
    ...     with radar_alone(scene, radar):
    ...         paths.append(solver(scene.sionna, synthetic_array=False))

    The block restores devices, arrays and frequency at its end. Within it a
    :class:`~rfgen_sionna.scene.scene.RadarScene` has the radar's centre frequency; a `sionna.rt.Scene` keeps its own,
    as its materials may not be defined there.

    Parameters
    ----------
    scene, radar, name
        As for :func:`add_radar`.
    """
    inside = sionna_scene(scene)
    _check_radar(radar)
    others = [*inside.transmitters.values(), *inside.receivers.values()]
    arrays = {end: getattr(inside, f"{end}_array") for end in ("tx", "rx")}
    before = scene.frequency if isinstance(scene, RadarScene) else None
    inside.remove([device.name for device in others])
    devices: tuple[RadarTransmitter, RadarReceiver] | tuple[()] = ()
    try:
        if isinstance(scene, RadarScene):
            scene.tune(radar.center_frequency)
        devices = add_radar(scene, radar, name)
        yield devices
    finally:
        inside.remove([device.name for device in devices])
        for end, array in arrays.items():
            if array is not None:
                setattr(inside, f"{end}_array", array)
        inside.add(others)
        if before is not None:
            scene.tune(before)
