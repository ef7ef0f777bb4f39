"""Daily actions and gestures of arms, hands and head as key places.

Spreads of places and times enclose those of the clips of the motion library that show the action: wave (sl_hello,
kaykit_Waving), clap (cmu_86_09_s4, sl_clap), drink (cmu_13_07 to cmu_14_37), boxing (cmu_13_18), throw (sl_throw_R,
m2m_addon_Throw_Object), type (sl_type), point (sl_point_you), salute (sl_salute), nods (sl_yes_head), wash (cmu_02_10).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.keyed_gesture import (
    ARM_HOLDS,
    FIST,
    GRIP,
    LOOSE_HAND,
    OPEN_HAND,
    POINTING,
    Key,
    KeyedGesture,
    Place,
    Vector,
)

_HOLD = (Key((1.0, 2.0)),)
_OUT: Place = ((0.28, 0.31), (-0.04, 0.0), (0.02, 0.04))
_LEVEL_AHEAD: Place = ((0.46, 0.5), (-0.09, 0.06), (-0.045, 0.03))
_LEVEL_ASIDE: Place = ((-0.04, 0.12), (0.46, 0.5), (-0.045, 0.03))
_HANGS = {"hangs": (1.0, 1.0)}
_STRETCHED: Vector = (-1.0, 0.35, -0.6)
_LIFTED = np.array([[-0.15, 0.2, 0.1], *POINTING[1:]])
_TAPPED = np.array([[0.5, 0.8, 0.4], *POINTING[1:]])

# fmt: off
GESTURES: Mapping[str, KeyedGesture | tuple[KeyedGesture, ...]] = {
    "standing": KeyedGesture(_HOLD, None),
    "wave": KeyedGesture(
        (
            Key((0.24, 0.42), ((0.0, 0.02), (0.115, 0.17), (-0.03, 0.0)), fingers=(0.05, 0.45, 1.0)),
            Key((0.24, 0.42), ((0.0, 0.02), (-0.17, -0.115), (-0.03, 0.0)), fingers=(0.05, -0.35, 1.0)),
        ),
        ((0.10, 0.24), (0.06, 0.22), (0.14, 0.33)), palm=(1.0, 0.0, 0.0), curl=OPEN_HAND, pole=(-0.2, 0.8, -1.0),
        flows=True, repeats=2.6, body={"lean": (-0.06, 0.04), "look": (-0.1, 0.2)},
    ),
    "clap": KeyedGesture(
        (
            Key((0.13, 0.2)),
            Key((0.03, 0.06)),
            Key((0.16, 0.28), ((-0.05, 0.0), (0.12, 0.24), (-0.02, 0.03)), fingers=(0.9, 0.1, 0.5)),
        ),
        ((0.24, 0.34), (0.034, 0.042), (-0.22, -0.06)), "chest", fingers=(0.75, 0.0, 0.65), curl=OPEN_HAND,
        other="mirror", repeats=3.6, still=0.5, body={"nod": (-0.05, 0.1)},
    ),
    "drink": KeyedGesture(
        (
            Key((0.8, 1.3), body={"nod": (-0.4, -0.15)}),
            Key((0.9, 2.0), ((-0.01, 0.01), (-0.01, 0.01), (0.0, 0.03)), fingers=(-0.1, -0.9, 0.45),
                body={"nod": (-0.5, -0.25)}),
            Key((0.8, 1.3), ((0.03, 0.12), (0.0, 0.1), (-0.38, -0.26)), fingers=(0.8, -0.5, 0.0)),
            Key((0.5, 2.0), ((0.03, 0.12), (0.0, 0.1), (-0.38, -0.26)), fingers=(0.8, -0.5, 0.0)),
        ),
        ((0.16, 0.2), (0.05, 0.1), (-0.14, -0.09)), "head", fingers=(0.2, -1.0, 0.2), palm=(-0.9, -0.3, 0.0), curl=GRIP,
        pole=(-0.2, 0.5, -1.0), rises=False,
    ),
    "phone": KeyedGesture(
        _HOLD, ((0.08, 0.12), (0.14, 0.17), (-0.13, -0.07)), "head", fingers=(-0.5, -0.15, 1.0), palm=(0.3, -1.0, 0.0),
        curl=GRIP, pole=(0.1, 0.5, -1.0), still=0.7,
        body={"tilt": (0.0, 0.2), "nod": (-0.05, 0.25), "look": (-0.3, 0.2), "lean": (-0.05, 0.05)},
    ),
    "type": KeyedGesture(
        (
            Key((0.1, 0.2), ((-0.01, 0.01), (-0.02, 0.02), (0.004, 0.012))),
            Key((0.1, 0.2), ((-0.01, 0.01), (-0.02, 0.02), (-0.012, -0.004))),
        ),
        ((0.26, 0.34), (0.09, 0.16), (-0.3, -0.22)), "chest", fingers=(1.0, -0.25, 0.0), palm=(0.0, -0.1, -1.0),
        other="alternate", flows=True, rises=False, taps=0.18, body={"nod": (0.1, 0.35)},
    ),
    "sweep": KeyedGesture(
        (
            Key((0.5, 0.9), ((-0.02, 0.05), (0.12, 0.22), (0.0, 0.05)), body={"turn": (-0.2, -0.08)}),
            Key((0.5, 0.9), ((-0.02, 0.05), (-0.22, -0.12), (0.0, 0.05)), body={"turn": (0.08, 0.2)}),
        ),
        ((0.28, 0.34), (0.0, 0.08), (-0.32, -0.26)), "chest", fingers=(0.7, -0.7, -0.2), palm=(-0.4, -0.5, -0.4),
        curl=FIST, other=((0.24, 0.3), (0.02, 0.1), (-0.18, -0.1)), follow=0.75, flows=True, rises=False, repeats=2.2,
        body={"bend": (0.12, 0.3), "pitch": (0.03, 0.15), "nod": (0.1, 0.3)}, stagger=(0.0, 0.2),
    ),
    "boxing": KeyedGesture(
        (
            Key((0.12, 0.15), ((0.29, 0.33), (-0.1, -0.06), (0.06, 0.12)), fingers=(1.0, 0.0, 0.0),
                palm=(0.0, -0.2, -1.0), swift=True,
                body={"turn": (0.4, 0.65), "bend": (0.0, 0.08), "weight": (0.1, 0.4)}),
            Key((0.2, 0.3), swift=True),
            Key((0.3, 0.8), ((-0.02, 0.02), (-0.02, 0.02), (-0.03, 0.03)), body={"sink": (-0.015, 0.02)}),
        ),
        ((0.17, 0.22), (0.06, 0.12), (-0.12, -0.03)), "chest", fingers=(0.45, -0.2, 0.85), palm=(0.0, -1.0, 0.0),
        curl=FIST, pole=(-0.1, 0.55, -1.0), other="alternate", rises=False, repeats=1.6, counted=2, stagger=(0.2, 0.38),
        body={"sink": (0.02, 0.06), "bend": (0.05, 0.2), "nod": (0.05, 0.2), "turn": (-0.3, 0.0)},
    ),
    "throw": KeyedGesture(
        (
            Key((0.45, 0.8), ((-0.3, -0.22), (0.08, 0.16), (0.05, 0.14)), fingers=(-0.4, 0.1, 1.0),
                palm=(1.0, 0.0, 0.4), curl=GRIP,
                body={"turn": (-0.55, -0.3), "bend": (-0.15, -0.05), "weight": (-0.4, -0.15), "look": (-0.4, -0.2)}),
            Key((0.18, 0.26), ((0.08, 0.14), (-0.08, 0.02), (0.02, 0.1)), swift=True, curl=OPEN_HAND,
                body={"turn": (0.25, 0.5), "bend": (0.1, 0.25), "weight": (0.2, 0.45), "look": (0.0, 0.2)}),
            Key((0.18, 0.28), ((0.02, 0.1), (-0.22, -0.12), (-0.4, -0.3)), swift=True,
                body={"turn": (0.3, 0.55), "bend": (0.15, 0.35), "weight": (0.2, 0.45), "look": (0.0, 0.2)}),
            Key((0.5, 0.9), ((-0.2, -0.1), (0.0, 0.1), (-0.4, -0.3))),
            Key((0.4, 1.2), ((-0.2, -0.1), (0.0, 0.1), (-0.4, -0.3))),
        ),
        ((0.32, 0.36), (0.04, 0.12), (0.08, 0.16)), fingers=(1.0, 0.0, 0.2), palm=(0.3, 0.0, -1.0), rises=False,
        pole=(-0.2, 1.0, -0.5), stagger=(0.12, 0.28),
    ),
    "stretch": KeyedGesture(
        (
            Key((1.0, 1.6), body={"bend": (-0.15, -0.03), "nod": (-0.35, -0.1)}),
            Key((1.0, 2.4), ((-0.02, 0.02), (-0.02, 0.02), (0.0, 0.01)),
                body={"bend": (-0.2, -0.05), "nod": (-0.4, -0.1), "lean": (-0.2, 0.2)}),
            Key((1.0, 1.6), body=_HANGS),
            Key((0.6, 1.5), body=_HANGS),
        ),
        ((-0.02, 0.12), (0.02, 0.2), (0.46, 0.52)), fingers=(0.0, 0.05, 1.0), palm=(0.5, -1.0, 0.0), curl=OPEN_HAND,
        pole=(0.0, 1.0, -0.2), other="mirror", rises=False, repeats=0.75,
    ),
    "push": KeyedGesture(
        (
            Key((0.3, 0.42), _OUT, body={"turn": (0.06, 0.14), "pitch": (0.0, 0.05)}),
            Key((0.15, 0.35), _OUT, body={"turn": (0.06, 0.14), "pitch": (0.0, 0.05)}),
            Key((0.7, 1.0)),
            Key((0.1, 0.35)),
        ),
        ((0.16, 0.19), (-0.08, 0.08), (-0.15, -0.03)), fingers=(0.15, -0.1, 1.0), palm=(1.0, 0.0, 0.0), curl=OPEN_HAND,
        rises=False, repeats=1.0,
    ),
    "pull": KeyedGesture(
        (
            Key((0.32, 0.45), curl=FIST, body={"turn": (-0.14, -0.06), "pitch": (-0.04, 0.0)}),
            Key((0.15, 0.4), body={"turn": (-0.14, -0.06), "pitch": (-0.04, 0.0)}),
            Key((0.75, 1.1), ((0.28, 0.31), (-0.08, -0.02), (0.06, 0.09)), curl=OPEN_HAND),
            Key((0.18, 0.3), ((0.28, 0.31), (-0.08, -0.02), (0.06, 0.09)), curl=FIST),
        ),
        ((0.16, 0.19), (0.0, 0.11), (-0.25, -0.12)), palm=(0.0, -0.8, -0.6), rises=False, repeats=1.0,
    ),
    "click": KeyedGesture(
        (
            Key((0.12, 0.18), ((0.01, 0.03), (0.0, 0.0), (-0.01, 0.0)), curl=_TAPPED),
            Key((0.05, 0.07), ((0.01, 0.03), (0.0, 0.0), (-0.01, 0.0)), curl=_TAPPED),
            Key((0.16, 0.24), curl=_LIFTED),
            Key((0.3, 0.7), curl=_LIFTED),
        ),
        ((0.3, 0.37), (-0.1, 0.02), (-0.15, -0.05)), fingers=(1.0, -0.1, 0.15), palm=(0.0, -0.1, -1.0), curl=_LIFTED,
        rises=False, repeats=1.5, still=0.5,
    ),
    "arm_raised": KeyedGesture(
        _HOLD, ((0.06, 0.26), (0.05, 0.2), (0.36, 0.46)), fingers=(0.1, 0.0, 1.0), palm=(0.6, -0.8, 0.0),
        pole=(-0.5, 1.0, -0.6), curl=OPEN_HAND, other="hangs", body={"lean": (-0.05, 0.0)},
    ),
    "t_pose": KeyedGesture(
        _HOLD, ((-0.02, 0.08), (0.47, 0.5), (-0.035, 0.03)), fingers=(0.05, 1.0, 0.0), palm=(0.1, 0.0, -1.0),
        curl=OPEN_HAND, pole=_STRETCHED, other="mirror", rises=False,
    ),
    "y_pose": KeyedGesture(
        _HOLD, ((0.0, 0.06), (0.3, 0.36), (0.33, 0.39)), fingers=(0.05, 0.7, 0.7), palm=(0.4, 0.5, -0.7),
        curl=OPEN_HAND, pole=_STRETCHED, other="mirror", rises=False,
    ),
    "arm_horizontal": (
        KeyedGesture(_HOLD, _LEVEL_AHEAD, palm=(0.0, -0.3, -1.0), curl=OPEN_HAND, other="hangs"),
        KeyedGesture(
            _HOLD, _LEVEL_ASIDE, fingers=(0.1, 1.0, 0.0), palm=(0.3, 0.0, -1.0), curl=OPEN_HAND, other="hangs"
        ),
    ),
    "both_arms_forward": KeyedGesture(_HOLD, _LEVEL_AHEAD, palm=(0.0, -0.3, -1.0), curl=OPEN_HAND, other="mirror"),
    "point": KeyedGesture(
        _HOLD, ((0.46, 0.5), (-0.12, 0.25), (-0.16, 0.15)), palm=(0.0, -0.6, -1.0), curl=POINTING,
        body={"turn": (0.0, 0.15), "look": (0.0, 0.15)},
    ),
    "shake_hands": KeyedGesture(
        (
            Key((0.13, 0.24), ((0.0, 0.0), (0.0, 0.0), (0.03, 0.05))),
            Key((0.13, 0.24), ((0.0, 0.0), (0.0, 0.0), (-0.05, -0.03))),
        ),
        ((0.345, 0.365), (0.0, 0.02), (-0.24, -0.2)), "chest", fingers=(1.0, 0.0, 0.05), curl=GRIP, flows=True,
        rises=False, repeats=2.6, still=0.4, body={"turn": (0.02, 0.12), "bend": (0.0, 0.08)}, stagger=(-0.1, 0.0),
    ),
    "arms_on_hips": ARM_HOLDS["on_hips"],
    "arms_folded": ARM_HOLDS["folded"],
    "hands_behind_back": ARM_HOLDS["behind_back"],
    "hands_in_pockets": ARM_HOLDS["in_pockets"],
    "beckon": KeyedGesture(
        (
            Key((0.22, 0.38), ((-0.1, -0.05), (-0.05, 0.0), (0.06, 0.12)), fingers=(-0.3, -0.5, 1.0),
                palm=(-0.9, -0.3, -0.2), curl=GRIP),
            Key((0.22, 0.38), ((0.05, 0.1), (0.0, 0.03), (-0.06, 0.0)), fingers=(0.9, 0.0, 0.5)),
        ),
        ((0.24, 0.32), (0.0, 0.14), (-0.12, 0.05)), palm=(-0.6, -0.5, 0.6), flows=True, repeats=2.2,
    ),
    "salute": KeyedGesture(
        _HOLD, ((0.12, 0.16), (0.17, 0.22), (-0.02, 0.03)), "head", fingers=(-0.1, -0.8, 0.6), palm=(0.5, -0.4, -0.7),
        curl=OPEN_HAND, pole=(0.2, 1.0, -0.4), still=0.5,
    ),
    "wipe": KeyedGesture(
        (
            Key((0.24, 0.45), ((-0.03, 0.03), (0.1, 0.18), (0.0, 0.0)), body={"turn": (-0.12, 0.0)}),
            Key((0.24, 0.45), ((-0.03, 0.03), (-0.18, -0.1), (0.0, 0.0)), body={"turn": (0.0, 0.12)}),
        ),
        ((0.31, 0.38), (-0.1, 0.04), (-0.26, -0.18)), fingers=(1.0, -0.2, 0.0), palm=(0.0, 0.0, -1.0), curl=OPEN_HAND,
        flows=True, rises=False, repeats=2.2, body={"bend": (0.15, 0.35), "pitch": (0.05, 0.2), "nod": (0.1, 0.3)},
    ),
    "wash_window": KeyedGesture(
        (
            Key((0.24, 0.45), ((-0.02, 0.02), (0.1, 0.18), (-0.03, 0.03)), body={"turn": (-0.12, 0.0)}),
            Key((0.24, 0.45), ((-0.02, 0.02), (-0.18, -0.1), (-0.03, 0.03)), body={"turn": (0.0, 0.12)}),
        ),
        ((0.34, 0.4), (-0.06, 0.1), (-0.05, 0.14)), fingers=(0.1, -0.1, 1.0), palm=(1.0, 0.0, 0.0), curl=OPEN_HAND,
        flows=True, rises=False, repeats=3.6,
    ),
    "brush_teeth": KeyedGesture(
        (
            Key((0.1, 0.17), ((-0.01, 0.01), (0.012, 0.03), (-0.005, 0.005))),
            Key((0.1, 0.17), ((-0.01, 0.01), (-0.03, -0.012), (-0.005, 0.005))),
        ),
        ((0.16, 0.2), (0.09, 0.13), (-0.1, -0.05)), "head", fingers=(-0.1, -0.9, 0.5), palm=(-0.9, -0.3, 0.0),
        curl=FIST, pole=(0.0, 0.9, -0.8), flows=True, rises=False, still=0.5,
        body={"bend": (0.0, 0.25), "nod": (0.0, 0.2)},
    ),
    "comb": KeyedGesture(
        (
            Key((0.5, 0.9), ((-0.14, -0.09), (0.0, 0.04), (-0.08, -0.03))),
            Key((0.3, 0.6), ((0.03, 0.08), (0.02, 0.05), (0.02, 0.05))),
        ),
        ((0.06, 0.1), (0.14, 0.18), (0.14, 0.19)), "head", fingers=(-0.3, -0.9, 0.4), palm=(-0.3, -0.5, -1.0),
        curl=FIST, pole=(0.8, 1.0, -0.3), flows=True, rises=False, repeats=1.6,
        body={"tilt": (-0.2, 0.0), "nod": (0.0, 0.2)},
    ),
    "cough": KeyedGesture(
        (
            Key((0.12, 0.18), body={"bend": (0.15, 0.3), "nod": (0.1, 0.3)}, swift=True),
            Key((0.18, 0.28), body={"bend": (0.04, 0.08)}, swift=True),
            Key((0.12, 0.18), body={"bend": (0.15, 0.3), "nod": (0.1, 0.3)}, swift=True),
            Key((0.3, 0.5)),
            Key((0.3, 1.2)),
        ),
        ((0.14, 0.18), (0.03, 0.07), (-0.11, -0.06)), "head", fingers=(-0.1, -1.0, 0.5), palm=(-1.0, -0.2, 0.0),
        curl=FIST, pole=(0.0, 0.6, -1.0), rises=False, repeats=1.0, body={"bend": (0.02, 0.12)}, still=0.5,
    ),
    "knock": KeyedGesture(
        (
            Key((0.07, 0.1), ((0.05, 0.08), (0.0, 0.0), (-0.02, 0.0)), swift=True),
            Key((0.09, 0.13), swift=True),
            Key((0.07, 0.1), ((0.05, 0.08), (0.0, 0.0), (-0.02, 0.0)), swift=True),
            Key((0.09, 0.13), swift=True),
            Key((0.07, 0.1), ((0.05, 0.08), (0.0, 0.0), (-0.02, 0.0)), swift=True),
            Key((0.12, 0.2)),
            Key((0.5, 1.4)),
        ),
        ((0.3, 0.37), (-0.06, 0.1), (-0.06, 0.12)), fingers=(0.4, -0.2, 1.0), palm=(0.2, -1.0, 0.0), curl=FIST,
        repeats=1.0, counted=3,
    ),
    "stir": KeyedGesture(
        (
            Key((0.2, 0.35), ((0.04, 0.07), (0.0, 0.0), (-0.01, 0.01))),
            Key((0.2, 0.35), ((0.0, 0.0), (0.04, 0.07), (-0.01, 0.01))),
            Key((0.2, 0.35), ((-0.07, -0.04), (0.0, 0.0), (-0.01, 0.01))),
            Key((0.2, 0.35), ((0.0, 0.0), (-0.07, -0.04), (-0.01, 0.01))),
        ),
        ((0.27, 0.34), (0.0, 0.1), (-0.26, -0.16)), "chest", fingers=(0.7, -0.6, -0.2), palm=(0.0, -0.6, -0.8),
        curl=FIST, other=((0.24, 0.32), (0.08, 0.16), (-0.28, -0.2)), flows=True, rises=False, repeats=1.6,
        body={"nod": (0.15, 0.4), "bend": (0.0, 0.15)},
    ),
    "swing_arms": KeyedGesture(
        (
            Key((0.4, 0.7), ((0.18, 0.32), (-0.04, 0.0), (0.0, 0.0)), body={"bend": (-0.03, 0.03)}),
            Key((0.4, 0.7), ((-0.25, -0.15), (0.0, 0.04), (0.0, 0.0)), body={"bend": (0.0, 0.06)}),
        ),
        ((0.03, 0.08), (0.06, 0.12), (-0.49, -0.46)), fingers=(0.2, 0.0, -1.0), flows=True, rises=False, repeats=2.2,
        pole=(-1.0, 0.4, -0.2), other="mirror",
    ),
    "look_around": KeyedGesture(
        (
            Key((0.7, 1.3), body={"look": (0.45, 0.66), "turn": (-0.3, -0.05)}),
            Key((0.3, 1.0), body={"look": (0.45, 0.66), "turn": (-0.3, -0.05)}),
            Key((0.9, 1.6), body={"look": (-0.66, -0.45), "turn": (0.05, 0.3)}),
            Key((0.3, 1.0), body={"look": (-0.66, -0.45), "turn": (0.05, 0.3)}),
        ),
        None, repeats=1.4,
    ),
    "nod": KeyedGesture(
        (Key((0.25, 0.45), body={"nod": (0.2, 0.32)}), Key((0.25, 0.45), body={"nod": (-0.14, -0.07)})),
        None, flows=True, repeats=2.0,
    ),
    "shake_head": KeyedGesture(
        (Key((0.22, 0.42), body={"look": (0.25, 0.5)}), Key((0.22, 0.42), body={"look": (-0.5, -0.25)})),
        None, flows=True, repeats=2.6,
    ),
}
"""Gestures by name; the seed draws one of several."""


def _circle(sense: int, curl: FloatArray) -> KeyedGesture:
    """Circles up, outwards (`sense` 1) or inwards, down."""
    places = ((0.0, 1.0), (float(sense), 0.0), (0.0, -1.0), (-float(sense), 0.0))
    spans = [tuple((0.13 * x, 0.18 * x) if x >= 0.0 else (0.18 * x, 0.13 * x) for x in place) for place in places]
    return KeyedGesture(
        tuple(Key((0.25, 0.4), ((-0.02, 0.02), aside, up)) for aside, up in spans),
        ((0.3, 0.35), (-0.08, 0.03), (-0.15, -0.06)), fingers=(1.0, -0.1, 0.2), palm=(0.0, -0.3, -1.0), curl=curl,
        flows=True, rises=False, repeats=1.3,
    )


def _swipe(sense: int) -> KeyedGesture:
    """Strokes outwards (`sense` 1) or inwards (-1)."""
    end, begin = ((0.19, 0.24), (-0.24, -0.19))[::sense]
    turned, back = ((-0.14, -0.05), (0.05, 0.14))[::sense]
    return KeyedGesture(
        (
            Key((0.3, 0.45), ((0.0, 0.0), end, (0.0, 0.0)), body={"turn": turned}),
            Key((0.12, 0.3), ((-0.03, -0.01), end, (-0.02, -0.01)), body={"turn": turned}),
            Key((0.35, 0.5), ((-0.1, -0.04), (-0.02, 0.02), (-0.11, -0.05)), curl=LOOSE_HAND),
            Key((0.35, 0.5), ((0.0, 0.0), begin, (0.0, 0.0)), body={"turn": back}),
            Key((0.06, 0.15), ((0.0, 0.0), begin, (0.0, 0.0)), body={"turn": back}),
        ),
        ((0.27, 0.34), (-0.06, -0.02), (-0.17, -0.06)), fingers=(1.0, -0.1, 0.0), curl=OPEN_HAND, rises=False,
        palm=(0.0, 0.3, -1.0) if sense > 0 else (0.0, -1.0, -0.1), repeats=1.0,
    )


CIRCLES = {sense: (_circle(sense, POINTING), _circle(sense, 3.0 * OPEN_HAND)) for sense in (1, -1)}
"""By sense: 1 up and outwards, -1 up and inwards."""
SWIPES = {sense: _swipe(sense) for sense in (1, -1)}
"""By direction: 1 outwards, -1 inwards."""
FINGER_SWING = KeyedGesture(
    (
        Key((0.22, 0.38), fingers=(0.05, 0.3, 1.0)),
        Key((0.22, 0.38), fingers=(0.05, -0.3, 1.0)),
    ),
    ((0.22, 0.27), (0.0, 0.1), (0.0, 0.07)), palm=(1.0, 0.0, 0.0), curl=POINTING, pole=(-0.35, 0.15, -1.0), flows=True,
    rises=False, repeats=2.0, still=0.5,
)  # fmt: skip
# fmt: on
