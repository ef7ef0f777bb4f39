"""A monostatic MIMO FMCW radar: elements, waveform, noise, pose."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from rfgen_sionna._short_repr import ShortRepr, short_vector
from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.board_frames import element_numbers
from rfgen_sionna.radar.boards import board_power
from rfgen_sionna.radar.config import RadarConfigError, overridden, read_config
from rfgen_sionna.radar.config_file import radar_table
from rfgen_sionna.radar.pattern import Pattern, pattern_record
from rfgen_sionna.radar.pose import POLARIZATIONS, Trajectory, Vector, look_at_angles, pose_at, rotation_matrix, vector
from rfgen_sionna.radar.radar_checks import checked_band, checked_elements, checked_phases
from rfgen_sionna.radar.radar_fields import radar_fields
from rfgen_sionna.radar.radar_record import fields_from_record, waveform_record
from rfgen_sionna.radar.slots import phasors, slot_label
from rfgen_sionna.radar.ti_cfg_text import cfg_text
from rfgen_sionna.radar.waveform import Waveform
from rfgen_sionna.resources import available, resolve


@dataclass(frozen=True, eq=False, repr=False)
class Radar(ShortRepr):
    """Element positions, waveform, power, noise and pose of one radar.

    Device frame: boresight +x, y to the left, z up. The Tx elements are those that the preset fires.

    Raises
    ------
    ValueError
        A field is out of range, or fields do not fit each other; the message names field, value and allowed values.
    """

    name: str
    preset: str
    waveform: Waveform
    tx_names: tuple[str, ...]
    rx_names: tuple[str, ...]
    tx_positions: FloatArray
    """(tx, 3) [m], device frame."""
    rx_positions: FloatArray
    """(rx, 3) [m], device frame."""
    pattern: Pattern
    tx_polarization: str
    rx_polarization: str
    tx_power_dbm: float
    """Per Tx element [dBm]."""
    noise_figure_db: float
    temperature: float
    """Reference temperature of the noise figure [K]."""
    position: Vector = (0.0, 0.0, 0.0)
    """World frame [m]."""
    orientation: Vector = (0.0, 0.0, 0.0)
    """Yaw, pitch, roll [rad]."""
    adc: Adc = field(default_factory=Adc)
    trajectory: Callable[[float], Any] | None = None
    """Function of the time [s] that returns the position [m], or a pair (position, orientation [rad]); `position` and
    `orientation` become those at t = 0. It must be smooth (C²): its steps are steps of the phase. Files store
    :class:`~rfgen_sionna.radar.pose.Trajectory` only."""
    tx_phases_deg: tuple[float, ...] = ()
    """Phase of each Tx element's feed [degrees], which turns the radiated wave: 180 for a patch that is fed from the
    other side. Empty for none."""
    rx_phases_deg: tuple[float, ...] = ()
    """Phase of each Rx element's feed [degrees], which turns the received wave. Empty for none."""
    frequency_range: tuple[float, float] | None = None
    """Lowest and highest frequency that the device can sample [Hz]; None checks no band."""

    def __post_init__(self) -> None:
        for end in ("tx", "rx"):
            array = checked_elements(end, getattr(self, f"{end}_positions"), getattr(self, f"{end}_names"))
            object.__setattr__(self, f"{end}_positions", array)
            phases = checked_phases(end, getattr(self, f"{end}_phases_deg"), getattr(self, f"{end}_names"))
            object.__setattr__(self, f"{end}_phases_deg", phases)
        if self.waveform.num_tx != len(self.tx_positions):
            named = "slots have" if self.waveform.slots else "tx_order fires"
            raise ValueError(f"radar has {len(self.tx_positions)} Tx elements; waveform.{named} {self.waveform.num_tx}")
        for name in ("tx_polarization", "rx_polarization"):
            if getattr(self, name) not in POLARIZATIONS:
                raise ValueError(f"radar.{name} is {getattr(self, name)!r}; allowed: {', '.join(POLARIZATIONS)}")
        limits = {"tx_power_dbm": (-60, 80, "dBm"), "noise_figure_db": (0, 60, "dB"), "temperature": (0, 2000, "K")}
        for name, (low, high, unit) in limits.items():
            value = getattr(self, name)
            if not (np.isfinite(value) and low <= value <= high):
                raise ValueError(f"radar.{name} is {value!r}: a value in {low} … {high} {unit} is needed")
        if self.frequency_range is not None:
            object.__setattr__(self, "frequency_range", checked_band(self.name, self.frequency_range, self.waveform))
        object.__setattr__(self, "position", vector("position", self.position))
        object.__setattr__(self, "orientation", vector("orientation", self.orientation))
        if self.trajectory is not None:
            if not callable(self.trajectory):
                raise ValueError(f"radar.trajectory is {self.trajectory!r}: a function of the time or None is needed")
            position, orientation = self.pose(0.0)
            object.__setattr__(self, "position", position)
            object.__setattr__(self, "orientation", orientation)

    @classmethod
    def available(cls) -> dict[str, tuple[str, ...]]:
        """Names of the shipped radars, each with its presets."""
        return {name: tuple(read_config(resolve("radars", name))["preset"]) for name in available("radars")}

    @classmethod
    def load(
        cls,
        radar: str | os.PathLike[str],
        preset: str | None = None,
        *,
        board: str | os.PathLike[str] | None = None,
        position: Vector = (0.0, 0.0, 0.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        look_at: Vector | None = None,
        trajectory: Callable[[float], Any] | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> Radar:
        """Read a radar from its file, or from a configuration of its vendor's tools.

        Parameters
        ----------
        radar
            Name of a shipped radar in any case, or path of a file, recognised by its content: a radar file in TOML, a
            `.cfg` of TI's mmWave SDK, a `.mmwave.json` or `.setup.json` of mmWave Studio, or a `config.json` of
            Infineon's Radar SDK.
        preset
            Name of a configuration in the file; None takes its `default_preset`. Vendors' files have the preset
            "frame", with advanced frames "subframe0", "subframe1" …, of which one is to be named.
        board
            Board of a vendor's file that names none: a shipped radar, or the path of a radar file in TOML.
        position, orientation
            World position [m]; yaw, pitch, roll [rad] in Sionna's convention.
        look_at
            World point on the boresight [m]; replaces `orientation`, without roll.
        trajectory
            Motion (:attr:`trajectory`); replaces `position` and any orientation that it returns.
        overrides
            Values in place of the file's, under dotted keys: `{"receiver.noise_figure_db": 12.0}`; None overrides none.

        Raises
        ------
        RadarConfigError, ValueError
            The message names key, value and allowed values.
        TypeError
            `overrides` is no mapping.
        """
        config, path, own = radar_table(radar, preset, board)
        if overrides is not None:
            config = overridden(config, overrides, str(path))
        try:
            made = cls(**radar_fields(config, preset, str(path), own))
        except RadarConfigError:
            raise
        except ValueError as error:
            raise RadarConfigError(f"{path}: preset '{preset or config['default_preset']}': {error}") from error
        made = made.placed(position=position, orientation=orientation, look_at=look_at)
        return made if trajectory is None else replace(made, trajectory=trajectory)

    def placed(
        self, *, position: Vector | None = None, orientation: Vector | None = None, look_at: Vector | None = None
    ) -> Radar:
        """A copy at another pose [m, rad]; None keeps a value, `look_at` [m] replaces `orientation`, without roll.

        Raises
        ------
        ValueError
            The radar has a trajectory.
        """
        if self.trajectory is not None:
            if position is None and orientation is None and look_at is None:
                return self
            raise ValueError(f"radar '{self.name}' moves on its trajectory: take radar.at(t) to place it elsewhere")
        position = vector("position", self.position if position is None else position)
        orientation = vector("orientation", self.orientation if orientation is None else orientation)
        if look_at is not None:
            orientation = look_at_angles(position, vector("look_at", look_at))
        return replace(self, position=position, orientation=orientation)

    def pose(self, t: float) -> tuple[Vector, Vector]:
        """World position [m] and yaw, pitch, roll [rad] at time `t` [s]."""
        if self.trajectory is None:
            return self.position, self.orientation
        return pose_at(self.trajectory, t, self.orientation, "radar.")

    def at(self, t: float) -> Radar:
        """The radar at rest at its pose of time `t` [s]."""
        if self.trajectory is None:
            return self
        position, orientation = self.pose(t)
        return replace(self, position=position, orientation=orientation, trajectory=None)

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation from the device to the world frame."""
        return rotation_matrix(self.orientation)

    @property
    def tx_world(self) -> FloatArray:
        """(tx, 3) element positions in the world frame [m]."""
        return self.tx_positions @ self.rotation.T + np.asarray(self.position)

    @property
    def rx_world(self) -> FloatArray:
        """(rx, 3) element positions in the world frame [m]."""
        return self.rx_positions @ self.rotation.T + np.asarray(self.position)

    @property
    def tx_field(self) -> FloatArray:
        """(3,) direction of the Tx elements' electric field at boresight, world frame."""
        return self.rotation @ np.asarray(POLARIZATIONS[self.tx_polarization])

    @property
    def rx_field(self) -> FloatArray:
        """(3,) direction of the Rx elements' electric field at boresight, world frame."""
        return self.rotation @ np.asarray(POLARIZATIONS[self.rx_polarization])

    @property
    def virtual_positions(self) -> FloatArray:
        """(tx, rx, 3) sums of Tx and Rx positions [m], device frame; the phase is k times their projection."""
        return self.tx_positions[:, None, :] + self.rx_positions[None, :, :]

    @property
    def feed_factors(self) -> tuple[ComplexArray, ComplexArray]:
        """(tx,) and (rx,) factors exp(j phase) of the elements' feeds, on the wave; the mixer conjugates them."""
        tx, rx = self.tx_phases_deg or (0.0,) * len(self.tx_names), self.rx_phases_deg or (0.0,) * len(self.rx_names)
        return phasors(np.array(tx)), phasors(np.array(rx))

    @property
    def center_frequency(self) -> float:
        """Middle of the sampled band [Hz]."""
        return self.waveform.center_frequency

    @property
    def wavelength(self) -> float:
        """Wavelength at `center_frequency` [m]."""
        return self.waveform.wavelength

    @property
    def range_resolution(self) -> float:
        """Range resolution [m]."""
        return self.waveform.range_resolution

    @property
    def range_window(self) -> float:
        """Largest range whose beat frequency the ADC takes [m]: the waveform's, half of it with real samples."""
        return self.waveform.range_window * (0.5 if self.adc.real else 1.0)

    @property
    def max_range(self) -> float:
        """Lesser of `range_window` and the waveform's `range_limit` [m]."""
        limit = self.waveform.range_limit
        return self.range_window if limit is None else min(limit, self.range_window)

    @property
    def velocity_resolution(self) -> float:
        """Velocity resolution [m/s]."""
        return self.waveform.velocity_resolution

    @property
    def max_velocity(self) -> float:
        """Largest unambiguous radial speed [m/s]."""
        return self.waveform.max_velocity

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names along the cube's axis "tx": Tx elements, or the elements of each slot."""
        wave = self.waveform
        if not wave.slots or wave.separated:
            return self.tx_names
        return tuple(f"{index}:{slot_label(slot, self.tx_names)}" for index, slot in enumerate(wave.slots))

    @property
    def sample_type(self) -> np.dtype[Any]:
        """Type of the samples in cubes and files: complex64, or float32 with a real ADC."""
        return np.dtype(np.float32 if self.adc.real else np.complex64)

    @property
    def axis_kind(self) -> str:
        """Entries of the axis `tx`: "Tx" (elements) or "slots"."""
        return "Tx" if self.axis_names == self.tx_names else "slots"

    @property
    def cell_text(self) -> str:
        """Cells and limits of range and velocity, such as "cells 4.8 cm to 10.99 m and 7.8 cm/s to ±4.93 m/s"."""
        ranges = f"{100 * self.range_resolution:.3g} cm to {self.max_range:.4g} m and "
        velocities = f"{100 * self.velocity_resolution:.3g} cm/s to ±{self.max_velocity:.3g} m/s"
        return f"cells {ranges if np.isfinite(self.range_resolution) else ''}{velocities}"

    def _facts(self) -> Iterable[str]:
        wave, (low, high) = self.waveform, self.waveform.sampled_band
        yield f"{self.name!r} ({self.preset})"
        yield f"{low / 1e9:.2f} … {high / 1e9:.2f} GHz"
        yield f"{len(self.tx_names)} Tx × {len(self.rx_names)} Rx, {wave.multiplexing}"
        yield f"{wave.num_loops} loops × {wave.num_samples} {'real' if self.adc.real else 'complex'} samples"
        yield f"a frame each {1e3 * wave.frame_period:.4g} ms"
        yield self.cell_text
        yield f"at {short_vector(self.position)} m"
        yield f"yaw, pitch, roll {short_vector(np.degrees(self.orientation))}°"
        yield "" if self.trajectory is None else "moving"

    @property
    def frame_shape(self) -> tuple[int, int, int, int]:
        """(chirp, tx, rx, sample) of a frame; "tx" counts slots if several Tx elements fire at once."""
        wave = self.waveform
        return wave.num_loops, len(wave.axis_slots), len(self.rx_positions), wave.num_samples

    def of_profile(self, number: int) -> Radar:
        """The radar of one profile's chirps: their slots, times and Tx elements.

        Raises
        ------
        ValueError
            There is no such profile.
        """
        wave = self.waveform.of_profile(number)
        if wave is self.waveform:
            return self
        if not wave.slope:  # a constant frequency has no window of its own
            wave = replace(wave, range_limit=self.max_range)
        used = self.waveform.profile_tx(number)
        return replace(
            self,
            waveform=wave,
            tx_names=tuple(self.tx_names[tx] for tx in used),
            tx_positions=self.tx_positions[list(used)],
            tx_phases_deg=tuple(self.tx_phases_deg[tx] for tx in used) if self.tx_phases_deg else (),
        )

    def to_dict(self) -> dict[str, Any]:
        """Record of the radar in SI units, for JSON.

        Raises
        ------
        ValueError
            The trajectory is a function: files store :class:`Trajectory` only.
        """
        record = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "trajectory"}
        for name in ("tx_names", "rx_names", "position", "orientation"):
            record[name] = list(record[name])
        for name in ("tx_positions", "rx_positions"):
            record[name] = record[name].tolist()
        for name in ("tx_phases_deg", "rx_phases_deg", "frequency_range"):
            if values := record.pop(name):
                record[name] = list(values)
        record |= {"waveform": waveform_record(self.waveform), "pattern": pattern_record(self.pattern)}
        record["adc"] = {key: value for key, value in asdict(self.adc).items() if value is not False}
        if self.trajectory is None:
            return record
        if not isinstance(self.trajectory, Trajectory):
            raise ValueError(
                f"radar.trajectory is a {type(self.trajectory).__name__}, which no file can hold: "
                "Trajectory(times, positions, orientations) can be stored"
            )
        return record | {"trajectory": self.trajectory.to_dict()}

    def to_cfg(self) -> str:
        """The frame as a `.cfg` of TI's mmWave SDK 3, or MCU+ SDK (real samples, four Tx, DDM); not the pose.

        Values are written as they are; where the device has steps, a comment states what it makes of them. Read back
        (:meth:`load`, with the board), the text gives the same waveform.

        Raises
        ------
        RadarConfigError
            A device of TI has no such frame; the message names field, value and limit.
        """
        tx, rx = element_numbers(self.tx_names, "TX"), element_numbers(self.rx_names, "RX")
        feeds = np.multiply.outer(*self.feed_factors)
        full = board_power(self.name)
        return cfg_text(
            *(self.name, self.preset, self.waveform, tx, rx),
            feeds=feeds,
            backoff_db=0.0 if full is None else full - self.tx_power_dbm,
            real=self.adc.real,
            bits=self.adc.bits,
            streamed=self.adc.real or self.adc.iq_swap,
        )

    @classmethod
    def from_dict(cls, record: dict[str, Any]) -> Radar:
        """Inverse of :meth:`to_dict`."""
        return cls(**fields_from_record(record, tuple(cls.__dataclass_fields__)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Radar):
            return NotImplemented
        here, there = (replace(radar, trajectory=None).to_dict() for radar in (self, other))
        return here == there and self.trajectory == other.trajectory

    def __hash__(self) -> int:
        return hash((self.name, self.preset, self.waveform, self.pattern, self.position, self.orientation))
