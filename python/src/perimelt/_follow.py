"""A log that a run is writing."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from ._log import Log
from .errors import DamageWarning


def follow(path: str | os.PathLike[str], *, poll: float = 1.0) -> Iterator[Log]:
    """Opens a log again whenever a run has logged further states, until the run ends.

        for log in perimelt.follow("weld.mcap"):
            print(log.times[-1], log.probes["melt pool", "width"].iloc[-1])

    Waits for a log that does not exist yet. Each log is closed when the next one is opened. The
    last one has all states of the run.

    Args:
        path: the log
        poll: wall time between two looks at it, s
    """
    file = Path(path)
    size = -1
    states = -1
    log: Log | None = None
    while True:
        found = file.stat().st_size if file.exists() else -1
        if found >= 0 and found != size:
            size = found
            with warnings.catch_warnings():
                # what is being written ends anywhere
                warnings.simplefilter("ignore", DamageWarning)
                newer = Log(file)
            if len(newer.times) == states and not newer.finished:
                # the log of the last states stays open
                newer.close()
            else:
                if log is not None:
                    log.close()
                log, states = newer, len(newer.times)
                yield log
                if log.finished:
                    return
        elif log is not None and not log.is_being_written():
            return
        time.sleep(poll)
