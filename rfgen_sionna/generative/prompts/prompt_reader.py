"""Prompts with actions beyond the grammar, interpreted by a motion source that reads sentences.

The grammar has twenty actions, one at a time. A learned source adds captured actions, arm actions during a walk, and
other wordings. The grammar reads body, position, orientation, speed and surroundings in any case.
"""

from __future__ import annotations

import re

import numpy as np

from rfgen_sionna.generative.decisions import PROMPT, drawn
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource, SentenceSource
from rfgen_sionna.generative.motion.actions import with_hand
from rfgen_sionna.generative.motion.motion_source import PromptReading
from rfgen_sionna.generative.prompts.environment_prompt import split_keyword
from rfgen_sionna.generative.prompts.person_prompt import SourceReading, UnreadActionError, forbidden, parse_prompt
from rfgen_sionna.generative.prompts.phrases import Phrases, read_unwanted, read_wanted
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.generative.prompts.text_reader import AFTERWARDS, normalise, split_negative
from rfgen_sionna.generative.prompts.thing_prompt import read_thing

NEAREST = "the nearest that is known"
"""Origin of a replacement of an unknown action."""
SOURCES = ("kinematic", "diffusion", "auto")
"""Names of motion sources."""
_SURE = 0.8
"""Least probability of a captured action that replaces an action of the grammar."""
_PLAUSIBLE = 0.5
"""Least probability of a captured action as the nearest one: it has few wordings."""
_KEPT = ("action ", "target ", "left hand", "right hand", "both hands", "walks that way")
"""Beginnings of the meanings of phrases that stay in the sentence for a motion source."""
_ADVICE = "motion 'diffusion' also has captured actions, and arm actions during walks and jumps"


def motion_source(name: str) -> MotionSource:
    """Motion source of a name.

    Args:
        name: "kinematic", "diffusion", or "auto", the learned model if its packages are installed.

    Raises:
        ValueError: unknown name.
        ImportError: packages of the learned model are missing.
        FileNotFoundError: its weights are missing.
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
    raise ValueError(f"motion: {name!r}; allowed are 'kinematic', 'diffusion' and 'auto', or the path of a clip")


def read_prompt(
    prompt: str, negative: str = "", *, seed: int = 0, source: MotionSource | str = "kinematic"
) -> ScenePrompt:
    """Interpret a prompt: about an animal or a thing by its patterns (:class:`ThingPrompt`), about a person by the
    grammar, and by the motion source if the grammar leaves the action or words open.

    Args:
        prompt, negative, seed: as for :func:`~rfgen_sionna.generative.prompts.parse_prompt`.
        source: motion source, or its name for :func:`motion_source`, which loads it if needed.

    Raises:
        PromptError: the source cannot carry out the prompt.
        ValueError: the seed or the name is invalid.
        ImportError, FileNotFoundError: the learned model is needed and missing.
    """
    thing = read_thing(prompt, negative, seed=seed)
    if thing is not None:
        return thing
    try:
        said = parse_prompt(prompt, negative, seed=seed)
    except UnreadActionError as error:
        source = motion_source(source) if isinstance(source, str) else source
        if not isinstance(source, SentenceSource):
            raise PromptError(f"{error}; {_ADVICE}") from None
        sentence = _Sentence(prompt, negative)
        reading = None
        if sentence.may_be_a_person(source):
            reading = sentence.read_by(source, seed) or sentence.nearest(source, error)
        if reading is None:
            raise
        return parse_prompt(prompt, negative, seed=seed, reading=reading)
    if said.unused:
        source = motion_source(source) if isinstance(source, str) else source
        sentence = _Sentence(prompt, negative)
        if sentence.said.unused and isinstance(source, SentenceSource):
            reading = sentence.read_by(source, seed, instead_of=said.action)
            if reading is not None:
                return parse_prompt(prompt, negative, seed=seed, reading=reading)
    return said


def check_source(said: ScenePrompt, duration: float, source: MotionSource) -> None:
    """Check that `source` can carry out an interpreted prompt for `duration` [s] (else ValueError)."""
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration: {duration!r} s; allowed is more than 0")
    if said.sentence and not isinstance(source, SentenceSource):
        raise PromptError(f"prompt: {said.sentence!r} needs a motion source that reads sentences, such as 'diffusion'")
    if not said.sentence and said.action not in ACTIONS:
        raise ValueError(f"action: {said.action!r} is unknown; allowed are {', '.join(ACTIONS)}")


class _Sentence:
    """A prompt for a motion source, with the phrases of the grammar."""

    def __init__(self, prompt: str, negative: str) -> None:
        wanted, unwanted = split_negative(prompt)
        self.prompt = prompt
        self.negative = ", ".join(part for part in (negative, unwanted) if part)
        self.said, self.denied = read_wanted(wanted), read_unwanted(self.negative)
        self.forbidden = frozenset().union(*(named for _, named in self.denied.actions))
        self.sentence = _motion_sentence(wanted, self.said)

    def read_by(self, source: SentenceSource, seed: int, instead_of: str = "") -> SourceReading | None:
        """Interpretation by the source; None if it does not understand the words or the grammar does as well.

        Args:
            source: the source.
            seed: seed of open choices of the arms.
            instead_of: action by the grammar of a prompt with unused words.

        Raises:
            PromptError: the negative prompt forbids the action.
        """
        read = source.read(self.sentence)
        if instead_of and not (read.known and set(self.said.unused) == self._understood(read)):
            return None
        combined = self._combined(source, read, instead_of, seed)
        if combined is not None:
            return combined
        several = len(self.said.actions) > 1 and not instead_of
        if not read.known or (read.action in ACTIONS and (instead_of or several)):
            return None
        if (instead_of or several) and read.share < _SURE:
            return None
        understood = self._understood(read)
        if read.action in ACTIONS:  # in words beyond the grammar
            return None if read.action in self.forbidden else SourceReading(read.action, PROMPT, read=understood)
        avoid, avoided, more = self._unwanted(source)
        if avoided == read.action:
            raise PromptError(forbidden(self.negative, [read.action], self.prompt))
        return SourceReading(read.action, PROMPT, sentence=self.sentence, avoid=avoid, read=understood | more)

    def nearest(self, source: SentenceSource, error: UnreadActionError) -> SourceReading | None:
        """Nearest action, with a warning; None if the negative prompt forbids all."""
        read = source.read(self.sentence)
        captured = read.action not in ACTIONS and read.share >= _PLAUSIBLE and not self.said.actions
        near = (a for a in (read.action, *read.ranking) if a in ACTIONS and a not in self.forbidden)
        action = read.action if captured else next(near, None)
        if action is None:
            return None
        note = f"{error.problem}; taken for the nearest action that is known, {action!r}, and no other one"
        if not captured:
            return SourceReading(action, NEAREST, notes=(note,))
        return SourceReading(action, NEAREST, sentence=self.sentence, read=self._understood(read), notes=(note,))

    def may_be_a_person(self, source: SentenceSource) -> bool:
        """Whether the words may be an action, of a person and not of a dog."""
        if not self.said.actions and not self.said.unused:
            return False
        return bool(self.said.targets) or set(self.said.unused) == self._understood(source.read(self.sentence))

    def _combined(
        self, source: SentenceSource, read: PromptReading, instead_of: str, seed: int
    ) -> SourceReading | None:
        """Interpretation as separate actions of legs and arms; None otherwise."""
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
            raise PromptError(forbidden(self.negative, [action] if allowed else options, self.prompt))
        arms = allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))]
        avoid, _, more = self._unwanted(source)
        sentence = self.sentence
        if arms != read.arms and action in ACTIONS:  # a sentence with the drawn arms
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
            read=self._understood(read) | more,
        )

    def _understood(self, read: PromptReading) -> frozenset[str]:
        """Phrases that the source understands and the grammar does not."""
        return frozenset(p for p in self.said.unused if not set(p.split()) & set(read.unknown))

    def _unwanted(self, source: SentenceSource) -> tuple[str, str, frozenset[str]]:
        """Negative sentence for the source, action in its words beyond the grammar, and these words."""
        about = ", ".join(words for words, _ in self.denied.actions)
        unread = self.denied.unused
        read = source.read(", ".join(unread)) if unread else None
        if read is None or not read.known:
            return about, "", frozenset()
        return ", ".join(filter(None, (about, *unread))), read.action, frozenset(unread)


def _motion_sentence(wanted: str, said: Phrases) -> str:
    """Prompt without the words for body, position, orientation, speed and surroundings."""
    others = [words for words, meaning in said.reader.understood if not meaning.startswith(_KEPT)]
    if not others:
        return wanted
    text = normalise(split_keyword(wanted)[0])
    for words in sorted(others, key=len, reverse=True):
        text = re.sub(rf"(?<![\w.]){re.escape(words)}(?!\w)", " ", text, count=1)
    return re.sub(r"(?: ,)+", ",", " ".join(text.split())).strip(" ,")
