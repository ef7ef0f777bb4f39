"""Sentences that the model is examined with and never trained on."""

from __future__ import annotations

from types import MappingProxyType

PARAPHRASES: MappingProxyType[str, tuple[str, ...]] = MappingProxyType(
    {
        "walk": (
            "a fellow is pacing about in front of the sensor",
            "walks there and back, over and over",
            "a lady wanders around the place",
            "a person strolls to the wall, turns round and strolls back",
        ),
        "walk_straight": (
            "a man walks forward in a line",
            "a person goes straight on without turning around",
            "someone marches ahead",
            "a woman is striding straight forward",
        ),
        "jump": (
            "the kid keeps hopping on the spot",
            "somebody leaps up several times",
            "a man is jumping as high as he can",
            "a person bounces with both feet off the floor",
        ),
        "jumping_jacks": (
            "a lady exercises doing star jumps",
            "someone is busy with jumping jacks",
            "a gym warm-up: jumping jacks",
            "a person jumps, legs apart and arms above the head, then together again",
        ),
        "pick_up": (
            "a man is bending down to grab a parcel",
            "the lady collects her phone from the floor",
            "somebody lifts a suitcase off the ground",
            "a person stoops and picks something up",
        ),
        "t_pose": (
            "a man holds his arms stretched out sideways",
            "a person posing in a T shape",
            "somebody keeps both arms straight out to the left and to the right",
            "a T-posing human",
        ),
        "y_pose": (
            "a lady holds up her two arms like a Y",
            "a man posing as a letter Y",
            "a person with both hands raised over the head",
            "somebody lifts the two arms up high",
        ),
        "left_arm_raised": (
            "a lady keeps her left arm lifted",
            "he puts up his left hand",
            "a person whose left arm points upwards",
            "somebody is lifting up the left arm",
        ),
        "right_arm_raised": (
            "a lady keeps her right arm lifted",
            "he puts up his right hand",
            "a person whose right arm points upwards",
            "somebody is lifting up the right arm",
        ),
        "left_leg_raised": (
            "a man holds his left knee high",
            "somebody lifts up the left leg",
            "a person with the left foot in the air",
            "she is raising her left foot off the floor",
        ),
        "right_leg_raised": (
            "a man holds his right knee high",
            "somebody lifts up the right leg",
            "a person with the right foot in the air",
            "she is raising her right foot off the floor",
        ),
        "swipe_left": (
            "a lady swiping leftwards",
            "somebody sweeps the hand over to the left side",
            "a person makes swipes to the left with the hand",
            "he swipes his hand left",
        ),
        "swipe_right": (
            "a lady swiping rightwards",
            "somebody sweeps the hand over to the right side",
            "a person makes swipes to the right with the hand",
            "he swipes his hand right",
        ),
        "push": (
            "a man pushes his palm to the front",
            "a pushing gesture",
            "somebody shoves the hand forward",
            "a person is pushing something away with one hand",
        ),
        "pull": (
            "a man pulls his hand back to himself",
            "a pulling gesture",
            "somebody tugs something towards the chest",
            "a person is pulling a rope with one hand",
        ),
        "circle_clockwise": (
            "a man traces clockwise rings with his hand",
            "a clockwise circling gesture",
            "somebody circles clockwise with one hand",
            "the hand of a person goes round clockwise",
        ),
        "circle_counterclockwise": (
            "a man traces counter-clockwise rings with his hand",
            "an anticlockwise circling gesture",
            "somebody circles anti-clockwise with one hand",
            "the hand of a person goes round counterclockwise",
        ),
        "click": (
            "a man clicks on an invisible button with his finger",
            "a clicking gesture",
            "somebody taps the air with the forefinger",
            "a person pokes a virtual key",
        ),
        "finger_swing": (
            "a man swings his forefinger to and fro",
            "a lady wags her index finger",
            "somebody moves the index finger from left to right and back",
            "a person shakes the raised finger",
        ),
        "standing": (
            "a man is standing motionless",
            "somebody stays where he is",
            "a lady waits, standing quietly",
            "a person stands there at rest",
        ),
    }
)
"""Action -> other wordings."""

AMBIGUOUS: tuple[tuple[str, str, str], ...] = (
    ("a person raises one arm", "left arm", "left_arm_raised"),
    ("a person raises one arm", "right arm", "right_arm_raised"),
    ("someone lifts a leg", "right leg", "right_leg_raised"),
    ("someone lifts a leg", "left leg", "left_leg_raised"),
    ("a person makes a swipe gesture", "to the left", "swipe_left"),
    ("a person makes a swipe gesture", "swipe right", "swipe_right"),
    ("a person draws circles", "clockwise", "circle_clockwise"),
    ("a person draws circles", "counter-clockwise", "circle_counterclockwise"),
)
"""(prompt that leaves a choice, negative prompt, the action that it rules out)."""

OUTSIDE: tuple[str, ...] = (
    "a person rides a unicycle",
    "someone plays the violin",
    "a woman knits a scarf",
    "a man paddles a canoe",
    "someone irons a shirt",
    "a man changes a light bulb",
    "a woman waters the flowers",
    "a boy bites an apple",
    "someone blows out the candles",
    "a man sharpens a knife",
    "a person scrolls on a phone",
    "a woman pets a cat",
    "somebody wraps a present",
    "a girl does the splits",
    "a person gargles",
    "a man flexes his biceps",
    "two children play hide and seek",
    "someone zips up a coat",
    "a man stirs the paint",
    "a woman takes off her shoes",
    "a person polishes the table",
    "a boy throws a frisbee to a dog",
    "someone rings the bell",
    "a man tips his hat",
    "a person shivers with cold",
    "a woman breastfeeds",
    "a man loads a truck",
    "someone cheats at cards",
    "a person beckons",
    "a girl twirls a baton",
    "an old man leans on a stick",
    "someone cracks an egg",
    "a person slaps a mosquito",
    "a man argues with the referee",
    "a woman gives a speech",
    "someone squeezes a lemon",
    "a person hugs himself",
    "a man gets out of a car",
    "a girl cries",
    "someone stretches the neck",
)
"""Prompts outside the vocabulary, all but the first four written after what tells them was tuned on others."""
