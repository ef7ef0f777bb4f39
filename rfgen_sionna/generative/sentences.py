"""Prompts whose action the grammar does not know: the motion source reads them, where it reads sentences.

The grammar names twenty actions, one at a time, and says exactly what it reads. A learned source knows more: captured
actions, arms that do something while the legs walk, wordings of its own. Body, place, orientation, speed and
surroundings are the grammar's in any case.
"""

from __future__ import annotations

import re

import numpy as np

from rfgen_sionna.generative.body_prompt import PromptError
from rfgen_sionna.generative.decisions import PROMPT, drawn
from rfgen_sionna.generative.environment_prompt import split_keyword
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource, SentenceSource
from rfgen_sionna.generative.motion.actions import with_hand
from rfgen_sionna.generative.motion.motion_source import PromptReading
from rfgen_sionna.generative.phrases import Phrases, read_unwanted, read_wanted
from rfgen_sionna.generative.prompts import ScenePrompt, SourceReading, UnreadActionError, parse_prompt
from rfgen_sionna.generative.text_reader import AFTERWARDS, normalise, split_negative

NEAREST = "the nearest that is known"
"""Origin of an action that the words do not name."""
_SURE = 0.8
"""Probability from which a captured action is taken for one of the grammar's that the words name as well."""
_PLAUSIBLE = 0.5
"""Probability from which the nearest action may be a captured one, of which the source knows few wordings."""
_KEPT = ("action ", "target ", "left hand", "right hand", "both hands", "walks that way")
"""How meanings of phrases begin that a motion source should hear of."""
_TIGHTER = "motion 'diffusion' also knows captured actions, and arms that do something while somebody walks or jumps"


def motion_source(name: str) -> MotionSource:
    """The origin of motion that a name stands for.

    Args:
        name: "kinematic", "diffusion", or "auto": the learned model where its packages are installed.

    Raises:
        ValueError: unknown name.
        ImportError: the learned model's packages are missing.
        FileNotFoundError: its weights are.
    """
    if name == "auto":
        from rfgen_sionna.generative.environment_setup import missing_packages

        name = "kinematic" if missing_packages() else "diffusion"
    if name == "kinematic":
        return KinematicSource()
    if name == "diffusion":
        try:
            from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
        except ImportError as error:
            raise ImportError(
                f"motion 'diffusion' needs {error.name}: pip install 'rfgen-sionna[diffusion]'"
            ) from error
        source = DiffusionSource()
        _ = source.model
        return source
    raise ValueError(f"motion: {name!r}; allowed are 'kinematic', 'diffusion' and 'auto'")


def read_prompt(
    prompt: str, negative: str = "", *, seed: int = 0, source: MotionSource | str = "kinematic"
) -> ScenePrompt:
    """Read a prompt by the grammar and, where it finds no one action or not all words, by the motion source.

    Args:
        prompt, negative, seed: as for :func:`~rfgen_sionna.generative.prompts.parse_prompt`.
        source: where the motion will come from, or its name for :func:`motion_source`, which is then loaded only
            where the grammar needs it.

    Raises:
        PromptError: the prompt cannot be carried out by this source.
        ValueError: a seed or a name that is none.
        ImportError, FileNotFoundError: the learned model is needed and cannot be had.
    """
    try:
        said = parse_prompt(prompt, negative, seed=seed)
    except UnreadActionError as error:
        source = motion_source(source) if isinstance(source, str) else source
        if not isinstance(source, SentenceSource):
            raise PromptError(f"{error}; {_TIGHTER}") from None
        words = _Words(prompt, negative)
        spoken = (words.heard(source, seed) or words.nearest(source, error)) if words.may_be_a_person(source) else None
        if spoken is None:
            raise
        return parse_prompt(prompt, negative, seed=seed, spoken=spoken)
    if said.unused:
        source = motion_source(source) if isinstance(source, str) else source
        words = _Words(prompt, negative)
        if words.said.unused and isinstance(source, SentenceSource):
            spoken = words.heard(source, seed, instead_of=said.action)
            if spoken is not None:
                return parse_prompt(prompt, negative, seed=seed, spoken=spoken)
    return said


class _Words:
    """A prompt between the grammar and a motion source."""

    def __init__(self, prompt: str, negative: str) -> None:
        wanted, unwanted = split_negative(prompt)
        self.prompt = prompt
        self.negative = ", ".join(part for part in (negative, unwanted) if part)
        self.said, self.denied = read_wanted(wanted), read_unwanted(self.negative)
        self.forbidden = frozenset().union(*(named for _, named in self.denied.actions))
        self.sentence = _of_the_motion(wanted, self.said)

    def heard(self, source: SentenceSource, seed: int, instead_of: str = "") -> SourceReading | None:
        """What the source reads beyond the grammar; None where it does not know the words.

        Args:
            source: reads them.
            seed: draws what the arms do, where the words leave it open.
            instead_of: the action that the grammar has read, where it has left other words unread.

        Raises:
            PromptError: the negative prompt forbids what the words ask for.
        """
        read = source.read(self.sentence)
        if instead_of and not (read.known and set(self.said.unused) == self._known_to(read)):
            return None
        apart = self._apart(source, read, instead_of, seed)
        if apart is not None:
            return apart
        several = len(self.said.actions) > 1 and not instead_of
        if not read.known or (read.action in ACTIONS and (instead_of or several)):
            return None
        if (instead_of or several) and read.share < _SURE:
            return None
        if read.action in ACTIONS:  # in words that the grammar does not know
            return (
                None if read.action in self.forbidden else SourceReading(read.action, PROMPT, read=self._known_to(read))
            )
        avoid, avoided, heard = self._unwanted(source)
        if avoided == read.action:
            raise PromptError(
                f"action: the negative prompt {self.negative!r} forbids {read.action}, which {self.prompt!r} asks for"
            )
        return SourceReading(
            read.action, PROMPT, sentence=self.sentence, avoid=avoid, read=self._known_to(read) | heard
        )

    def nearest(self, source: SentenceSource, error: UnreadActionError) -> SourceReading | None:
        """The nearest action, with a warning; None where the negative prompt forbids all."""
        read = source.read(self.sentence)
        captured = read.action not in ACTIONS and read.share >= _PLAUSIBLE and not self.said.actions
        near = (a for a in (read.action, *read.ranking) if a in ACTIONS and a not in self.forbidden)
        action = read.action if captured else next(near, None)
        if action is None:
            return None
        note = f"{error.what}; taken for the nearest action that is known, {action!r}, and no other one"
        if not captured:
            return SourceReading(action, NEAREST, notes=(note,))
        return SourceReading(action, NEAREST, sentence=self.sentence, read=self._known_to(read), notes=(note,))

    def may_be_a_person(self, source: SentenceSource) -> bool:
        """Whether any words may be those of an action, and nothing but a person is named: no dog becomes one."""
        if not self.said.actions and not self.said.unused:
            return False
        return bool(self.said.targets) or set(self.said.unused) == self._known_to(source.read(self.sentence))

    def _apart(self, source: SentenceSource, read: PromptReading, instead_of: str, seed: int) -> SourceReading | None:
        """Legs that walk, run or jump under arms that do something else."""
        if AFTERWARDS.search(self.prompt.lower()):
            return None
        legs: list[str] = []
        options: list[str] = []
        for named in (named for _, named in self.said.actions if named != {"standing"}):
            if named <= set(source.legs):
                legs += sorted(named)
            elif named <= set(source.arms) and not options:
                options = sorted(named)
            else:
                return None
        legs = [a for a in legs if a not in self.forbidden] or legs
        if not legs and not (read.known and read.action in source.legs):
            return None
        if not options and not (read.known and read.arms and (read.share >= _SURE or not instead_of)):
            return None
        action = read.action if read.action in source.legs and (read.action in legs or not legs) else legs[0]
        options = options or [read.arms]
        allowed = [a for a in options if a not in self.forbidden]
        if not allowed or action in self.forbidden:
            asked = " and ".join(options if not allowed else [action])
            raise PromptError(
                f"action: the negative prompt {self.negative!r} forbids {asked}, which {self.prompt!r} asks for"
            )
        arms = allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))]
        avoid, _, heard = self._unwanted(source)
        sentence = self.sentence
        if arms != read.arms and action in ACTIONS:  # where words leave it open the source is told what was drawn
            sentence = f"a person {ACTIONS[action].description} while this person {ACTIONS[arms].description}"
            hands = {hand for _, hand in self.said.hands} & set(ACTIONS[arms].hands)
            if len(hands) == 1:
                sentence += with_hand(hands.pop())
        return SourceReading(
            action,
            PROMPT,
            arms=arms,
            arms_origin=drawn(seed, allowed) if len(allowed) > 1 else PROMPT,
            sentence=sentence,
            avoid=avoid,
            read=self._known_to(read) | heard,
        )

    def _known_to(self, read: PromptReading) -> frozenset[str]:
        """The phrases that the grammar has not read and the source has."""
        return frozenset(p for p in self.said.unused if not set(p.split()) & set(read.unknown))

    def _unwanted(self, source: SentenceSource) -> tuple[str, str, frozenset[str]]:
        """What the negative prompt says of the motion, the action that the source takes its words for where the grammar
        does not know them, and these words."""
        about = ", ".join(words for words, _ in self.denied.actions)
        unread = self.denied.unused
        read = source.read(", ".join(unread)) if unread else None
        if read is None or not read.known:
            return about, "", frozenset()
        return ", ".join(filter(None, (about, *unread))), read.action, frozenset(unread)


def _of_the_motion(wanted: str, said: Phrases) -> str:
    """The prompt without the words for body, place, orientation, speed and surroundings."""
    others = [words for words, meaning in said.reader.understood if not meaning.startswith(_KEPT)]
    if not others:
        return wanted
    text = normalise(split_keyword(wanted)[0])
    for words in sorted(others, key=len, reverse=True):
        text = re.sub(rf"(?<![\w.]){re.escape(words)}(?!\w)", " ", text, count=1)
    return re.sub(r"(?: ,)+", ",", " ".join(text.split())).strip(" ,")
