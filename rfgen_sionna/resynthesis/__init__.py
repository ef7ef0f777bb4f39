"""Other recordings of a run from its stored paths, without a trace: other noise, receivers, powers and presets."""

from rfgen_sionna.resynthesis.path_samples import Resynthesis
from rfgen_sionna.resynthesis.resynthesized_run import resynthesize

__all__ = ["Resynthesis", "resynthesize"]
