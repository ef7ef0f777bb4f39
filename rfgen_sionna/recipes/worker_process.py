"""Main module of a worker: `python -m rfgen_sionna.recipes.worker_process`, started by the engine of local processes.

Standard input has the job, and a line with the number of each recording; standard output gets a line of JSON for each.
The worker ends with its driver: at the end of its input, or by Linux where Python code is stopped.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import pickle
import signal
import sys
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread

READY = "ready"
"""First line of a worker that has its job."""
_PR_SET_PDEATHSIG = 1


def main() -> None:
    """Work until the input ends."""
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what libraries print goes to standard error
    faulthandler.enable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # at ^C the driver ends the workers
    if sys.argv[1:] == ["--end-with-parent"]:
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    source = sys.stdin.buffer
    job = pickle.loads(source.read(int(source.readline())))
    numbers: SimpleQueue[int] = SimpleQueue()

    def receive() -> None:
        for line in source:
            numbers.put(int(line))
        os._exit(0)

    Thread(target=receive, daemon=True).start()
    answers.write(f"{READY}\n".encode())
    while True:
        answers.write(json.dumps(job(numbers.get()).to_dict()).encode() + b"\n")


if __name__ == "__main__":
    main()
