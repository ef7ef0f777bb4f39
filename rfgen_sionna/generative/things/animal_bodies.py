"""Bodies of animals: sections along the joints of their clips, by eye from anatomical drawings."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

from dataclasses import replace

from rfgen_sionna.generative.things.animals import AnimalBody, BodyTube, pairs

_FORWARD = (1.0, 0.0, 0.0)

DOG = AnimalBody(
    clips="dog",
    size=0.50,
    foot=0.016,
    changes={},
    tubes=[
        BodyTube(
            "torso",
            ["Tail_Base", "Hips", "Spine_1", "Spine_2", "Spine_2.001", "Spine_3"],
            [0.050, 0.075, 0.080, 0.095, 0.085, 0.060],
            [0.055, 0.090, 0.088, 0.110, 0.110, 0.075],
        ),
        BodyTube("neck", ["Spine_2.001", "Spine_3", "Spine_4", "Head"], [0.070, 0.058, 0.050, 0.050]),
        BodyTube("head", ["Head", "Nose", "Head.tip"], [0.066, 0.036, 0.026], [0.062, 0.034, 0.022]),
        BodyTube("tail", ["Tail_Base", "Tail_Mid", "Tail_Mid.001", "Tail_End", "Tail_Tip"],
                 [0.024, 0.020, 0.020, 0.017, 0.010]),
        *pairs([
            BodyTube("ear", ["Head", "Ear_L", "Ear_Tip_L"], [0.020, 0.010, 0.007], [0.030, 0.024, 0.009], _FORWARD),
            BodyTube("front leg",
                     [{"Front_Leg_Shoulder_L": 0.6, "Front_Leg_Upper_L": 0.4}, "Front_Leg_Upper_L", "Front_Leg_Lower_L", "Front_Leg_Ankle_L",
                      "Front_Leg_Foot_L", "Front_Leg_Tip_L"], [0.050, 0.042, 0.028, 0.020, 0.020, 0.016]),
            BodyTube("back leg",
                     [{"Back_Leg_Pelvis_L": 0.3, "Back_Leg_Upper_L": 0.7}, "Back_Leg_Upper_L", "Back_Leg_Lower_L", "Back_Leg_Ankle_L",
                      "Back_Leg_Foot_L", "Back_Leg_Tip_L"], [0.050, 0.062, 0.042, 0.021, 0.020, 0.016]),
        ]),
    ],
)  # fmt: skip
"""Of a medium-sized dog, in unit of its height at the shoulder."""

_TAIL = ("Tail_Mid", "Tail_Mid.001", "Tail_End", "Tail_Tip")
CAT = replace(
    DOG,
    changes={
        **dict.fromkeys(_TAIL, ("Tail_Base", 1.35)),
        **dict.fromkeys(("Nose", "Head.tip"), ("Head", 0.55)),
        "Ear_Tip_L": ("Ear_L", 0.8), "Ear_Tip_R": ("Ear_R", 0.8),
    },
    tubes=[
        replace(each, wide=[1.15 * w for w in each.wide], deep=[1.15 * d for d in each.deep or each.wide])
        if each.part == "head"
        else replace(each, wide=[0.9 * w for w in each.wide], deep=None if each.deep is None else [0.9 * d for d in each.deep])
        for each in DOG.tubes
    ],
)  # fmt: skip
"""The dog's skeleton with a short muzzle, a round head, a long tail and slim legs."""


def _below(joint: str, share: float) -> dict[str, float]:
    """A point under a joint of a horse's spine, by a share of the depth to the middle of the ribs."""
    found = {joint: 1.0}
    for name, weight in (("ribcage_middle", share), ("spine_3", -share)):
        found[name] = found.get(name, 0.0) + weight
    return found


HORSE = AnimalBody(
    clips="horse",
    size=1.55,
    foot=0.045,
    changes={},
    tubes=[
        BodyTube(
            "torso",
            [_below("tail_1", 0.7), _below("hips", 0.8), _below("spine_1", 1.0), _below("spine_2", 1.05),
             _below("spine_3", 1.05), _below("spine_4", 1.1), "ribcage_front"],
            [0.12, 0.22, 0.25, 0.29, 0.28, 0.21, 0.13],
            [0.14, 0.25, 0.27, 0.29, 0.31, 0.29, 0.17],
        ),
        BodyTube("neck", [{"spine_4": 0.6, "ribcage_front": 0.4}, _below("spine_5", 0.45), _below("spine_6", 0.3), "head"],
                 [0.14, 0.10, 0.08, 0.07], [0.26, 0.19, 0.14, 0.12]),
        BodyTube("head", ["head", "nose", "head_leaf"], [0.09, 0.060, 0.050], [0.12, 0.080, 0.060]),
        BodyTube("tail", ["tail_1", "tail_2", "tail_3", "tail_4", "tail_leaf"], [0.05, 0.07, 0.08, 0.08, 0.05]),
        *pairs([
            BodyTube("ear", ["head", "ear_1_l", "ear_2_l", "ear_leaf_l"], [0.05, 0.032, 0.025, 0.010],
                     [0.05, 0.03, 0.02, 0.01], _FORWARD),
            BodyTube("front leg",
                     [{"front_scapula_l": 0.6, "front_leg_upper_l": 0.4}, {"front_humerus_l": 0.4, "front_leg_upper_l": 0.6}, "front_leg_upper_l", "front_leg_lower_l", "front_leg_ankle_l",
                      "front_leg_foot_l", "front_leg_leaf_l"], [0.10, 0.10, 0.085, 0.048, 0.036, 0.045, 0.050]),
            BodyTube("back leg",
                     [{"back_leg_pelvis_l": 0.35, "back_leg_upper_l": 0.65}, "back_leg_upper_l", "back_leg_lower_l", "back_leg_ankle_l", "back_leg_foot_l",
                      "back_leg_leaf_l"], [0.15, 0.155, 0.115, 0.056, 0.040, 0.050]),
        ], "_l", "_r"),
    ],
)  # fmt: skip
"""Of a riding horse, in unit of its height at the withers."""


def _chord(joint: str, feather: str) -> dict[str, float]:
    return {f"wing_feather_{feather}_2_L": 1.0, joint: -1.0}


def _middle(joint: str, feather: str) -> dict[str, float]:
    return {f"wing_feather_{feather}_2_L": 0.5, joint: 0.5}


BIRD = AnimalBody(
    clips="bird",
    size=1.60,
    foot=0.012,
    changes={},
    tubes=[
        BodyTube("body", ["tail_1", "hips", "spine_0", "spine_1", "spine_2", "spine_3"],
                 [0.030, 0.068, 0.085, 0.080, 0.060, 0.045], [0.028, 0.062, 0.078, 0.075, 0.056, 0.045]),
        BodyTube("head", ["spine_2", "spine_3", "head", "mouth_upper"], [0.05, 0.045, 0.050, 0.030]),
        BodyTube("beak", ["mouth_upper", "mouth_upper_tip"], [0.022, 0.007]),
        BodyTube("tail", ["tail_1", "tail_2", "tail_3", "tail_tip"], [0.030, 0.050, 0.070, 0.080],
                 [0.020, 0.009, 0.006, 0.005]),
        *pairs([
            BodyTube(
                "wing",
                [{"wing_1_L": 0.7, "wing_feather_1_2_L": 0.3}, _middle("wing_2_L", "1"), _middle("wing_3_L", "2"),
                 _middle("wing_4_L", "3"), _middle("wing_5_L", "4"), "wing_tip_L"],
                [0.016, 0.014, 0.012, 0.009, 0.007, 0.005],
                [0.090, 0.105, 0.100, 0.085, 0.065, 0.025],
                [_chord("wing_2_L", "1"), _chord("wing_2_L", "1"), _chord("wing_3_L", "2"), _chord("wing_4_L", "3"),
                 _chord("wing_5_L", "4"), _chord("wing_5_L", "4")],
            ),
            BodyTube("leg", ["UpperLeg_L", "LowerLeg_L", "AnkleLeg_L", "Foot_L", "Toes_L", "Toes_tip_L"],
                     [0.030, 0.025, 0.012, 0.010, 0.011, 0.010]),
        ]),
    ],
)  # fmt: skip
"""In unit of its wing span."""
