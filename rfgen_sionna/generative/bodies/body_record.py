"""Bodies as records for files: parameters of the body model, from which the same mesh is built again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.anny_rig import build_rig, rest_shape
from rfgen_sionna.generative.bodies.fitted_body import fitted_body
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence
from rfgen_sionna.generative.bodies.vital_signs import VitalSigns, skin_directions

PROBES = 12
"""Vertices of the rest pose in a record, which tell another version of the body model."""
TOLERANCE = 1e-5
"""Largest distance [m] of the vertices of a body that is built again from those of the recorded one."""
_DEPTHS = ("belly_depth", "chest_depth", "heart_depth")


class BodyRecordError(ValueError):
    """A body has no record, or its record makes another body here."""


def body_record(sequence: BodySequence) -> dict[str, Any]:
    """Record of a body, ready for JSON.

    Raises
    ------
    BodyRecordError
        If the body is none of anny's parameters, such as one of the user's own model files.
    ImportError
        If anny (or torch) is not installed.
    """
    rig = sequence.rig
    fitted = rig.fitted_from
    parameters = rig.parameters if fitted is None else fitted[0]
    if parameters is None:
        raise BodyRecordError("its body has no parameters of anny's")
    record: dict[str, Any] = {"model": "anny", "parameters": {key: float(value) for key, value in parameters.items()}}
    if fitted is not None:
        record["offsets"] = np.asarray(fitted[1], np.float64).tolist()
    made = rest_shape(record["parameters"])[0] if fitted is None else _built(_shape_text(record)).vertices
    if made.shape != rig.vertices.shape or not np.allclose(made, rig.vertices, rtol=0, atol=TOLERANCE):
        raise BodyRecordError("its vertices are not those of its parameters")
    record["probes"] = np.round(rig.vertices[_probes(rig)], 7).tolist()
    signs = sequence.vital_signs
    record["skin"] = None if signs is None else {name: float(getattr(signs, name)) for name in _DEPTHS}
    return record


def rig_of(record: Mapping[str, Any]) -> Rig:
    """The body of a record; equal records share one.

    Raises
    ------
    BodyRecordError
        If the body model of this machine makes another body of it.
    ImportError
        If anny (or torch) is not installed.
    """
    rig = _built(_shape_text(record))
    here, there = rig.vertices[_probes(rig)], np.asarray(record["probes"])
    if here.shape != there.shape or np.abs(here - there).max() > TOLERANCE:
        raise BodyRecordError("the body model makes another body of these parameters than when they were recorded")
    return rig


def posed_vertices(
    record: Mapping[str, Any], rotations: FloatArray, root: FloatArray, volume: float, pulse: float
) -> FloatArray:
    """(vertex, 3) positions [m] of a body in one pose.

    Parameters
    ----------
    record
        Of :func:`body_record`.
    rotations
        (bone, 3, 3) world rotations relative to the mesh's rest pose.
    root
        (3,) world position of the root joint [m].
    volume, pulse
        Inflation by the breath and heartbeat, 0 … 1.
    """
    rig = rig_of(record)
    skin = rig.skin(rotations, root)
    if record.get("skin") is None:
        return skin
    breath, beat = _skin_directions(_shape_text(record), tuple(record["skin"][name] for name in _DEPTHS))
    return skin + rig.turn(volume * breath + pulse * beat, rotations)


@lru_cache(maxsize=8)
def _built(text: str) -> Rig:
    record = json.loads(text)
    rig = build_rig(record["parameters"])
    if "offsets" in record:
        return fitted_body(rig, np.asarray(record["offsets"]))
    return rig


@lru_cache(maxsize=8)
def _skin_directions(text: str, depths: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    given: dict[str, Any] = dict(zip(_DEPTHS, depths, strict=True))
    return skin_directions(_built(text), VitalSigns(**given))


def _shape_text(record: Mapping[str, Any]) -> str:
    """The part of a record that determines the shape."""
    return json.dumps({key: value for key, value in record.items() if key not in ("probes", "skin")})


def _probes(rig: Rig) -> slice:
    return slice(None, None, max(1, len(rig.vertices) // PROBES))
