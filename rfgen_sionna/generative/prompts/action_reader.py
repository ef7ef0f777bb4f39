"""Reading of an action in a sentence, by a sentence encoder and a trained head.

The head gives probabilities of actions and of topics that no action covers. Sides and directions are read by the order
of words (:mod:`.word_order`). Below a probability chosen on held-out sentences a reading is refused; figures of merit
are beside the weights.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES
from rfgen_sionna.generative.prompts import clauses, sentence_features
from rfgen_sionna.generative.prompts.caption_encoder import CaptionEncoder
from rfgen_sionna.generative.prompts.word_order import FAMILIES, KINDS, actions_of, limb_side

WEIGHTS = Path(__file__).with_name("weights") / "action_reader.npz"
"""File of the head."""
REFUSED = "refused: "
"""Beginning of the labels of what no action covers; the topic follows."""
_QUIET = frozenset({"talk", "mind", "states", "music"})
"""Topics that may go on beside an action, without an effect on it."""
_NO_ACTIONS = {
    "not_people": "it is about no person",
    "not_actions": "it names no action",
    "others_do_it": "the person does not do the action",
    "idioms": "there is no motion for that",
    "states": "it is a state, or no movement of the body",
}
"""Topic -> reason of its refusal, where it is no activity."""
_CLEAR = 0.6
"""Share of the probability of all kinds of an action from which one kind is meant."""
_SURE = 0.9
"""Probability from which a clause decides against the others."""


@dataclass(frozen=True)
class ActionReading:
    """Action that a sentence names."""

    text: str
    action: str
    """The likeliest action."""
    probability: float
    """That the words mean it, of 1."""
    nearest: tuple[str, str, str]
    """The three likeliest actions, for refusals."""
    possible: bool
    """Whether the words mean an action that can be done; otherwise `reason` is against it."""
    options: tuple[str, ...] = ()
    """Actions that the words leave open, `action` among them."""
    arms: str = ""
    """Action of the arms at the same time; empty for none."""
    side: str = ""
    """"left" or "right" in the words, where the action leaves it open."""
    unknown: tuple[str, ...] = ()
    """Words that no wording of the action has: they have no effect."""
    doubt: int = 0
    """0 where all words are known, 2 where the first one is not, which mostly is the verb, and 1 for others."""
    reason: str = ""
    """Why the action cannot be done."""
    topic: str = ""
    """Topic of words that no action covers; empty where an action is likelier."""
    against: float = 0.0
    """Probability that no action covers the words, of 1."""


class ActionReader:
    """Reads actions.

    Parameters
    ----------
    actions
        Actions that can be done; all of the catalogue by default.
    head
        File of the trained head; the shipped one by default.

    Raises
    ------
    ImportError
        The sentence encoder is missing.
    FileNotFoundError
        The head is missing.
    """

    def __init__(self, actions: Collection[str] | None = None, *, head: Path = WEIGHTS) -> None:
        self.actions = frozenset(ACTION_CLAUSES if actions is None else actions)
        self._encoder, self._head = CaptionEncoder(), _Head(head)

    def read(self, text: str) -> ActionReading:
        """Action of a sentence or of keywords about one person, without numbers and places as far as possible.

        Raises
        ------
        ValueError
            The text has no words.
        """
        said = sentence_features.respelled(clauses.plain(text), self._head.words, self._encoder.knows)
        if not sentence_features.words(said):
            raise ValueError(f"text: {text!r} has no words; write an action, such as 'a person walks'")
        parts = clauses.split(said)
        whole, *others = self._readings([said, *parts.texts])
        reading = self._joined(whole, others, parts) if others else whole
        if reading.possible and not reading.arms and reading.action in clauses.ARMS:
            reading = _over_legs(reading)
        against = clauses.refusal(said)
        if against:
            reading = replace(reading, possible=False, reason=against)
        return replace(reading, text=text)

    def _readings(self, texts: Sequence[str]) -> list[ActionReading]:
        texts = [clauses.canonical(text) for text in texts]
        every = self._head.probabilities(self._encoder.embed(texts), texts)
        return [self._reading(text, row) for text, row in zip(texts, every, strict=True)]

    def _reading(self, text: str, probabilities: NDArray[np.float32]) -> ActionReading:
        """Reading of one clause from the probabilities of the labels."""
        head = self._head
        order = [int(i) for i in np.argsort(-probabilities, kind="stable")]
        likely = [head.labels[i] for i in order]
        families = [label for label in likely if not label.startswith(REFUSED)]
        family, share = self._sure_of(families[0], probabilities)
        if not set(actions_of(family, text)) & self.actions:
            family = KINDS.get(family, family)
        options = actions_of(family, text)
        near = list(dict.fromkeys(a for each in (family, *families) for a in actions_of(each, text)))
        near = [action for action in near if action in self.actions]
        unknown = head.unknown(text, family)
        doubt = 0 if not unknown else 1 if sentence_features.content(text)[0] not in unknown else 2
        limit = head.limits[doubt]
        reason = ""
        if likely[0].startswith(REFUSED):
            topic = likely[0].removeprefix(REFUSED)
            reason = _NO_ACTIONS.get(topic, f"there is no motion for that ({topic.replace('_', ' ')})")
        elif share < limit:
            reason = f"its action is not clear (probability {share:.2f}, at least {limit:.2f} is needed)"
        elif not set(options) & self.actions:
            reason = f"there is no motion for {options[0]!r}"
        options = tuple(a for a in options if a in self.actions) or options
        return ActionReading(
            text,
            options[0],
            share,
            (near[0], near[1], near[2]),
            not reason,
            options,
            side="" if family in FAMILIES and len(options) == 1 else limb_side(text),
            unknown=unknown,
            doubt=doubt,
            reason=reason,
            topic=likely[0].removeprefix(REFUSED) if likely[0].startswith(REFUSED) else "",
            against=float(sum(probabilities[i] for i in order if head.labels[i].startswith(REFUSED))),
        )

    def _sure_of(self, family: str, probabilities: NDArray[np.float32]) -> tuple[str, float]:
        """The likeliest family and its probability, or those of what it is a kind of, where only that is clear."""
        share = {each: float(p) for each, p in zip(self._head.labels, probabilities, strict=True)}
        kind = KINDS.get(family, family)
        together = share[kind] + sum(share[each] for each, of in KINDS.items() if of == kind)
        if share[family] >= _SURE or family not in {*KINDS, *KINDS.values()}:
            return family, share[family]
        return (family, share[family]) if share[family] >= _CLEAR * together else (kind, together)

    def _joined(self, whole: ActionReading, parts: Sequence[ActionReading], said: clauses.Clauses) -> ActionReading:
        """Reading of a sentence of several clauses."""
        named = [part for part in parts if part.possible]
        if not named:
            return whole
        sure = whole.possible and whole.probability > _SURE and not (said.sequence and whole.unknown)
        for part in parts:
            if sure or part.possible or part.topic in _QUIET or clauses.ENDS.search(part.text):
                continue
            if said.sequence or part.against > _SURE:
                return replace(whole, possible=False, reason=f"{part.text!r} cannot be done: {part.reason}")
        several: list[ActionReading] = []
        for part in named:
            if part.action != "standing" and not any(set(part.options) & set(each.options) for each in several):
                several.append(part)
        actions = [part.action for part in several]
        if len(actions) < 2 or clauses.covers(whole.action, actions):
            agrees = clauses.covers(whole.action, actions) or bool(set(whole.options) & set(several[0].options))
            return whole if whole.possible and agrees else self._single(whole, named)
        legs = [part for part in several if part.action in clauses.LEGS]
        arms = [part for part in several if part.action in clauses.ARMS]
        if not said.sequence and len(actions) == 2 and len(legs) == len(arms) == 1:
            return replace(
                legs[0],
                arms=arms[0].action,
                probability=min(legs[0].probability, arms[0].probability),
                side=legs[0].side or arms[0].side,
                unknown=(*legs[0].unknown, *arms[0].unknown),
            )
        named_actions = " and ".join(repr(action) for action in actions)
        reason = f"it names several actions ({named_actions}); ask for one at a time"
        return replace(whole, possible=False, reason=reason)

    def _single(self, whole: ActionReading, named: Sequence[ActionReading]) -> ActionReading:
        """Reading by the one clause that names an action; the words of the others have no effect."""
        part = next((part for part in named if part.action != "standing"), named[0])
        heard = {sentence_features.stem(word) for word in sentence_features.words(part.text)}
        rest = [w for w in sentence_features.content(whole.text) if sentence_features.stem(w) not in heard]
        return replace(part, unknown=(*part.unknown, *(word for word in rest if word not in part.unknown)))


def _over_legs(reading: ActionReading) -> ActionReading:
    """A reading of an action of the arms, over the action of the legs whose verb is among the unknown words."""
    for word in reading.unknown:
        legs = clauses.LEG_VERBS.get(sentence_features.stem(word))
        if legs is not None:
            unknown = tuple(each for each in reading.unknown if each != word)
            return replace(reading, action=legs, options=(legs,), arms=reading.action, unknown=unknown)
    return reading


class _Head:
    """Trained head: softmax of a linear function of the features."""

    def __init__(self, path: Path) -> None:
        with np.load(path, allow_pickle=False) as stored:
            facts = json.loads(stored["facts"].tobytes())
            self._weights = stored["weights"].astype(np.float32)
            self._bias = stored["bias"].astype(np.float32)
        self.labels: list[str] = facts["labels"]
        self.limits: tuple[float, ...] = tuple(facts["limits"])
        """Least probability of a reading, by its doubt."""
        self._stems = {label: frozenset(stems) for label, stems in facts["stems"].items()}
        self._common = frozenset(facts["common"])
        self.words = frozenset(facts["words"])
        """Words of the training sentences."""

    def probabilities(self, vectors: NDArray[np.float32], texts: Sequence[str]) -> NDArray[np.float32]:
        """(text, label)."""
        scores = sentence_features.design(vectors, texts) @ self._weights + self._bias
        shares = np.exp(scores - scores.max(axis=1, keepdims=True))
        return shares / shares.sum(axis=1, keepdims=True)

    def unknown(self, text: str, family: str) -> tuple[str, ...]:
        """Words that no wording of the family has."""
        known = self._stems[family] | self._common | {"stand"}
        said = dict.fromkeys(sentence_features.content(text))
        stems = {word: sentence_features.stem(word) for word in said}
        return tuple(word for word, stem in stems.items() if stem not in known)
