"""Views of imagined environments, kept for those that are asked for next; the least recently used go first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field

from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir

ENVIRONMENTS, VIEWS = 32, 16
"""Most environments, and most views of each, that are kept: 50 MB of images of 64 x 64 pixels."""


@dataclass
class _CachedEnvironment:
    first: View
    """How it was seen first, which its layout depends on; remembered as long as any view."""
    views: OrderedDict[View, Pir] = field(default_factory=OrderedDict)


class ViewCache:
    """Views by their environment; each look-up takes the same time, however many are kept.

    Parameters
    ----------
    environments, views
        Most environments, and most views of each.
    """

    def __init__(self, environments: int = ENVIRONMENTS, views: int = VIEWS) -> None:
        self._most, self._most_views = environments, views
        self._cache: OrderedDict[Hashable, _CachedEnvironment] = OrderedDict()

    def find(self, environment: Hashable, view: View) -> Pir | None:
        """The image of that view, if it is kept."""
        known = self._cache.get(environment)
        if known is None or view not in known.views:
            return None
        self._cache.move_to_end(environment)
        known.views.move_to_end(view)
        return known.views[view]

    def first(self, environment: Hashable) -> View | None:
        """How an environment was seen first; None where nothing of it is kept."""
        known = self._cache.get(environment)
        return None if known is None else known.first

    def images_of(self, environment: Hashable) -> list[Pir]:
        """All images of an environment that are kept, the most recently used last."""
        known = self._cache.get(environment)
        return [] if known is None else list(known.views.values())

    def add(self, environment: Hashable, pir: Pir) -> None:
        """Keep an image, and forget what has not been asked for longest where there is no more room."""
        view = View.of(pir)
        known = self._cache.setdefault(environment, _CachedEnvironment(view))
        known.views[view] = pir
        known.views.move_to_end(view)
        self._cache.move_to_end(environment)
        if len(known.views) > self._most_views:
            known.views.popitem(last=False)
        if len(self._cache) > self._most:
            self._cache.popitem(last=False)
