"""Materials of this package as Sionna's radio materials, and retuning of Sionna scenes.

:func:`~rfgen_sionna.scene.mitsuba_backend.ensure_backend` must have run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any
from xml.etree import ElementTree

from rfgen_sionna.scene.materials import Material, material
from rfgen_sionna.scene.permittivity import ComputedPermittivity, Outside
from rfgen_sionna.scene.scattering import ScatteringPattern
from rfgen_sionna.scene.scene_errors import MaterialError

PLUGIN = "rfgen-radio-material"
"""Mitsuba's plugin name of the materials of this package."""
PREFIX = "rfgen_"
"""Prefix of the ids of the materials of this package, as `itu_` of Sionna's."""
_COLOURS = ("color", "reflectance", "base_color")


def sionna_material(
    of: str | Material, name: str | None = None, thickness: float | None = None, outside: Outside = "extrapolate"
) -> Any:
    """A `sionna.rt.RadioMaterial` whose permittivity follows `scene.frequency`.

    Args:
        of: a material, or its name in :data:`rfgen_sionna.scene.MATERIALS`.
        name: name in the Sionna scene; None takes the material's own.
        thickness: slab thickness [m]; None takes the material's own, else Sionna's default (0.1 m).
        outside: policy at frequencies that are not covered, for a material given by name.

    Raises:
        MaterialError: the name is unknown.
    """
    from rfgen_sionna.scene.mitsuba_backend import ensure_backend

    ensure_backend()
    from sionna.rt import RadioMaterial

    found = material(of, outside=outside) if isinstance(of, str) else of
    return RadioMaterial(
        name=name or found.name,
        thickness=found.thickness if thickness is None else thickness,
        scattering_coefficient=found.scattering_coefficient,
        xpd_coefficient=found.xpd_coefficient,
        frequency_update_callback=_callback(found),
        **found.scattering_pattern.of_sionna,
    )


def retune(scene: Any, outside: Outside = "extrapolate") -> None:
    """Give the ITU materials of a `sionna.rt.Scene`, and those of this package, the permittivities of this package.

    Within the ranges of ITU-R P.2040 nothing changes. "raise" extrapolates here, since an error in a callback would
    leave the scene half retuned; :meth:`rfgen_sionna.scene.RadarScene.tune` checks beforehand.
    """
    for radio_material in scene.radio_materials.values():
        kind = _type_of(radio_material)
        if kind and not hasattr(radio_material, "rfgen_material"):
            policy: Outside = "clamp" if outside == "clamp" else "extrapolate"
            radio_material.frequency_update_callback = _callback(material(kind, outside=policy))


def follow(radio_material: Any, of: Material) -> None:
    """Give a Sionna material the permittivity, thickness and roughness of a material of this package."""
    radio_material.frequency_update_callback = _callback(of)
    radio_material.rfgen_material = of
    if of.thickness is not None:
        radio_material.thickness = of.thickness
    radio_material.scattering_coefficient = of.scattering_coefficient
    radio_material.xpd_coefficient = of.xpd_coefficient


def _type_of(radio_material: Any) -> str:
    """Name of the table entry of a Sionna material; empty for a material with its own constants."""
    return str(getattr(radio_material, "itu_type", "") or getattr(radio_material, "rfgen_type", ""))


def from_sionna(radio_material: Any, outside: Outside = "extrapolate") -> Material:
    """Material of a Sionna scene, with its thickness and roughness there.

    ITU materials and those of this package follow `scene/material_table.py`; any other `RadioMaterial` keeps its
    constants or its callback.

    Raises:
        MaterialError: `radio_material` is no `sionna.rt.RadioMaterial`.
    """
    import mitsuba as mi
    from sionna.rt import RadioMaterial

    if not isinstance(radio_material, RadioMaterial):
        raise MaterialError(
            f"material {radio_material.name!r} is a {type(radio_material).__name__} without permittivity, "
            "a sionna.rt.RadioMaterial is needed"
        )
    if given := getattr(radio_material, "rfgen_material", None):
        return replace(given, thickness=_number(radio_material.thickness))
    if kind := _type_of(radio_material):
        found = material(kind, outside=outside)
    else:
        callback = radio_material.frequency_update_callback
        if callback is None:
            constants = _number(radio_material.relative_permittivity), _number(radio_material.conductivity)
            model = ComputedPermittivity(lambda frequency: constants)
        else:
            model = ComputedPermittivity(lambda frequency: _pair(callback(mi.Float(frequency))))
        found = Material(radio_material.name, model, f"Sionna material {radio_material.name!r} of the scene")
    return replace(
        found,
        thickness=_number(radio_material.thickness),
        scattering_coefficient=_number(radio_material.scattering_coefficient),
        scattering_pattern=ScatteringPattern.from_sionna(radio_material.scattering_pattern),
        xpd_coefficient=_number(radio_material.xpd_coefficient),
    )


@cache
def register(variant: str) -> None:
    """Register :data:`PLUGIN` in Mitsuba's active `variant`: permittivities of this package in Sionna's slab model."""
    import mitsuba as mi
    from sionna.rt import ITURadioMaterial, RadioMaterial

    class RadarMaterial(RadioMaterial):
        """A `RadioMaterial` whose property `type` names a material of this package."""

        def __init__(self, props: Any) -> None:
            found = material(str(props["type"]), owner=f"material {props.id()!r} of the scene")
            del props["type"]
            if not any(key in props for key in _COLOURS):
                # Without a colour Sionna draws one from NumPy's global generator.
                props["color"] = mi.ScalarColor3f(ITURadioMaterial.ITU_MATERIAL_COLORS.get(found.name, (0.6, 0.5, 0.5)))
            self.rfgen_type = found.name
            super().__init__(props=props, frequency_update_callback=_callback(found))

    mi.register_bsdf(PLUGIN, lambda props: RadarMaterial(props))


def with_radio_materials(description: str, chosen: Mapping[str, str]) -> str:
    """Scene description with the materials `chosen`, names of this package by ids, in place of those of other plugins.

    Args:
        description: XML before Sionna's `process_xml`, which takes ITU materials only.
    """
    if not chosen:
        return description
    root = ElementTree.fromstring(description)
    for bsdf in [*root.findall("./bsdf"), *root.findall(".//shape/bsdf")]:
        name = bsdf.get("id", "")
        if name not in chosen:
            continue
        colour = next((c for key in _COLOURS if (c := bsdf.find(f".//rgb[@name='{key}']")) is not None), None)
        bsdf.clear()
        bsdf.set("type", "itu-radio-material")  # replaced after `process_xml`, which refuses others of ITU's names
        bsdf.set("id", name)
        bsdf.append(ElementTree.Element("string", {"name": "type", "value": chosen[name]}))
        if colour is not None:
            bsdf.append(ElementTree.Element("rgb", {"name": "color", "value": colour.get("value", "")}))
    return ElementTree.tostring(root, encoding="unicode")


def use_our_materials(description: str) -> str:
    """Scene description with the materials of this package in place of ITU materials and of ids `rfgen_NAME` (or
    `mat-rfgen_NAME`), whose constants serve readers without this package.

    Args:
        description: XML after Sionna's `process_xml`.
    """
    root = ElementTree.fromstring(description)
    for bsdf in root.iter("bsdf"):
        name = bsdf.get("id", "").removeprefix("mat-")
        if name.startswith(PREFIX):
            for constant in ("relative_permittivity", "conductivity", "type"):
                for element in bsdf.findall(f"*[@name='{constant}']"):
                    bsdf.remove(element)
            bsdf.append(ElementTree.Element("string", {"name": "type", "value": name.removeprefix(PREFIX)}))
        elif bsdf.get("type") != "itu-radio-material":
            continue
        bsdf.set("type", PLUGIN)
    return ElementTree.tostring(root, encoding="unicode")


def _callback(found: Material) -> Callable[[Any], tuple[float, float]]:
    def update(frequency: Any) -> tuple[float, float]:
        value = _number(frequency)
        eps = complex(found.relative_permittivity(value))
        return eps.real, float(found.conductivity(value))

    return update


def _pair(values: tuple[Any, Any]) -> tuple[float, float]:
    return _number(values[0]), _number(values[1])


def _number(value: Any) -> float:
    """Float of a Dr.Jit scalar or a number."""
    return float(value[0] if hasattr(value, "__getitem__") else value)
