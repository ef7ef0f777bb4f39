"""Actions of the kinematic synthesiser by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import floor_actions, gaits, gestures, jumps, postures, seats
from rfgen_sionna.generative.motion.arm_actions import GESTURES
from rfgen_sionna.generative.motion.keyed_gesture import perform
from rfgen_sionna.generative.motion.pick_up import pick_up
from rfgen_sionna.generative.motion.skeleton import HANDS, SIDES
from rfgen_sionna.generative.motion.tracks import MotionTracks
from rfgen_sionna.generative.motion.walk import walk, walk_straight

Writer = Callable[[MotionTracks, np.random.Generator, str, Manner], None]
"""(tracks, rng, hand "left" or "right", manner): writes an action into tracks."""


@dataclass(frozen=True)
class Action:
    """One action of the kinematic synthesiser."""

    name: str
    description: str
    """Clause for a person who does it: "walks back and forth"."""
    write: Writer
    one_handed: bool = False
    """Whether the hand can be chosen."""
    crossing: bool = False
    """Whether two hands that do it at once would collide."""
    periodic: bool = True
    """Whether it repeats rhythmically; postures do not."""
    free_arms: int = 0
    """Number of arms that may be on the hips, folded, behind the back or in pockets meanwhile."""

    @property
    def hands(self) -> tuple[str, ...]:
        """Allowed hands: "left", "right" and "both" in step; empty where the hand cannot be chosen."""
        return () if not self.one_handed else SIDES if self.crossing else HANDS


def with_hand(hand: str) -> str:
    """Phrase for the hands of a gesture, from "left", "right" or "both"."""
    return " with both hands" if hand == "both" else f" with the {hand} hand"


def _keyed(name: str, description: str, *, one_handed: bool = False, periodic: bool = True) -> Action:
    what = GESTURES[name]
    free = 0 if isinstance(what, tuple) or what.other else 1 if what.at else 2
    return Action(name, description, partial(perform, what=what), one_handed, periodic=periodic, free_arms=free)


def _with_side(name: str, side: str) -> Writer:
    return partial(perform, what=GESTURES[name], side=side)


_posture, _gesture = partial(Action, periodic=False), partial(Action, one_handed=True)
ACTIONS: Mapping[str, Action] = MappingProxyType(
    {
        a.name: a
        for a in (
            Action("walk", "walks back and forth", walk, free_arms=2),
            Action("jump", "jumps up on the spot", jumps.jump),
            Action("jumping_jacks", "does jumping jacks", jumps.jumping_jacks),
            _gesture("pick_up", "picks up an item from the ground", pick_up),
            _keyed("t_pose", "holds a T pose", periodic=False),
            _keyed("y_pose", "holds a Y pose", periodic=False),
            *(
                _posture(f"{side}_arm_raised", f"raises the {side} arm", _with_side("arm_raised", side))
                for side in SIDES
            ),
            _posture("left_leg_raised", "raises the left leg", partial(postures.leg_raised, side="left"), free_arms=2),
            _posture(
                "right_leg_raised", "raises the right leg", partial(postures.leg_raised, side="right"), free_arms=2
            ),
            _gesture("swipe_left", "swipes to the left", partial(gestures.swipe, towards=1), crossing=True),
            _gesture("swipe_right", "swipes to the right", partial(gestures.swipe, towards=-1), crossing=True),
            _keyed("push", "pushes a hand forwards", one_handed=True),
            _keyed("pull", "pulls a hand back", one_handed=True),
            _gesture("circle_clockwise", "draws clockwise circles", partial(gestures.circle, clockwise=True)),
            _gesture(
                "circle_counterclockwise", "draws counter-clockwise circles", partial(gestures.circle, clockwise=False)
            ),
            _keyed("click", "clicks with the index finger", one_handed=True),
            _gesture("finger_swing", "swings the index finger", gestures.finger_swing),
            _keyed("standing", "stands", periodic=False),
            # append only: random streams depend on the index of an action
            Action("walk_straight", "walks straight ahead", walk_straight, free_arms=2),
            _keyed("wave", "waves", one_handed=True),
            _keyed("clap", "claps"),
            _keyed("drink", "drinks", one_handed=True),
            _keyed("phone", "phones", one_handed=True),
            _keyed("type", "types on a keyboard"),
            _keyed("sweep", "sweeps the floor"),
            _keyed("boxing", "boxes"),
            _keyed("stretch", "stretches"),
            _keyed("throw", "throws", one_handed=True),
            _keyed("point", "points at something", one_handed=True, periodic=False),
            Action("shake_hands", "shakes hands", _with_side("shake_hands", "right")),
            _keyed("arms_on_hips", "stands with the hands on the hips", periodic=False),
            _keyed("arms_folded", "stands with folded arms", periodic=False),
            _keyed("hands_behind_back", "stands with the hands behind the back", periodic=False),
            _keyed("hands_in_pockets", "stands with the hands in the pockets", periodic=False),
            _keyed("both_arms_forward", "holds both arms out ahead", periodic=False),
            _keyed("beckon", "beckons", one_handed=True),
            _keyed("salute", "salutes", one_handed=True, periodic=False),
            _keyed("wipe", "wipes a table", one_handed=True),
            _keyed("wash_window", "washes a window", one_handed=True),
            _keyed("brush_teeth", "brushes the teeth", one_handed=True),
            _keyed("comb", "combs the hair", one_handed=True),
            _keyed("cough", "coughs", one_handed=True),
            _keyed("knock", "knocks at a door", one_handed=True),
            _keyed("stir", "stirs a pot"),
            _keyed("swing_arms", "swings the arms"),
            _keyed("look_around", "looks around"),
            _keyed("nod", "nods"),
            _keyed("shake_head", "shakes the head"),
            *(
                _posture(
                    f"{side}_arm_horizontal", f"holds the {side} arm out level", _with_side("arm_horizontal", side)
                )
                for side in SIDES
            ),
            Action("limp", "limps", gaits.limp),
            Action("march", "marches", gaits.march),
            Action("march_in_place", "marches on the spot", gaits.march_in_place),
            _posture("sit", "sits on a chair", seats.sit),
            _posture("sit_down", "sits down on a chair", seats.sit_down),
            _posture("stand_up", "stands up from a chair", seats.stand_up),
            Action("sit_and_stand", "sits down and stands up", seats.sit_and_stand),
            _posture("lie", "lies on the floor", floor_actions.lie),
            Action("sit_up", "does sit-ups", floor_actions.sit_up),
            Action("push_up", "does push-ups", floor_actions.push_up),
            Action("hop", "hops on the spot", jumps.hop),
        )
    }
)
"""Actions by name. Left, right and clockwise are from the person's view."""
