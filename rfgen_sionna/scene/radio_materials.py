"""Our materials as Sionna's: a `RadioMaterial` that follows the scene's frequency, and retuning of loaded scenes.

Needs a Mitsuba variant: call :func:`rfgen_sionna.scene.mitsuba_backend.ensure_backend` first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any
from xml.etree import ElementTree

from rfgen_sionna.scene.materials import Material, material
from rfgen_sionna.scene.permittivity import ComputedPermittivity, Outside
from rfgen_sionna.scene.scattering import ScatteringPattern
from rfgen_sionna.scene.scene_errors import MaterialError

PLUGIN = "rfgen-radio-material"
"""Mitsuba's name for our materials in scene descriptions."""
PREFIX = "rfgen_"
"""Prefix of the ids of our materials, as `itu_` is of Sionna's."""


def sionna_material(
    of: str | Material,
    name: str | None = None,
    thickness: float | None = None,
    outside: Outside = "extrapolate",
) -> Any:
    """A `sionna.rt.RadioMaterial` whose permittivity follows `scene.frequency`.

    Args:
        of: a material of ours, or its name.
        name: what it is called within the Sionna scene; the material's own name where it is not given.
        thickness: slab thickness [m]; the material's own, else Sionna's default (0.1 m), where it is not given.
        outside: policy for frequencies not covered, where a name is given.

    Raises:
        MaterialError: unknown name.
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
    """Let every ITU material of a `sionna.rt.Scene`, and every one of ours, follow our tables at any frequency.

    Within the ranges of ITU-R P.2040 nothing changes. With "raise" they extrapolate as well: a callback that raised
    would leave the Sionna scene with the new frequency and half of the old materials, so
    :meth:`rfgen_sionna.scene.RadarScene.tune` checks beforehand.
    """
    for radio_material in scene.radio_materials.values():
        kind = _type_of(radio_material)
        if kind:
            policy: Outside = "clamp" if outside == "clamp" else "extrapolate"
            radio_material.frequency_update_callback = _callback(material(kind, outside=policy))


def _type_of(radio_material: Any) -> str:
    """Name of the table entry behind a Sionna material, empty where it has its own constants."""
    return str(getattr(radio_material, "itu_type", "") or getattr(radio_material, "rfgen_type", ""))


def from_sionna(radio_material: Any, outside: Outside = "extrapolate") -> Material:
    """The properties of a material of a Sionna scene, with the thickness and roughness it has there.

    ITU materials and ours follow our tables; any other `RadioMaterial` keeps its own constants or its own callback.

    Raises:
        MaterialError: it is no `sionna.rt.RadioMaterial` (an absorber, say).
    """
    import mitsuba as mi
    from sionna.rt import RadioMaterial

    if not isinstance(radio_material, RadioMaterial):
        raise MaterialError(
            f"material {radio_material.name!r} is a {type(radio_material).__name__} without permittivity, "
            "a sionna.rt.RadioMaterial is needed"
        )
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
    """Make Mitsuba, in its active `variant`, know :data:`PLUGIN`: our permittivities on Sionna's slab model."""
    import mitsuba as mi
    from sionna.rt import ITURadioMaterial, RadioMaterial

    class RadarMaterial(RadioMaterial):
        """A `RadioMaterial` whose property `type` names a material of ours."""

        def __init__(self, props: Any) -> None:
            found = material(str(props["type"]), owner=f"material {props.id()!r} of the scene")
            del props["type"]
            if not any(key in props for key in ("color", "reflectance", "base_color")):
                # Sionna would draw a colour from NumPy's global generator.
                props["color"] = mi.ScalarColor3f(ITURadioMaterial.ITU_MATERIAL_COLORS.get(found.name, (0.6, 0.5, 0.5)))
            self.rfgen_type = found.name
            super().__init__(props=props, frequency_update_callback=_callback(found))

    mi.register_bsdf(PLUGIN, lambda props: RadarMaterial(props))


def use_our_materials(description: str) -> str:
    """Rewrite a scene description so that its materials follow our tables.

    Sionna's ITU materials are replaced, and those whose id starts with `rfgen_` (or `mat-rfgen_`): what follows names
    a material of ours, and the constants in them serve readers without this package.

    Args:
        description: XML that Sionna's `process_xml` has seen.
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
    """A Dr.Jit scalar, or a number, as a float."""
    return float(value[0] if hasattr(value, "__getitem__") else value)
