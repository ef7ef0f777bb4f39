"""Sentences for the actions, on which text encoder and model are trained.

Verbs in angle brackets are inflected. `{hand}` is "left" or "right" where the hand is mentioned; text after `?` in
brackets is optional.
"""

from __future__ import annotations

import re
from types import MappingProxyType

# fmt: off
CLAUSES: MappingProxyType[str, tuple[str, ...]] = MappingProxyType(
    {
        "walk": (
            "<walk> back and forth", "<walk>[? around]", "<walk> to and fro", "<pace>[? up and down][? the room]",
            "<stroll>[? back and forth]", "<go> for a short walk and <come> back",
            "<walk> forward, <turn> around and <walk> back", "<take> a few steps, <turn> and <return>",
            "<wander> up and down", "<move> on foot from one side to the other", "<stride> forth and back",
            "<march> to the other end and back", "<step> forward several times and then <come> back",
            "<walk> towards the radar and away again", "<keep> walking", "<amble> along",
        ),
        "jump": (
            "<jump>[? up][? on the spot]", "<jump> up and down", "<hop>[? up and down][? in place]",
            "<leap> into the air", "<bounce> up and down", "<do> vertical jumps", "<spring> off the ground",
            "<perform> a[? high] jump", "<jump> as high as possible", "<skip> in place with both feet", "<leap> high",
            "<do> some jumps", "<push> off and <land> on both feet",
            "<leave> the ground with both feet again and again",
        ),
        "jumping_jacks": (
            "<do> jumping jacks", "<perform>[? a few] jumping jacks", "<do> star jumps", "<do> a jumping jack",
            "<jump> with legs apart and arms overhead", "<jump> while spreading arms and legs",
            "<exercise> with jumping jacks", "<do> side straddle hops",
            "<jump> open and closed with clapping hands above the head",
            "<spread> arms and legs in a jump and <close> them again", "<warm> up with jumping jacks",
            "<do> hampelmann jumps, arms and legs out and in",
        ),
        "pick_up": (
            "<pick> up an item[? from the ground]", "<pick> something up[? off the floor]",
            "<bend> down to pick up an object", "<pick> up a box[? from the floor]",
            "<reach> down and <grab> something from the floor", "<lift> an object off the ground",
            "<stoop> to take a thing from the floor", "<crouch> and <collect> an item",
            "<bend> over and <lift> a bag from the ground", "<get> something from the floor",
            "<fetch> a ball from the ground", "<retrieve> a dropped item",
            "<bend> down and <lift> the keys from the floor", "<take> a bottle from the ground",
            "<lift> a[? heavy] box", "<pick> up an item with the {hand} hand",
        ),
        "t_pose": (
            "<hold> a T pose", "<stand> in a T pose", "<make> a T with the body", "<do> a T-pose",
            "<stretch> both arms out to the sides", "<hold> both arms straight out sideways",
            "<spread> the arms horizontally", "<extend> the arms to the side at shoulder height",
            "<stand> with arms outstretched to left and right", "<pose> like the letter T",
            "<raise> both arms sideways to shoulder level", "<imitate> an aeroplane with arms out",
            "with both arms spread wide", "with the arms extended sideways",
        ),
        "y_pose": (
            "<hold> a Y pose", "<stand> in a Y pose", "<make> a Y with the body", "<do> a Y-pose",
            "<raise> both arms[? up]", "<lift> both hands above the head", "<put> both arms up in the air",
            "<hold> both hands up high", "<pose> like the letter Y", "<stretch> both arms upwards and outwards",
            "<throw> the hands up", "<reach> up with both arms", "with both arms raised high", "with two hands up",
            "<hold> up both hands",
        ),
        **{
            f"{side}_arm_raised": (
                f"<raise> the {side} arm", f"<raise> the {side} hand[? up]", f"<lift> the {side} arm[? over the head]",
                f"<hold> the {side} arm up", f"<put> the {side} hand up in the air",
                f"<stand> with the {side} arm raised", f"<have> the {side} arm[? held] up",
                f"<stretch> the {side} arm upwards", f"<point> to the ceiling with the {side} hand",
                f"<reach> up with the {side} arm", f"<keep> the {side} hand above the head",
                f"<move> the {side} arm up", f"<raise> one arm, the {side} one", f"with the {side} arm raised",
                f"with the {side} hand up",
            )
            for side in ("left", "right")
        },
        **{
            f"{side}_leg_raised": (
                f"<raise> the {side} leg", f"<lift> the {side} leg[? off the ground]", f"<hold> the {side} leg up",
                f"<raise> the {side} knee", f"<stand> with the {side} leg raised",
                f"<lift> the {side} foot from the floor", f"<pull> the {side} knee up",
                f"<stand> on one leg with the {side} one in the air", f"<balance> on the {other} leg",
                f"<stand> on the {other} foot only", f"<keep> the {side} foot in the air",
                f"<bring> the {side} knee to the chest", f"<raise> one leg, the {side} one", f"with the {side} leg up",
                f"with the {side} foot off the ground",
            )
            for side, other in (("left", "right"), ("right", "left"))
        },
        **{
            f"swipe_{way}": (
                f"<swipe> {way}[? with the {{hand}} hand]", f"<swipe> to the {way}",
                f"<swipe> the {{hand}} hand to the {way}", f"<sweep> the hand to the {way}",
                f"<make> a swipe gesture to the {way}", f"<move> the {{hand}} hand quickly from {other} to {way}",
                f"<wipe> {way}wards through the air", f"<do> a {way} swipe", f"<flick> the hand towards the {way}",
                f"<brush> something away to the {way}", f"<gesture> {way}wards with a swipe",
                f"<turn> a page to the {way} in the air", f"<swipe> from {other} to {way}",
                f"<sweep> the {{hand}} hand {way}wards", f"<swipe> in the direction from {other} to {way}",
                f"<pull> the hand across to the {way}",
            )
            for way, other in (("left", "right"), ("right", "left"))
        },
        "push": (
            "<push>[? forwards]", "<push> the {hand} hand forward", "<push> a hand away from the body",
            "<make> a push gesture", "<thrust> the palm forward", "<extend> the {hand} hand quickly to the front",
            "<press> the air in front with the palm", "<shove> something invisible away", "<push> towards the radar",
            "<stretch> the {hand} arm forward with a push", "<move> the hand from the chest to the front",
            "<push> an invisible door with the {hand} hand",
        ),
        "pull": (
            "<pull>[? backwards]", "<pull> the {hand} hand back", "<pull> a hand towards the body",
            "<make> a pull gesture", "<draw> the {hand} hand towards the chest", "<tug> at an invisible rope",
            "<drag> something invisible closer", "<pull> something towards oneself",
            "<bring> the outstretched hand back to the body", "<pull> with the {hand} arm",
            "<move> the hand from the front to the chest", "<retract> the {hand} hand quickly",
        ),
        **{
            f"circle_{turn}": tuple(
                clause.format(turn=word, hand="{hand}")
                for word in words
                for clause in (
                    "<draw> {turn} circles", "<draw> a circle {turn}[? with the {hand} hand]",
                    "<move> the {hand} hand in {turn} circles", "<circle> the {hand} hand {turn}",
                    "<rotate> the hand {turn}", "<make> a {turn} circular gesture",
                    "<trace> a circle {turn} in the air", "<stir> the air {turn}",
                    "<swing> the {hand} hand around {turn}", "<turn> the hand in a circle, {turn}",
                    "<gesture> a {turn} circle", "<describe> circles {turn} with the {hand} arm",
                )
            )
            for turn, words in (
                ("clockwise", ("clockwise",)),
                ("counterclockwise", ("counter-clockwise", "anticlockwise", "counterclockwise", "anti-clockwise")),
            )
        },
        "click": (
            "<click>[? with the index finger]", "<click> with the {hand} hand", "<tap>[? in the air]",
            "<tap> with the {hand} index finger", "<press> a button[? in the air]", "<make> a click gesture",
            "<push> a virtual button with a finger", "<poke> at an invisible screen", "<tap> a touch screen",
            "<do> a finger tap", "<type> on an imaginary key with one finger", "<double-click> in the air",
        ),
        "finger_swing": (
            "<swing> the[? {hand}] index finger", "<swing> a finger from side to side", "<wag> the[? {hand}] finger",
            "<wave> the index finger left and right", "<wiggle> the[? raised] index finger",
            "<make> a finger swing gesture", "<shake> a finger", "<move> the forefinger to and fro",
            "<swing> the forefinger of the {hand} hand", "<do> a finger swing", "<wag> the index finger to say no",
            "<rock> a raised finger sideways", "<wag> a forefinger back and forth",
            "<wave> a finger up and down and sideways",
        ),
        "standing": (
            "<stand>[? still]", "<stand> upright", "<remain> motionless", "<stay> in place without moving",
            "<stand> at ease", "<wait>[? quietly]", "<do> nothing", "<stand> idle", "<keep> still",
            "<just> stand there", "<stand> with the arms hanging", "<rest> on both feet",
        ),
        "walk_straight": (
            "<walk> straight ahead", "<walk> straight", "<walk> forward", "<walk> in a straight line",
            "<walk> ahead without turning", "<march> straight on", "<stride> forward", "<cross> the room on foot",
            "<walk> from one end to the other", "<go> straight ahead on foot", "<stroll> forward",
            "<keep> walking in one direction",
        ),
    }
)
# fmt: on
"""Kinematic action -> clauses."""


_THIRD = {"do": "does", "go": "goes", "have": "has"}
_STAY = {"just"}
OPEN_CLAUSES: MappingProxyType[tuple[str, ...], tuple[str, ...]] = MappingProxyType(
    {
        ("left_arm_raised", "right_arm_raised"): (
            "<raise> one arm",
            "<raise> an arm",
            "<lift> one hand[? up]",
            "<hold> an arm up",
            "<put> a hand up",
            "<stretch> one arm upwards",
            "<raise> a single arm",
        ),
        ("left_leg_raised", "right_leg_raised"): (
            "<raise> one leg",
            "<raise> a leg",
            "<lift> one foot[? off the ground]",
            "<stand> on one leg",
            "<balance> on one foot",
            "<pull> a knee up",
        ),
        ("swipe_left", "swipe_right"): (
            "<swipe>",
            "<make> a swipe gesture",
            "<swipe> with the {hand} hand",
            "<swipe> sideways",
            "<sweep> a hand across",
        ),
        ("circle_clockwise", "circle_counterclockwise"): (
            "<draw> circles",
            "<draw> a circle in the air",
            "<move> the {hand} hand in circles",
            "<circle> the hand",
            "<make> a circular gesture",
        ),
        ("push", "pull"): ("<push> or <pull>", "<move> a hand along the line of sight"),
        ("click", "finger_swing"): ("<make> a finger gesture", "<move> the index finger", "<gesture> with one finger"),
        ("left_arm_raised", "right_arm_raised", "left_leg_raised", "right_leg_raised"): (
            "<raise> a limb",
            "<lift> one limb",
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


def doing(action: str, hand: str = "") -> str:
    """Shortest clause of an action as a participle: "raising the left arm"."""
    clause = re.sub(r"\[\?[^]]*\]", "", CLAUSES[action][0])
    return re.sub(r" +", " ", inflect(clause.replace("{hand}", hand), "ing")).strip()


def inflect(clause: str, form: str) -> str:
    """Clause with its verbs in `form`: "s" (raises), "ing" (raising) or "" (raise)."""

    def verb(match: re.Match[str]) -> str:
        word = match[1]
        if word in _STAY or not form:
            return word
        if form == "s":
            if word in _THIRD:
                return _THIRD[word]
            if re.search(r"(s|sh|ch|x|z)$", word):
                return word + "es"
            return word + "s"
        if re.search(r"[^aeiou]e$", word) or word.endswith("ue"):
            return word[:-1] + "ing"
        if re.search(r"[^aeiou][aeiou][bdgmnpt]$", word) and word not in {"wander", "fasten"}:
            return word + word[-1] + "ing"
        return word + "ing"

    return re.sub(r"<([a-z-]+)>", verb, clause)


# fmt: off
