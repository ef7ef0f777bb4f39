"""Materials of the parts of a mesh file, by the names in the file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from rfgen_sionna.scene.material_words import canonical_name, suggested_material
from rfgen_sionna.scene.materials import MATERIALS, Material, choices
from rfgen_sionna.scene.mesh_files import MeshPart
from rfgen_sionna.scene.scene_errors import MaterialError

_COPY = re.compile(r"\.\d{3}$")
"""Ending of the name of a copy in Blender: "Glass.001"."""


def label_parts(
    parts: Sequence[MeshPart],
    given: str | Mapping[str, str | Material],
    owner: str,
    default: str | Material | None = None,
    argument: str = "material",
    one: str = "material",
    call: str = "",
) -> tuple[list[str], dict[str, str | Material]]:
    """Label of each part, the name of its material or object, and the material of each label.

    Args:
        parts: parts of a file.
        given: materials by names of objects or else materials in the file; an empty text for none. A copy of Blender
            ("Glass.001") has the material of its original.
        owner: name of the mesh or scene, for messages.
        default: material of parts with unknown names; None refuses them.
        argument, one, call: names of the arguments for `given` and for one material of all parts, and of their
            function, for messages.

    Raises:
        MaterialError: names of parts are unknown, or `given` has others.
        TypeError: `given` is neither a text nor a mapping.
    """
    if not isinstance(given, Mapping):
        if not isinstance(given, str):
            raise TypeError(
                f"{owner}: {argument}: {given!r} given, the name of a material, a Material or a mapping from names in "
                f"the file to materials is needed; {choices()}"
            )
        given = {}
    labels, materials, unknown, known = list[str](), dict[str, str | Material](), dict[str, str](), set[str]()
    for part in parts:
        names = [name for name in (part.material, part.name) if name]
        keys = [key for name in names for key in (name, _COPY.sub("", name))]
        known.update(keys)
        label = names[0] if names else owner
        chosen: str | Material | None = None
        of_objects = (part.name, _COPY.sub("", part.name))  # more specific than a material
        if key := next((key for key in (*of_objects, *keys) if key and key in given), ""):
            chosen, label = given[key], key
        elif key := next((key for key in keys if canonical_name(key) in MATERIALS), ""):
            chosen, label = canonical_name(key), key
        elif default is not None:
            chosen = default
        else:
            unknown[label] = suggested_material(label) or "…"
        labels.append(label)
        if chosen is not None:
            materials[label] = chosen
    there = ", ".join(dict.fromkeys(repr(name) for part in parts for name in (part.material, part.name) if name))
    if stray := [repr(key) for key in given if key not in known]:
        raise MaterialError(
            f"{owner}: {argument} names {', '.join(stray)}, which no part has; materials and objects of the file are "
            f"{there or 'without names'}"
        )
    if unknown:
        example = ", ".join(f"{name!r}: {guess!r}" for name, guess in unknown.items())
        listed = ", ".join(map(repr, unknown))
        what = f"no known material for {listed}; give {call}{one}='metal' for all of them, or "
        what += f"{argument}={{{example}}} with a material for each"
        raise MaterialError(f"{owner}: {what if there else 'no material given'}; {choices()}")
    return labels, materials
