"""Wordings beside the clauses of the phrase book: ambiguous clauses, fragments, actions of arms and legs."""

from __future__ import annotations

from types import MappingProxyType

# fmt: off
OPEN_CLAUSES: MappingProxyType[tuple[str, ...], tuple[str, ...]] = MappingProxyType(
    {
        ("left_arm_raised", "right_arm_raised"): (
            "<raise> one arm", "<raise> an arm", "<lift> one hand[? up]", "<hold> an arm up", "<put> a hand up",
            "<stretch> one arm upwards", "<raise> a single arm",
        ),
        ("left_leg_raised", "right_leg_raised"): (
            "<raise> one leg", "<raise> a leg", "<lift> one foot[? off the ground]", "<stand> on one leg",
            "<balance> on one foot", "<pull> a knee up",
        ),
        ("swipe_left", "swipe_right"): (
            "<swipe>", "<make> a swipe gesture", "<swipe> with the {hand} hand", "<swipe> sideways",
            "<sweep> a hand across",
        ),
        ("circle_clockwise", "circle_counterclockwise"): (
            "<draw> circles", "<draw> a circle in the air", "<move> the {hand} hand in circles", "<circle> the hand",
            "<make> a circular gesture",
        ),
        ("push", "pull"): ("<push> or <pull>", "<move> a hand along the line of sight"),
        ("click", "finger_swing"): ("<make> a finger gesture", "<move> the index finger", "<gesture> with one finger"),
        ("left_arm_raised", "right_arm_raised", "left_leg_raised", "right_leg_raised"): (
            "<raise> a limb", "<lift> one limb",
        ),
        ("jump", "jumping_jacks"): ("<do> a jumping exercise", "<exercise> by jumping"),
    }
)
# fmt: on
"""Actions between which a clause does not decide -> clauses."""

FRAGMENTS: MappingProxyType[str, tuple[str, ...]] = MappingProxyType(
    {
        "walk": ("walking", "steps", "a walk"),
        "jump": ("jumping", "jumps", "hopping"),
        "jumping_jacks": ("jumping jacks", "star jumps"),
        "pick_up": ("picking up", "bending down", "pick up"),
        "t_pose": ("T pose", "arms out to the sides"),
        "y_pose": ("Y pose", "both arms", "both arms up"),
        "left_arm_raised": ("left arm", "left hand", "raised left arm"),
        "right_arm_raised": ("right arm", "right hand", "raised right arm"),
        "left_leg_raised": ("left leg", "left foot", "left knee"),
        "right_leg_raised": ("right leg", "right foot", "right knee"),
        "swipe_left": ("left swipe", "swipe left", "to the left"),
        "swipe_right": ("right swipe", "swipe right", "to the right"),
        "push": ("push", "pushing"),
        "pull": ("pull", "pulling"),
        "circle_clockwise": ("clockwise", "clockwise circle"),
        "circle_counterclockwise": ("counter-clockwise", "anticlockwise circle", "counterclockwise"),
        "click": ("click", "clicking", "tapping"),
        "finger_swing": ("finger swing", "wagging finger"),
        "standing": ("standing", "standing still", "idle"),
        "walk_straight": ("walking straight", "straight ahead"),
    }
)
"""Action -> words of a negative prompt or a list of keywords."""

UPPER = ("left_arm_raised", "right_arm_raised", "t_pose", "y_pose", "swipe_left", "swipe_right", "push", "pull",
         "circle_clockwise", "circle_counterclockwise", "click", "finger_swing")  # fmt: skip
"""Actions of the arms."""
CAPTURED_LEGS: MappingProxyType[str, str] = MappingProxyType(
    {
        "run": "runs",
        "fast_walk": "walks fast",
        "stride_walk": "walks with long strides",
        "jog_in_place": "jogs in place",
    }
)
"""Captured actions that leave the arms free -> plain clause."""
LOWER = ("walk", "walk_straight", "jump", "left_leg_raised", "right_leg_raised", *CAPTURED_LEGS)
"""Actions that combine with those of the arms."""
