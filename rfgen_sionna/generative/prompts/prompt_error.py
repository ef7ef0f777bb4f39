"""Error of prompts."""

from __future__ import annotations


class PromptError(ValueError):
    """The prompt cannot be carried out: its words are unknown, ambiguous or contradictory."""
