"""Run files: one HDF5 file with the samples, images, meshes, labels and settings of a run."""

from rfgen_sionna.dataset.reader import ActorRecord, LabelRecord, Run, open_run
from rfgen_sionna.dataset.schema import STANDARD_LABELS, ActorInfo, Label, RunFormatError, RunInfo
from rfgen_sionna.dataset.store import OutputError, RunWriter, check_output, check_run_output

__all__ = [
    "STANDARD_LABELS", "ActorInfo", "ActorRecord", "Label", "LabelRecord", "OutputError", "Run", "RunFormatError",
    "RunInfo", "RunWriter", "check_output", "check_run_output", "open_run",
]  # fmt: skip
