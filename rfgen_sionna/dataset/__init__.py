"""Run files, with the samples, images, meshes, labels and settings of a run, and data sets of many runs in shards."""

from rfgen_sionna.dataset.actor_record import ActorRecord, LabelRecord
from rfgen_sionna.dataset.checksums import Damage, damaged
from rfgen_sionna.dataset.reader import Run, open_run
from rfgen_sionna.dataset.recording_set import RecordingSet, open_dataset
from rfgen_sionna.dataset.schema import (
    STANDARD_LABELS,
    ActorInfo,
    Label,
    RunFormatError,
    RunInfo,
    StoredArray,
    StoredAxis,
)  # fmt: skip
from rfgen_sionna.dataset.set_index import IndexRow
from rfgen_sionna.dataset.store import OutputError, RunWriter, check_output, check_run_output
from rfgen_sionna.dataset.verified_files import ChecksumError

__all__ = [
    "STANDARD_LABELS", "ActorInfo", "ActorRecord", "ChecksumError", "Damage", "IndexRow", "Label", "LabelRecord",
    "OutputError", "RecordingSet", "Run", "RunFormatError", "RunInfo", "RunWriter", "StoredArray", "StoredAxis",
    "check_output", "check_run_output", "damaged", "open_dataset", "open_run",
]  # fmt: skip
