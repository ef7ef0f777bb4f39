"""Windows in time of the recordings of a set, as arrays with the labels of each: what loaders and exports give out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.recording_set import RecordingSet, open_dataset
from rfgen_sionna.dataset.representations import KEPT, POINT_FIELDS, REPRESENTATIONS
from rfgen_sionna.dataset.schema import RunFormatError

if TYPE_CHECKING:
    from rfgen_sionna.dataset.set_index import IndexRow

Computed = Callable[[Run, slice], Any]
"""Function of the run of one radar and of frames in it, with an array (frame, ...) as result."""
RepresentationChoice = str | Computed | Mapping[str, str | Computed]
"""One representation, by its name or as a function, or several by the names that their arrays get."""

_CLASSES = ("action", "actions", "place")
_NUMBERS = ("recording", "distance_m", "azimuth_deg", "orientation_deg", "people", "duration_s", "seed")
MAX_POINTS = 128
"""Points of a frame in arrays of point clouds, the strongest ones."""


@dataclass(frozen=True)
class TimeWindow:
    """Frames of one recording."""

    position: int
    """Position of the recording in its set."""
    first: int
    count: int

    @property
    def frames(self) -> slice:
        """The frames."""
        return slice(self.first, self.first + self.count)


def actor_names(run: Run) -> tuple[str, ...]:
    """Names of the actors of a run, in the order of the axis "actor"."""
    names = run.stored("actor")
    return () if names is None else tuple(names.asstr()[:])


class WindowReader:
    """Arrays and labels of windows of a set's recordings.

    Parameters
    ----------
    folder
        Folder of the set, or an open set.
    split
        Name of a split; None takes all recordings.
    representation
        What the arrays are: "adc", a representation (:data:`~rfgen_sionna.dataset.representations.REPRESENTATIONS`), a
        function, or a dictionary of these. Point clouds have `max_points` rows a frame, of zeros where there are fewer.
    labels
        Names of labels: "action" (class number of the only actor), "actions" (1 for each class that an actor has),
        "place" (class number), numbers of the recording ("recording", "distance_m", "azimuth_deg", "orientation_deg",
        "people", "duration_s", "seed"; NaN where the recipe leaves them open), "joints" (frame, actor, joint, axis)
        [m], or a label of the runs (frame, actor, ...). Actors that a recording lacks, and joints of the first
        recording that an actor lacks, are NaN.
    radar
        Name of the radar; needed if recordings have several.
    window_s, stride_s
        Length of a window and the step between windows [s], one frame or more, rounded to frames; None takes whole
        recordings, and steps of a window.
    alike
        Whether all windows must have the same number of frames.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is there.
    """

    def __init__(
        self,
        folder: str | PathLike[str] | RecordingSet,
        split: str | None,
        representation: RepresentationChoice,
        labels: Sequence[str],
        *,
        radar: str | None = None,
        window_s: float | None = None,
        stride_s: float | None = None,
        max_points: int = MAX_POINTS,
        alike: bool = True,
    ) -> None:
        whole = folder if isinstance(folder, RecordingSet) else open_dataset(folder)
        self.recordings = whole if split is None else whole.split(split)
        if not len(self.recordings):
            raise ValueError(f"split '{split}' of '{whole.folder}' has no recordings")
        self.classes = tuple(sorted({action for row in whole.rows for action in row.actions}))
        self.places = tuple(sorted({row.place for row in whole.rows}))
        self.num_actors = max((len(row.actions) for row in whole.rows), default=0)
        self.representations = dict(representation) if isinstance(representation, Mapping) else {"": representation}
        self.labels, self.radar, self.max_points = tuple(labels), radar, max_points
        for name, value in (("window_s", window_s), ("stride_s", stride_s)):
            if value is not None and not value > 0:
                raise ValueError(f"{name} is {value!r}: more than 0 s is needed")
        if stride_s is not None and window_s is None:
            raise ValueError(f"stride_s is {stride_s!r} without window_s: give the length of the windows as well")
        if max_points < 1:
            raise ValueError(f"max_points is {max_points}: at least 1 is needed")
        self.joint_names: tuple[str, ...] = ()
        if radar is None and len(names := self.recordings.radars) > 1:
            raise ValueError(f"recordings have the radars {', '.join(map(repr, names))}: radar must name one of them")
        self._check(self.run(0))
        self.windows = tuple(self._windows(window_s, stride_s, alike))

    def run(self, position: int) -> Run:
        """Run of the chosen radar in the recording at `position`."""
        run = self.recordings[position]
        return run if self.radar is None else run[self.radar]

    def arrays(self, window: TimeWindow, run: Run | None = None) -> dict[str, NDArray[Any]]:
        """Arrays of a window by their names; a single representation has the name ""."""
        run = self.run(window.position) if run is None else run
        return {name: self._array(run, each, window.frames) for name, each in self.representations.items()}

    def label_values(self, window: TimeWindow, run: Run | None = None) -> dict[str, Any]:
        """Labels of a window by their names: whole numbers, numbers, or float32 arrays."""
        run = self.run(window.position) if run is None else run
        row = self.recordings.rows[window.position]
        return {name: self._label(name, run, row, window.frames) for name in self.labels}

    def _array(self, run: Run, representation: str | Computed, frames: slice) -> NDArray[Any]:
        if not isinstance(representation, str):
            return np.asarray(representation(run, frames))
        path = KEPT[representation].dataset
        if representation in REPRESENTATIONS and run.stored(path) is not None:
            stored = run.array(path, frames)
            return self._padded(stored) if isinstance(stored, list) else stored
        found = run.representation(representation, frames)
        return found.values if found.row_splits is None else self._padded([found.frame(k) for k in range(len(found))])

    def _padded(self, clouds: Sequence[NDArray[Any]]) -> NDArray[np.float32]:
        """(frame, max_points, field) points of clouds, then zeros."""
        points = np.zeros((len(clouds), self.max_points, len(POINT_FIELDS)), np.float32)
        for number, rows in enumerate(clouds):
            points[number, : len(rows)] = rows[: self.max_points]
        return points

    def _label(self, name: str, run: Run, row: IndexRow, frames: slice) -> Any:
        if name == "action":
            return self.classes.index(row.actions[0])
        if name == "actions":
            return np.array([each in row.actions for each in self.classes], np.float32)
        if name == "place":
            return self.places.index(row.place)
        if name in _NUMBERS:
            value = getattr(row, "number" if name == "recording" else name)
            return float("nan") if value is None else value
        if name == "joints":
            return self._joints(run, frames)
        stored = run.stored(f"labels/{name}")
        if stored is None:
            raise RunFormatError(f"'{run.path}': recording {row.number} holds no label '{name}', as others do")
        values = np.asarray(stored[frames], np.float32)
        if stored.ndim < 2 or stored.dims[1].label != "actor" or values.shape[1] == self.num_actors:
            return values
        padded = np.full((len(values), self.num_actors, *values.shape[2:]), np.nan, np.float32)
        padded[:, : values.shape[1]] = values
        return padded

    def _joints(self, run: Run, frames: slice) -> NDArray[np.float32]:
        count = len(range(*frames.indices(len(run))))
        found = np.full((count, self.num_actors, len(self.joint_names), 3), np.nan, np.float32)
        for number, actor in enumerate(actor_names(run)):
            stored, names = run.stored(f"actors/{actor}/joints"), run.stored(f"actors/{actor}/joint")
            if stored is None or names is None:
                continue
            own = {name: place for place, name in enumerate(names.asstr()[:])}
            joints = stored[frames]
            for place, name in enumerate(self.joint_names):
                if name in own:
                    found[:, number, place] = joints[:, own[name]]
        return found

    def _check(self, run: Run) -> None:
        """ValueError for representations and labels that the recordings do not have."""
        where = f"the recordings of '{self.recordings.folder}'"
        for name, each in self.representations.items():
            if not isinstance(each, str):
                if not callable(each):
                    raise ValueError(f"representation {name!r} is {each!r}: a name or a function is needed")
                continue
            if each not in ("adc", *REPRESENTATIONS):
                allowed = ", ".join(map(repr, ("adc", *REPRESENTATIONS)))
                raise ValueError(f"representation is {each!r}: {allowed}, a function or a dictionary is needed")
            if each not in run.contents and "adc" not in run.contents:
                raise ValueError(f"representation is {each!r}: {where} keep {', '.join(run.contents)} only")
        stored = run.stored("labels")
        own = [name for name, data in stored.items() if not data.is_scale] if stored is not None else []
        joints = self._find_joints(run)
        there = (*_CLASSES, *_NUMBERS, *(["joints"] if joints else []), *(name for name in own if name != "action"))
        for name in self.labels:
            if name not in there:
                raise ValueError(f"labels has {name!r}: {where} have {', '.join(there)}")
        for row in self.recordings.rows if "action" in self.labels else ():
            if len(row.actions) != 1:
                raise ValueError(
                    f"labels has 'action': recording {row.number} of '{self.recordings.folder}' has "
                    f"{len(row.actions)} actors; 'actions' marks the class of each"
                )
        self.joint_names = joints

    def _find_joints(self, run: Run) -> tuple[str, ...]:
        """Joint names of the first actor with joints."""
        for actor in actor_names(run):
            if (names := run.stored(f"actors/{actor}/joint")) is not None and run.stored(f"actors/{actor}/joints"):
                return tuple(names.asstr()[:])
        return ()

    def _windows(self, window_s: float | None, stride_s: float | None, alike: bool) -> list[TimeWindow]:
        known: dict[str, tuple[int, float]] = {}
        found, lengths = [], set()
        for position, row in enumerate(self.recordings.rows):
            key = f"{row.frames} {json.dumps(row.spec.get('radars'))}"
            if key not in known:
                run = self.run(position)
                known[key] = (len(run), run.radar.waveform.frame_period)
            frames, period = known[key]
            for name, value in (("window_s", window_s), ("stride_s", stride_s)):
                if value is not None and value < period * (1 - 1e-9):
                    raise ValueError(f"{name} is {value:g}: a frame takes {period:g} s, give at least that")
            count = frames if window_s is None else max(1, round(window_s / period))
            step = count if stride_s is None else max(1, round(stride_s / period))
            lengths.add(count)
            found += [TimeWindow(position, first, count) for first in range(0, frames - count + 1, step)]
        if alike and len(lengths) > 1:
            raise ValueError(
                f"window_s is {window_s!r}: windows of the recordings have {min(lengths)} … {max(lengths)} frames, and "
                "one length is needed; give window_s, or the radar or split whose recordings are alike"
            )
        if not found:
            raise ValueError(
                f"window_s is {window_s!r}: that is {max(lengths)} frames, and the longest recording has "
                f"{max(frames for frames, _ in known.values())}"
            )
        return found
