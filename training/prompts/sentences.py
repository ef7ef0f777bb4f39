"""Sentences of the action reader's training: wordings with subjects, tenses and circumstances, drawn by a seed."""

# Lists of words.
# ruff: noqa: E501, SIM905

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.prompts.action_reader import REFUSED
from rfgen_sionna.generative.prompts.clauses import canonical, split

_FOLDER = Path(__file__).parent
_SUBJECTS = """
a person; a person; a person; the person; someone; somebody; one; a man; a woman; the man; the woman; a boy; a girl; a child; a kid; a toddler; a baby; a teenager; an adult; an old man; an old woman; an elderly lady;
a patient; the patient; the driver; a nurse; a doctor; a worker; an employee; a student; a pupil; a teacher; grandma; grandpa; grandmother; my father; my mother; her brother; his sister; our neighbour; the neighbor; he; she; they; the user; a user; the subject;
a subject; a test person; a participant; a volunteer; an athlete; a soldier; a dancer; a boxer; a runner; a gymnast; a guest; a visitor; a resident; a customer; a lady; a gentleman; a guy; a fellow; a human; a pedestrian; a passer-by; the actor; an actress; a policeman; a firefighter;
a farmer; a cook; a waiter; a plumber; a carpenter; an engineer; a scientist; a professor; the chief; the boss; a secretary; a colleague; a friend; a stranger; a thief; a burglar; a clown; a king; a princess; a monk; a pensioner; a senior; an infant; an adolescent; a youngster; the intruder; the caregiver;
a tall man; a short woman; a young woman; a heavy man; a thin boy; Anna; Peter; Mr Smith; John; Maria; I; you; the individual; an individual; the occupant; a hiker; a musician; a goalkeeper; a footballer; a coach; a trainer; a mechanic; a postman; the lodger; an uncle; an aunt; a granny; a little girl; a big man
"""
_ENDINGS = """
slowly; quickly; again; repeatedly; several times; once; twice; for a while; in the room; in the living room; in front of the radar; in the corridor; at home; outside; in a repetitive manner; carefully; suddenly; at a steady pace; all the time; in the kitchen;
in the office; with ease; in the morning; calmly; vigorously; on the left; near the wall; by the window; as usual; without hurry; over and over; today; gently; with energy; in the hall; facing the radar; at 3 m; in the middle of the room; alone; very fast; in the garden; on the lawn; in the yard; behind a bush; at the airport; near the exit; for the first time; before the race; after dinner; with a smile; like a pro; in agreement; to keep warm; because of the music; at the station;
in the gym; on stage; in the hospital; in the bathroom; next to the bed; beside the table; before the audience; in front of the mirror; at school; at work; past the sensor; under the lamp; during the break; for fun; in silence; at night; on the carpet; on the mat; in the hallway;
with great effort; in the rain; on the beach; in a hurry; without a word; at the party; on the street; in the supermarket; as a joke; for the camera; in the ward; at the bus stop; in slow motion; out of boredom; as an exercise; in despair; at the doctor's; like an old man; on the platform; as if nothing had happened
"""
_BEFORE = ("slowly", "quickly", "suddenly", "carefully", "repeatedly", "now", "just", "calmly", "always", "often")
_REQUESTS = ("{}", "a video of {}", "{}, please", "data of {}", "a recording of {}", "{} again", "the motion of {}")
_PAST = {
    "be": "was", "become": "became", "bend": "bent", "bite": "bit", "blow": "blew", "break": "broke", "bring": "brought",
    "build": "built", "buy": "bought", "catch": "caught", "come": "came", "creep": "crept", "cut": "cut", "dig": "dug",
    "do": "did", "draw": "drew", "drink": "drank", "drive": "drove", "eat": "ate", "fall": "fell", "feed": "fed",
    "feel": "felt", "fight": "fought", "find": "found", "flee": "fled", "fling": "flung", "fly": "flew",
    "forget": "forgot", "freeze": "froze", "get": "got", "give": "gave", "go": "went", "grow": "grew", "hang": "hung",
    "have": "had", "hear": "heard", "hide": "hid", "hit": "hit", "hold": "held", "keep": "kept", "kneel": "knelt",
    "know": "knew", "lay": "laid", "leave": "left", "let": "let", "lie": "lay", "lose": "lost", "make": "made",
    "pay": "paid", "put": "put", "read": "read", "ride": "rode", "ring": "rang", "rise": "rose", "run": "ran",
    "see": "saw", "sell": "sold", "set": "set", "shake": "shook", "shoot": "shot", "sing": "sang", "sink": "sank",
    "sit": "sat", "sleep": "slept", "slide": "slid", "sling": "slung", "speak": "spoke", "spin": "spun",
    "spread": "spread", "spring": "sprang", "stand": "stood", "steal": "stole", "stick": "stuck", "strike": "struck",
    "sweep": "swept", "swim": "swam", "swing": "swung", "take": "took", "teach": "taught", "tear": "tore",
    "tell": "told", "think": "thought", "throw": "threw", "tread": "trod", "understand": "understood", "wake": "woke",
    "wear": "wore", "wind": "wound", "win": "won", "write": "wrote", "sew": "sewed", "shrink": "shrank",
}  # fmt: skip
_DOUBLED = re.compile(r"^(?:[^aeiou]*|.*[^aeiou]|qu)[aeiou][bdgmnprt]$")
_SINGLE = {"wander", "hammer", "open", "water", "listen", "enter", "gather", "cover", "whisper", "offer", "remember",
           "visit", "edit", "vomit", "butter", "hover", "answer", "wonder", "suffer", "scatter", "stagger", "order",
           "linger", "loiter", "shiver", "travel", "hiccup", "march", "recover", "surrender", "discover", "bother",
           "gossip", "harvest", "garden", "happen", "fasten", "cower", "clamber", "hunker", "flutter", "alter",
           "scamper", "transport", "develop", "shovel", "pilot", "inherit", "exit", "bolt", "pocket", "limit", "scissor",
           "limber", "flounder", "saunter", "pummel", "enjoy", "deliver", "propel", "deposit", "hinder", "shudder"}  # fmt: skip


@dataclass(frozen=True)
class Sentence:
    """One sentence and its label."""

    text: str
    label: str
    """Family of the action reader, or `REFUSED` and a topic."""
    phrase: str
    """The wording that it was made of."""


def wordings() -> dict[str, list[str]]:
    """Label -> wordings, as in actions.toml and impossible.toml."""
    actions = tomllib.loads((_FOLDER / "actions.toml").read_text(encoding="utf-8"))
    impossible = tomllib.loads((_FOLDER / "impossible.toml").read_text(encoding="utf-8"))
    return {label: _split(text) for label, text in actions.items()} | {
        REFUSED + topic: _split(text) for part in impossible.values() for topic, text in part.items()
    }


def sentences(count: int, seed: int) -> list[Sentence]:
    """Sentences of all wordings, at least `count` of each that has a verb or alternatives."""
    rng = np.random.default_rng(seed)
    found: dict[str, Sentence] = {}
    for label, phrases in wordings().items():
        for phrase in phrases:
            expanded = list(_expanded(phrase))
            for number in range(max(count, len(expanded))):
                text = canonical(_sentence(expanded[number % len(expanded)], number, rng).lower())
                found.setdefault(text, Sentence(text, label, phrase))
                if "<" not in phrase and number >= len(expanded) and label.startswith(REFUSED):
                    break
    return list(found.values())


def plain(phrase: str) -> str:
    """A wording as words: verbs plain, every alternative once."""
    return " ".join(re.sub(r"[<>()\[\]|]|\{\w+\}", " ", phrase).split())


def _split(text: str) -> list[str]:
    return [" ".join(phrase.split()) for phrase in text.split(";") if phrase.strip()]


def _expanded(phrase: str) -> Iterator[str]:
    """The phrase with each of its alternatives."""
    match = re.search(r"\(([^()]*)\)|\[([^\[\]]*)\]|\{side\}", phrase)
    if match is None:
        yield " ".join(phrase.split())
        return
    if match[1] is not None:
        options = match[1].split("|")
    elif match[2] is not None:
        options = ["", *match[2].split("|")]
    else:
        options = ["left", "right"]
    for option in options:
        yield from _expanded(phrase[: match.start()] + option + phrase[match.end() :])


def _sentence(phrase: str, number: int, rng: np.random.Generator) -> str:
    subject = rng.choice(_SUBJECTS_LIST)
    his = _possessive(subject, rng)
    phrase = phrase.replace("{his}", his)
    if "<" not in phrase:
        return _noun_sentence(phrase, number, subject, rng)
    form = ("s", "ing", "s", "bare", "is", "past", "who", "is", "s")[number % 9]
    plural = subject in ("they", "you", "I")
    if form == "bare":
        said = inflect(phrase, "")
    elif form == "ing":
        said = f"{subject} {inflect(phrase, 'ing')}" if rng.random() < 0.5 else inflect(phrase, "ing")
    elif form in ("is", "who"):
        be = "am" if subject == "I" else "are" if plural else "is"
        said = f"{subject} {'who ' if form == 'who' else ''}{be} {inflect(phrase, 'ing')}"
    else:
        adverb = f"{rng.choice(_BEFORE)} " if rng.random() < 0.08 else ""
        said = f"{subject} {adverb}{inflect(phrase, '' if plural and form == 's' else form)}"
    if rng.random() < 0.3:
        said += f" {rng.choice(_ENDINGS_LIST)}"
    return said


def _noun_sentence(phrase: str, number: int, subject: str, rng: np.random.Generator) -> str:
    if number == 0 or rng.random() < 0.3:
        return phrase
    if phrase.startswith(("with ", "in ")) or re.search(r"(ed|up|horizontal|level|out)$", phrase):
        return f"{subject} {phrase}"
    if rng.random() < 0.4 and re.match(r"\w+ing\b", phrase):
        return f"{subject} {phrase}"
    return str(rng.choice(_REQUESTS)).format(phrase)


def _possessive(subject: str, rng: np.random.Generator) -> str:
    if rng.random() < 0.25:
        return "the"
    if subject in ("I", "you", "they"):
        return {"I": "my", "you": "your", "they": "their"}[subject]
    female = re.search(
        r"woman|girl|lady|she|grandma|granny|mother|sister|nurse|actress|princess|aunt|Anna|Maria", subject
    )
    male = re.search(
        r"\bman|boy|\bhe\b|grandpa|father|brother|guy|fellow|gentleman|king|monk|uncle|Peter|John", subject
    )
    return "her" if female else "his" if male else str(rng.choice(["his", "her", "their", "the", "one's"]))


def inflect(phrase: str, form: str) -> str:
    """Phrase with its verbs as in "she runs" ("s"), "running" ("ing"), "she ran" ("past") or "run" ("")."""
    return re.sub(r"<([^>]+)>", lambda match: _verb(match[1], form), phrase)


def _verb(verb: str, form: str) -> str:
    verb, _, rest = verb.partition(" ")
    rest = f" {rest}" if rest else ""
    head, dash, verb = verb.rpartition("-")
    return head + dash + _word(verb, form) + rest


def _word(verb: str, form: str) -> str:
    if form == "s":
        if verb in ("be", "have"):
            return {"be": "is", "have": "has"}[verb]
        if re.search(r"[^aeiou]y$", verb):
            return verb[:-1] + "ies"
        return verb + ("es" if re.search(r"(s|sh|ch|x|z|o)$", verb) else "s")
    if form == "ing":
        if verb.endswith("ie"):
            return verb[:-2] + "ying"
        if re.search(r"[^eoy]e$", verb) and verb != "be":
            return verb[:-1] + "ing"
        return _doubled(verb) + "ing"
    if form == "past":
        if verb in _PAST:
            return _PAST[verb]
        if re.search(r"[^aeiou]y$", verb):
            return verb[:-1] + "ied"
        return verb + "d" if verb.endswith("e") else _doubled(verb) + "ed"
    return verb


def _doubled(verb: str) -> str:
    return verb + verb[-1] if _DOUBLED.match(verb) and verb not in _SINGLE else verb


def captions(library: MotionLibrary) -> list[Sentence]:
    """Captions of one clause of the clips of a library, labelled by their actions."""
    found: dict[str, Sentence] = {}
    for clip in library:
        label = _CLIPS.get(clip.action, clip.action if clip.action in _PLAIN else "")
        for text in clip.captions:
            if label and not split(text).texts:
                said = canonical(text.lower())
                found.setdefault(said, Sentence(said, label, said))
    return list(found.values())


_PLAIN = frozenset(
    """
    arm_circles bow boxing carry cartwheel clap crawl crouch dance drink handstand hop jump jump_forward jump_twist
    jumping_jacks kick kneel leap lie lie_down lift look_around nod pick_up point punch push put_down reach run salute
    shake_head sidestep sit_down skip sneak squat stand_up stretch swing_arms t_pose throw toe_touch type walk
    walk_turn wash_window wave
    """.split()
)
"""Actions of the library that are families of the reader."""
_CLIPS = {
    "breakdance": "dance", "dance_modern": "dance", "salsa": "dance", "indian_dance": "dance", "idle": "standing",
    "walk_back": "walk_backwards", "run_back": "run_backwards", "turn": "turn_around", "getup": "get_up",
    "getup_down": "get_up", "getup_side": "get_up", "pushup": "push_up", "situp": "sit_up", "steps": "climb_stairs",
    "ladder": "climb_ladder", "jog_in_place": "jog_on_the_spot", "sit_stand": "sit_and_stand",
    "knee_elbow": "knee_to_elbow", "side_twist": "twist", "fast_walk": "walk", "slow_walk": "walk",
    "run_turn_left": "run", "run_turn_right": "run", "run_turn": "run", "flip": "flip", "sit_floor": "sit_down",
    **dict.fromkeys(("sword", "block", "dodge", "fight_stance", "fight_step", "roll", "yoga", "taunt",
                     "bball_dribble_fwd", "bball_dribble_back", "bball_dribble_side", "bball_shoot", "bball_signal"),
                    REFUSED + "games"),
    **dict.fromkeys(("laugh", "cheer", "gesture", "emotion", "cry", "shout", "talk", "whisper", "whistle", "shrug",
                     "angry", "confused", "reject", "pose"), REFUSED + "talk"),
    **dict.fromkeys(("photo", "dress", "traffic"), REFUSED + "work"),
    **dict.fromkeys(("playground", "hang"), REFUSED + "climbing"), "smoke": REFUSED + "eating",
}  # fmt: skip
"""Other actions of the library -> labels."""
_SUBJECTS_LIST, _ENDINGS_LIST = _split(_SUBJECTS), _split(_ENDINGS)
