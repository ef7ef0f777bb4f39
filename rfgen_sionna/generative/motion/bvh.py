"""BVH motion-capture files with a human skeleton."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.joint_layouts import split_name
from rfgen_sionna.generative.motion.joint_recording import complete
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.scene.mesh_files import to_z_up

_LOG = logging.getLogger(__name__)
_LIMBS = {
    "hip": "thigh thighbend upleg upperleg hipjoint hip",
    "knee": "shin calf leg lowleg lowerleg knee",
    "ankle": "foot ankle",
    "foot": "toe toe0 toe1 toebase toes ball toeend",
    "collar": "collar clavicle shoulder",
    "shoulder": "arm upperarm uparm uarm shldr shldrbend",
    "elbow": "forearm forearmbend lowarm lowerarm farm elbow",
    "wrist": "hand wrist",
}
"""Joint of a limb -> names of other programs without side."""
_TRUNK = {"pelvis": "hips hip pelvis root spinebase hipcenter", "neck": "neck neck1 shouldercenter", "head": "head"}
_WORDS = {word: joint for joint, words in _LIMBS.items() for word in words.split()}
_TRUNK_WORDS = {word: joint for joint, words in _TRUNK.items() for word in words.split()}
_UNITS = {1.0: "metres", 0.1: "decimetres", 0.0254: "inches", 0.01: "centimetres", 0.001: "millimetres"}
"""Units of length of other programs [m]."""
_UPRIGHT = 0.7
"""Least cosine between spine and an axis for that axis to be up."""


@dataclass
class _Node:
    name: str
    parent: int
    offset: FloatArray
    channels: list[str] = field(default_factory=list)


def bvh_positions(
    path: Path, *, unit: float | None = None, up: str | None = None, index: int = 0
) -> tuple[FloatArray, float]:
    """Joint positions of a person in a BVH file, independent of the file's rest pose.

    Args:
        path: the file.
        unit: the file's unit of length [m]; None takes the one among m, dm, inch, cm and mm that gives human legs.
        up: up axis of the file's world, "y", "z", "-y", ...; None takes the axis along which the head is over the hips
            at rest.
        index: number of the person in a file with several roots.

    Returns:
        (frame, 22, 3) positions of the body's joints [m], z up, and the frame rate [Hz].

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the file is no BVH file, or lacks a joint of the human body; the message names it.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no motion file {path}")
    nodes, frames, rate = _parse(path.name, path.read_text(encoding="utf-8", errors="replace"))
    places, people = _positions(nodes, frames), _people(path.name, nodes)
    if not 0 <= index < len(people):
        holds = f"holds {len(people)} people, from 0" if len(people) > 1 else "holds one motion, 0"
        raise ClipError(f"{path.name}: index {index}; it {holds}")
    if len(people) > 1:
        _LOG.warning("%s: %d people; index=%d of 0 to %d is taken", path.name, len(people), index, len(people) - 1)
    found = people[index]
    try:
        turn = to_z_up(up or _upright(path.name, nodes, places, found), front=True)
    except ValueError as error:
        raise ClipError(str(error)) from error
    positions = complete({name: places[:, k] @ turn.T for name, k in found.items()})
    if not np.isfinite(positions).all():
        raise ClipError(f"{path.name}: joint positions are not finite")
    legs = sum(
        float(np.median(np.linalg.norm(positions[:, JOINT[f"left_{b}"]] - positions[:, JOINT[f"left_{a}"]], axis=-1)))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    if unit is None:
        unit = min(_UNITS, key=lambda u: abs(np.log(max(legs * u, 1e-9) / 0.85)))
        if not 0.3 < legs * unit < 1.3:
            raise ClipError(
                f"{path.name}: legs of {legs:g} units; no unit among {', '.join(_UNITS.values())} gives a person"
            )
        _LOG.info("%s: lengths are read as %s, which gives legs of %.2f m", path.name, _UNITS[unit], legs * unit)
    return positions * unit, rate


def _parse(name: str, text: str) -> tuple[list[_Node], FloatArray, float]:
    head, found, rest = text.partition("MOTION")
    if "HIERARCHY" not in head or not found:
        raise ClipError(f"{name}: not a BVH file; HIERARCHY or MOTION is missing")
    # names with blanks: "Bip01 L Thigh"
    head = re.sub(r"\b(ROOT|JOINT)[ \t]+([^\n\r{]+)", lambda m: f"{m[1]} {'_'.join(m[2].split())} ", head)
    try:
        nodes = _nodes(head.split())
    except (ValueError, IndexError, StopIteration, RuntimeError) as error:
        raise ClipError(f"{name}: its HIERARCHY cannot be read ({error or 'it ends too early'})") from error
    match = re.search(r"Frames:\s*(\d+)\s+Frame Time:\s*([\d.eE+-]+)\s", rest)
    if match is None or float(match[2]) <= 0.0:
        raise ClipError(f"{name}: no 'Frames:' and 'Frame Time:' after MOTION")
    width = sum(len(n.channels) for n in nodes)
    try:
        values = np.array(rest[match.end() :].split(), np.float64)
    except ValueError as error:
        raise ClipError(f"{name}: a value of the motion is not a number ({error})") from error
    if not width or values.size != width * int(match[1]) or not values.size:
        raise ClipError(f"{name}: {values.size} values; {match[1]} frames of {width} channels are needed")
    return nodes, values.reshape(-1, width), 1.0 / float(match[2])


def _nodes(words: list[str]) -> list[_Node]:
    """Nodes of the skeleton; ValueError, IndexError or StopIteration for a malformed one."""
    nodes: list[_Node] = []
    stack: list[int] = []
    current = -1
    tokens = iter(words)
    for token in tokens:
        if token in ("ROOT", "JOINT"):
            nodes.append(_Node(next(tokens), stack[-1] if stack else -1, np.zeros(3)))
            current = len(nodes) - 1
        elif token == "End":
            next(tokens)
            nodes.append(_Node(nodes[stack[-1]].name + "_end", stack[-1], np.zeros(3)))
            current = len(nodes) - 1
        elif token == "{":
            stack.append(current)
        elif token == "}":
            stack.pop()
        elif token == "OFFSET":
            nodes[current].offset = np.array([float(next(tokens)) for _ in range(3)])
        elif token == "CHANNELS":
            nodes[current].channels = [next(tokens) for _ in range(int(next(tokens)))]
            wrong = [c for c in nodes[current].channels if not re.fullmatch(r"[XYZ](position|rotation)", c)]
            if wrong:
                raise ValueError(f"channel {wrong[0]!r}")
    if stack:
        raise ValueError(f"{len(stack)} braces are not closed")
    return nodes


def _positions(nodes: list[_Node], frames: FloatArray) -> FloatArray:
    """(frame, node, 3) in the file's unit."""
    world = np.empty((len(frames), len(nodes), 3, 3))
    places = np.empty((len(frames), len(nodes), 3))
    column = 0
    for k, node in enumerate(nodes):
        local = np.tile(np.eye(3), (len(frames), 1, 1))
        moved = np.tile(node.offset, (len(frames), 1))
        for channel in node.channels:
            values = frames[:, column]
            column += 1
            axis = channel[0].lower()
            if channel.endswith("rotation"):
                local = local @ Rotation.from_euler(axis, values[:, None], degrees=True).as_matrix()
            else:
                moved[:, "xyz".index(axis)] = values
        if k and node.channels and np.abs(np.median(moved, axis=0)).max() < 0.5 * np.abs(node.offset).max():
            moved += node.offset  # some programs write positions relative to the offset
        parent = node.parent
        world[:, k] = local if parent < 0 else world[:, parent] @ local
        places[:, k] = moved if parent < 0 else places[:, parent] + np.einsum("fij,fj->fi", world[:, parent], moved)
    return places


def _bare_names(nodes: list[_Node]) -> list[str]:
    """Names without what all of them begin with: namespaces, figures, "Bip01", "mixamorig", "Character1"."""
    names = [re.split(r"[:|]", node.name)[-1] for node in nodes]
    while len(names) > 2:
        heads = [re.split(r"[ _.-]+", name, maxsplit=1) for name in names]
        first = max({head[0].lower() for head in heads}, key=[head[0].lower() for head in heads].count)
        shared = [head[0].lower() == first for head in heads]
        if not first or sum(shared) < 0.8 * len(names):
            break
        names = [head[-1] if len(head) > 1 and same else "" if same else name
                 for head, same, name in zip(heads, shared, names, strict=True)]  # fmt: skip
    # Motive's "LUArm" and "LFArm"
    return [re.sub(r"^([LR])([UF]Arm)$", r"\1_\2", name) for name in names]


def _people(name: str, nodes: list[_Node]) -> list[dict[str, int]]:
    """Joints of each person in a file, of one root each.

    Raises:
        ClipError: no root has a body.
    """
    roots = [k for k, node in enumerate(nodes) if node.parent < 0]
    owner = list(range(len(nodes)))
    for k, node in enumerate(nodes):
        owner[k] = k if node.parent < 0 else owner[node.parent]
    people, errors = [], []
    for root in roots:
        try:
            people.append(_found(name, nodes, [k for k in range(len(nodes)) if owner[k] == root]))
        except ClipError as error:
            errors.append(error)
    if not people:
        raise errors[0]
    return people


def _found(name: str, nodes: list[_Node], part: list[int]) -> dict[str, int]:
    """Joint of the package -> node of the file, among the nodes `part`.

    Raises:
        ClipError: a needed joint is not recognised.
    """
    part = [k for k in part if not nodes[k].name.endswith("_end")]
    split = [split_name(bare) for bare in _bare_names([nodes[k] for k in part])]
    exact = set(split)
    found: dict[str, int] = {}
    for k, (side, bare) in zip(part, split, strict=True):
        if not side:
            joint = _TRUNK_WORDS.get(bare, "")
            if joint:
                found.setdefault(joint, k)
            continue
        joint = _WORDS.get(bare, "")
        if bare == "hand" and (side, "wrist") in exact:
            continue  # SMPL's names: wrist and hand, ankle and foot
        if bare == "foot" and (side, "ankle") in exact:
            joint = "foot"
        if joint:
            # of "LeftHip" and "LeftUpLeg", or of two collars, the later one is the joint
            found[f"{side}_{joint}"] = k
    if "pelvis" not in found and nodes[part[0]].channels:
        found["pelvis"] = part[0]  # 3ds Max calls its root by the figure's name
    for side in ("left", "right"):
        # "shoulder" is the collar only where there is an upper arm
        if f"{side}_shoulder" not in found and f"{side}_collar" in found:
            found[f"{side}_shoulder"] = found.pop(f"{side}_collar")
    needed = ["pelvis", "head", *(f"{s}_{j}" for s in ("left", "right") for j in
              ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"))]  # fmt: skip
    missing = [j for j in needed if j not in found]
    if missing:
        raise ClipError(
            f"{name}: no joint is recognised as {', '.join(missing)}; its joints are "
            f"{', '.join(nodes[k].name for k in part)}. Rename them as in CMU's files (LeftUpLeg, LeftLeg, LeftFoot, "
            "LeftArm, LeftForeArm, LeftHand)"
        )
    return found


def _upright(name: str, nodes: list[_Node], places: FloatArray, found: dict[str, int]) -> str:
    """Axis, y or z, along which the head is over the hips at rest, else on average, else y."""
    rest = np.zeros((1, len(nodes), 3))
    for k, node in enumerate(nodes):
        rest[0, k] = node.offset + (rest[0, node.parent] if node.parent >= 0 else 0.0)
    for poses in (rest, places):
        hips = 0.5 * (poses[:, found["left_hip"]] + poses[:, found["right_hip"]])
        spine = poses[:, found["head"]] - hips
        _, y, z = np.mean(spine / np.maximum(np.linalg.norm(spine, axis=-1, keepdims=True), 1e-12), axis=0)
        if max(abs(y), z) > _UPRIGHT:
            if z > abs(y):
                _LOG.info("%s: read with z up, since its head is over its hips along z; up='y' overrides", name)
            return "z" if z > abs(y) else "y"
    return "y"
