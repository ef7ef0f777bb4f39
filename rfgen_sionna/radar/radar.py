"""A monostatic TDM-MIMO FMCW radar and its pose."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.config import RadarConfigError, overridden, read_config
from rfgen_sionna.radar.device import radar_fields
from rfgen_sionna.radar.pattern import Pattern, pattern_from_record, pattern_record
from rfgen_sionna.radar.pose import POLARIZATIONS, Vector, look_at_angles, rotation_matrix, vector
from rfgen_sionna.radar.waveform import Waveform
from rfgen_sionna.records import FloatArray
from rfgen_sionna.resources import available, resolve


def _keys(what: str, record: Any, known: Iterable[str], optional: Iterable[str] = ()) -> dict[str, Any]:
    """`record` as a dictionary, or an error that names the key it should not have, or lacks."""
    if not isinstance(record, Mapping):
        raise ValueError(f"{what} is {record!r}: a table with the keys {', '.join(known)} is needed")
    if unknown := set(record) - set(known):
        raise ValueError(f"{what} has the unknown key '{min(unknown)}'; known: {', '.join(known)}")
    if missing := set(known) - set(record) - set(optional):
        raise ValueError(f"{what} lacks the key '{min(missing)}'; needed: {', '.join(known)}")
    return dict(record)


@dataclass(frozen=True, eq=False)
class Radar:
    """Element positions, waveform, power, noise and pose of one radar.

    Device frame: boresight +x, z up, y to the left. Only the Tx elements that the preset fires are listed.
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

    def __post_init__(self) -> None:
        for name in ("tx_positions", "rx_positions"):
            array = np.array(getattr(self, name), dtype=np.float64)  # a copy: it becomes read-only
            if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0 or not np.all(np.isfinite(array)):
                raise ValueError(f"radar.{name} has shape {array.shape}: finite (element, 3) positions [m] are needed")
            if np.abs(array).max() > 10.0:
                raise ValueError(
                    f"radar.{name} reaches {np.abs(array).max():g} m: elements lie within 10 m of the centre"
                )
            gaps = np.linalg.norm(array[:, None] - array[None], axis=-1) + np.eye(len(array))
            if gaps.min() < 1e-6:
                i, j = np.argwhere(gaps < 1e-6)[0]
                raise ValueError(f"radar.{name}: elements {i} and {j} are at the same place {array[i].tolist()} m")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
            names = tuple(getattr(self, f"{name[:2]}_names"))
            if len(names) != len(array) or len(set(names)) != len(names):
                raise ValueError(
                    f"radar.{name[:2]}_names is {names!r}: a different name for each of {len(array)} elements"
                )
        if len(self.waveform.tx_order) != len(self.tx_positions):
            raise ValueError(
                f"radar has {len(self.tx_positions)} Tx elements; waveform.tx_order fires {len(self.waveform.tx_order)}"
            )
        for name in ("tx_polarization", "rx_polarization"):
            if getattr(self, name) not in POLARIZATIONS:
                raise ValueError(f"radar.{name} is {getattr(self, name)!r}; allowed: {', '.join(POLARIZATIONS)}")
        if not (np.isfinite(self.tx_power_dbm) and -60 <= self.tx_power_dbm <= 80):
            raise ValueError(f"radar.tx_power_dbm is {self.tx_power_dbm!r}: a value in -60 … 80 dBm is needed")
        if not (np.isfinite(self.noise_figure_db) and 0 <= self.noise_figure_db <= 60):
            raise ValueError(f"radar.noise_figure_db is {self.noise_figure_db!r}: a value in 0 … 60 dB is needed")
        if not (np.isfinite(self.temperature) and 0 <= self.temperature <= 2000):
            raise ValueError(f"radar.temperature is {self.temperature!r}: a value in 0 … 2000 K is needed")
        object.__setattr__(self, "position", vector("position", self.position))
        object.__setattr__(self, "orientation", vector("orientation", self.orientation))

    # -- making one ---------------------------------------------------------------------------------------

    @classmethod
    def available(cls) -> dict[str, tuple[str, ...]]:
        """Names of the radars that ship with the package, each with its presets."""
        return {name: tuple(read_config(resolve("radars", name))["preset"]) for name in available("radars")}

    @classmethod
    def load(
        cls,
        radar: str | os.PathLike[str],
        preset: str | None = None,
        *,
        position: Vector = (0.0, 0.0, 0.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        look_at: Vector | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> Radar:
        """Read a radar from `radars/<name>.toml` or from a TOML file of your own.

        Parameters
        ----------
        radar
            Name of a shipped radar, or the path of a TOML file in the same format.
        preset
            Name of a configuration in that file; its `default_preset` if None.
        position, orientation
            World position [m]; yaw, pitch, roll [rad] in Sionna's convention.
        look_at
            World point [m] that the boresight shall hit; replaces `orientation`, without roll.
        overrides
            Values to take instead of the file's, under its dotted keys: `{"receiver.noise_figure_db": 12.0,
            "pattern": {"kind": "sionna:tr38901"}}`. They are checked as the file is.

        Raises
        ------
        RadarConfigError, ValueError
            Naming the key, the value and what is allowed.
        """
        if not isinstance(radar, (str, os.PathLike)) or not str(radar):
            raise RadarConfigError(
                f"radar is {radar!r}: the path of a TOML file or one of {', '.join(available('radars'))} is needed"
            )
        path = Path(radar)
        path = path if path.suffix == ".toml" else resolve("radars", str(radar))
        if not path.is_file():
            shipped = ", ".join(available("radars"))
            raise RadarConfigError(f"radar file {path} does not exist; shipped radars: {shipped}")
        config = read_config(path)
        if overrides:
            config = overridden(config, overrides, str(path))
        try:
            made = cls(**radar_fields(config, preset, str(path)))
        except RadarConfigError:
            raise
        except ValueError as error:
            raise RadarConfigError(f"{path}: preset '{preset or config['default_preset']}': {error}") from error
        return made.placed(position=position, orientation=orientation, look_at=look_at)

    def placed(
        self,
        *,
        position: Vector | None = None,
        orientation: Vector | None = None,
        look_at: Vector | None = None,
    ) -> Radar:
        """The same radar elsewhere; `look_at` [m] replaces `orientation`, without roll."""
        position = vector("position", self.position if position is None else position)
        orientation = vector("orientation", self.orientation if orientation is None else orientation)
        if look_at is not None:
            orientation = look_at_angles(position, vector("look_at", look_at))
        return replace(self, position=position, orientation=orientation)

    # -- derived ------------------------------------------------------------------------------------------

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) device to world."""
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
        """(tx, rx, 3) sum of Tx and Rx position [m], device frame: phase is k times its projection on the direction."""
        return self.tx_positions[:, None, :] + self.rx_positions[None, :, :]

    @property
    def center_frequency(self) -> float:
        """Middle of the sampled band [Hz]."""
        return self.waveform.center_frequency

    @property
    def wavelength(self) -> float:
        """At `center_frequency` [m]."""
        return self.waveform.wavelength

    @property
    def range_resolution(self) -> float:
        """[m]"""
        return self.waveform.range_resolution

    @property
    def max_range(self) -> float:
        """[m]"""
        return self.waveform.max_range

    @property
    def velocity_resolution(self) -> float:
        """[m/s]"""
        return self.waveform.velocity_resolution

    @property
    def max_velocity(self) -> float:
        """[m/s]"""
        return self.waveform.max_velocity

    # -- storage ------------------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Everything that makes up the radar, in SI units, ready for JSON."""
        return {
            "name": self.name,
            "preset": self.preset,
            "waveform": {key: getattr(self.waveform, key) for key in Waveform.__dataclass_fields__}
            | {"tx_order": list(self.waveform.tx_order)},
            "tx_names": list(self.tx_names),
            "rx_names": list(self.rx_names),
            "tx_positions": self.tx_positions.tolist(),
            "rx_positions": self.rx_positions.tolist(),
            "pattern": pattern_record(self.pattern),
            "tx_polarization": self.tx_polarization,
            "rx_polarization": self.rx_polarization,
            "tx_power_dbm": self.tx_power_dbm,
            "noise_figure_db": self.noise_figure_db,
            "temperature": self.temperature,
            "position": list(self.position),
            "orientation": list(self.orientation),
            "adc": {"bits": self.adc.bits, "full_scale_dbm": self.adc.full_scale_dbm},
        }

    @classmethod
    def from_dict(cls, record: dict[str, Any]) -> Radar:
        """Inverse of :meth:`to_dict`."""
        if isinstance(record, Mapping) and "polarization" in record:  # older runs have one for both ends
            record = dict(record)
            record["tx_polarization"] = record["rx_polarization"] = record.pop("polarization")
        record = _keys("radar record", record, cls.__dataclass_fields__, optional=("position", "orientation", "adc"))
        waveform = _keys("radar record: waveform", record["waveform"], Waveform.__dataclass_fields__)
        fields: dict[str, Any] = record | {
            "waveform": Waveform(**waveform),
            "pattern": pattern_from_record(record["pattern"], partial(_keys, "radar record: pattern")),
        }
        if "adc" in record:  # records of older runs have none
            fields["adc"] = Adc(**_keys("radar record: adc", record["adc"], Adc.__dataclass_fields__))
        return cls(**fields | {key: tuple(record[key]) for key in ("tx_names", "rx_names")})

    def __eq__(self, other: object) -> bool:
        return self.to_dict() == other.to_dict() if isinstance(other, Radar) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.name, self.preset, self.waveform, self.pattern, self.position, self.orientation))
