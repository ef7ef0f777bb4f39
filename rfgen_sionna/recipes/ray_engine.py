"""Recordings by a cluster of Ray: tasks of one recording each, which write their files to the shared folder."""

from __future__ import annotations

import os
import shutil
import sys
import uuid
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.recipes.outcome import Job, Outcome
from rfgen_sionna.recipes.recording_job import ONE_THREAD, WITHOUT_GPU

INSTALL = "pip install 'rfgen-sionna[cluster]'"
IN_FLIGHT = 2
"""Tasks that are submitted for each one that can run: more would only fill the scheduler."""
RECORDINGS_PER_PROCESS = 50
"""Recordings after which Ray replaces a process, which bounds its memory."""
PROBE_TIMEOUT = 120.0
"""Time for a machine to say whether it sees the folder [s]."""


class RayCluster:
    """Engine of Ray.

    Parameters
    ----------
    workers
        Most tasks at a time; None takes all that the cluster has room for.
    address
        "auto" for the running cluster, its address, or "local" (None) for one of this process.
    gpus_per_worker
        GPUs of each task, also a fraction.
    folder
        Folder of the recordings, which all machines share.

    Raises
    ------
    ImportError
        If Ray is not installed.
    ValueError
        If `workers` is no whole number of at least 1.
    """

    def __init__(
        self, workers: int | None = None, *, address: str | None = None, gpus_per_worker: float = 0.0, folder: Path
    ) -> None:
        try:
            import ray
        except ImportError as error:
            raise ImportError(f"the engine 'ray' needs Ray: {INSTALL}") from error
        if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
            raise ValueError(f"workers is {workers!r}: a whole number of at least 1 is needed")
        self._ray: Any = ray
        self.workers, self._address, self._gpus, self._folder = workers, address or "local", gpus_per_worker, folder

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        """Outcomes of the recordings, in the order in which they end.

        Raises
        ------
        ConnectionError
            If there is no cluster at the address.
        ValueError
            If a machine does not share the folder, has other versions of the software, or no task fits.
        """
        ray = self._ray
        own = not ray.is_initialized()
        if own:
            ray.init(**self._options())
        waiting: dict[Any, int] = {}
        try:
            self._check_machines()
            most = self._slots() * IN_FLIGHT
            # A task that ends its process is run once more.
            task = ray.remote(num_cpus=1, num_gpus=self._gpus, max_retries=1, max_calls=RECORDINGS_PER_PROCESS)(_work)
            shared, left = ray.put(job), iter(numbers)
            while True:
                while len(waiting) < most and (number := next(left, None)) is not None:
                    waiting[task.remote(shared, number)] = number
                if not waiting:
                    return
                for each in ray.wait(list(waiting), num_returns=1)[0]:
                    number = waiting.pop(each)
                    try:
                        outcome = Outcome.from_dict(ray.get(each))
                    except ray.exceptions.RayError as error:
                        outcome = Outcome(number, "crashed", f"{type(error).__name__}: {error}"[:500])
                    yield outcome
        finally:
            for each in waiting:
                ray.cancel(each, force=True)
            if own:
                ray.shutdown()

    def _options(self) -> dict[str, Any]:
        variables = ONE_THREAD | ({} if self._gpus else WITHOUT_GPU)
        options: dict[str, Any] = {"address": self._address, "log_to_driver": False, "logging_level": "ERROR"}
        if self._address == "local":
            variables["PYTHONPATH"] = os.pathsep.join(each or os.getcwd() for each in sys.path)
            options["include_dashboard"] = False
            if self.workers is not None:
                options["num_cpus"] = self.workers
        return {**options, "runtime_env": {"env_vars": variables}}

    def _slots(self) -> int:
        """Number of tasks that the cluster has room for."""
        resources = self._ray.cluster_resources()
        slots = int(resources.get("CPU", 0))
        if self._gpus:
            gpus = resources.get("GPU", 0.0)
            # A fraction is of one GPU.
            slots = min(slots, int(gpus // self._gpus) if self._gpus >= 1.0 else int(gpus) * int(1.0 // self._gpus))
        if slots < 1:
            raise ValueError(
                f"the cluster has {resources.get('CPU', 0):g} cores and {resources.get('GPU', 0):g} GPUs, too few for "
                f"a task of one core and {self._gpus:g} GPUs"
            )
        return slots if self.workers is None else min(slots, self.workers)

    def _check_machines(self) -> None:
        """ValueError if a machine does not see the folder, or has other software, which would give other bits."""
        ray, probe = self._ray, self._folder / f"probe-{uuid.uuid4().hex}"
        probe.mkdir(parents=True)
        try:
            task = ray.remote(num_cpus=0)(_seen)
            asked = []
            for node in ray.nodes():
                if node["Alive"]:
                    where = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
                    answer = task.options(scheduling_strategy=where).remote(str(probe))
                    asked.append((node["NodeManagerHostname"], answer))
            for name, answer in asked:
                try:
                    there, versions = ray.get(answer, timeout=PROBE_TIMEOUT)
                except ray.exceptions.RayError as error:
                    raise ValueError(f"machine '{name}' cannot run this package: {error}") from error
                if not there:
                    raise ValueError(
                        f"machine '{name}' does not see '{self._folder}': the output must be on a disk that all "
                        "machines of the cluster share, under the same path"
                    )
                other = {key: version for key, version in software_versions().items() if versions.get(key) != version}
                if other:
                    found = ", ".join(
                        f"{key} {versions.get(key)} instead of {version}" for key, version in other.items()
                    )
                    raise ValueError(
                        f"machine '{name}' has {found}: recordings would differ; install the same versions"
                    )
        finally:
            shutil.rmtree(probe, ignore_errors=True)


def _work(job: Job, number: int) -> dict[str, Any]:
    return job(number).to_dict()


def _seen(path: str) -> tuple[bool, dict[str, str]]:
    return Path(path).is_dir(), software_versions()
