"""The log of a run."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from . import _series
from ._body import Body
from ._case import parse
from ._file import Damage, LogFile
from .errors import DamageWarning, LogError, PerimeltError, UnknownNameError

PROBES = "/probes/"
REPORTS = "/probes/reports"


class Log(Mapping[str, Body]):
    """The log of a run: a mapping from the names of the bodies to the bodies.

    A run that was killed leaves an unfinished log, and storage may damage one. What is sound is
    used, and a `DamageWarning` tells what is lost. A log that a run is writing can be read, too: it
    has what was logged when it was opened.

    Attributes:
        path: the file
        version: version of the program
        threads: number of threads of the run
        started: start of the run
        plugins: physics and couplers as composed, with all defaults filled in
        case_name: name of the case file
        case_folder: folder from which relative paths in the case start
        case_text: the case file as run
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._file = file = LogFile(self.path)
        missing = None
        if file.case_text is None:
            missing = "attachment `case.toml`"
        elif file.run is None:
            missing = "metadata `run`"
        if missing is not None or file.case_text is None or file.run is None:
            file.close()
            cut = "" if file.finished else " (the file is cut off before that)"
            raise LogError(f"{path} is not the log of a Perimelt run: it has no {missing}{cut}")
        try:
            run: dict[str, Any] = {key: json.loads(text) for key, text in file.run.items()}
            self.version: str = run["version"]
            self.threads: int = run["threads"]
            self.started = datetime.fromtimestamp(run["started"], timezone.utc)
            self.plugins: dict[str, Any] = run["plugins"]
            self.case_name: str = run.get("case_file", "")
            self.case_folder = Path(run.get("case_folder", ""))
            self._bodies = {info["name"]: Body(file, info) for info in run["bodies"]}
        except (KeyError, TypeError, ValueError) as error:
            file.close()
            raise LogError(
                f"the description of the run in {path} cannot be read ({error!r}); "
                "was it written by another version?"
            ) from error
        self.case_text: str = file.case_text
        for damage in file.damage:
            warnings.warn(f"{path}: {damage}", DamageWarning, stacklevel=3)
        if not file.finished and not self.is_being_written():
            warnings.warn(f"{path}: {self.ending}", DamageWarning, stacklevel=3)

    def close(self) -> None:
        """Closes the file; states can no longer be read."""
        self._file.close()

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # Bodies

    def __getitem__(self, name: str) -> Body:
        try:
            return self._bodies[name]
        except KeyError:
            raise UnknownNameError("body", name, self._bodies) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._bodies)

    def __len__(self) -> int:
        return len(self._bodies)

    def __repr__(self) -> str:
        title = self.case.get("case", {}).get("title", self.case_name)
        span = "no states"
        if len(self.times) > 0:
            span = f"{len(self.times)} states from {self.times[0]:.6g} to {self.times[-1]:.6g} s"
        ending = "finished" if self.finished else "unfinished"
        return f"<Log {self.path}: {title}; {', '.join(self)}; {span}; {ending}>"

    @property
    def bodies(self) -> dict[str, Body]:
        """The bodies by name, in the order of the case."""
        return dict(self._bodies)

    def body(self, name: str | None = None) -> Body:
        """The body with a name, or the only one."""
        if name is not None:
            return self[name]
        if len(self._bodies) != 1:
            names = ", ".join(f"`{name}`" for name in self._bodies)
            raise PerimeltError(f"the log has several bodies, name one of them: {names}")
        return next(iter(self._bodies.values()))

    @cached_property
    def times(self) -> npt.NDArray[np.float64]:
        """Times of the logged states of all bodies, s."""
        return np.unique(np.concatenate([body.times for body in self._bodies.values()]))

    # The run

    @property
    def finished(self) -> bool:
        """Whether the writer closed the log.

        The run need not have reached its end: one that was interrupted, or that stopped with an
        error, closes its log, too.
        """
        return self._file.finished

    def is_being_written(self) -> bool:
        """Whether a run is writing the log now, as far as the system tells."""
        return self._file.is_being_written()

    @property
    def ending(self) -> str:
        """How the log ends, in a sentence."""
        if self.finished:
            return "the log is complete"
        last = f"its last state is at {self.times[-1]:.6g} s" if len(self.times) else "no state"
        return f"the log is unfinished: it ends at byte {self._file.end}, {last}; " + (
            "a run is writing it" if self.is_being_written() else "the run was killed"
        )

    @property
    def damage(self) -> list[Damage]:
        """Parts of the log that cannot be read; damaged states are found when they are read."""
        return list(self._file.damage)

    @property
    def case(self) -> dict[str, Any]:
        """The case file as run, parsed."""
        return parse(self.case_text, self.case_name)

    # Time series

    @property
    def probes(self) -> pd.DataFrame:
        """The probes over time: columns are (probe, quantity), units in `attrs["units"]`.

        `log.probes["melt pool"]` is the frame of one probe.
        """
        return self._probes.copy()

    @cached_property
    def _probes(self) -> pd.DataFrame:
        topics = sorted(topic for topic in self._file.small if topic.startswith(PROBES))
        return _series.side_by_side(
            {topic[len(PROBES) :]: self._series(topic) for topic in topics if topic != REPORTS}
        )

    @cached_property
    def _reports(self) -> pd.DataFrame:
        return self._series(REPORTS)

    @property
    def reports(self) -> pd.DataFrame:
        """What couplers and physics report over time, such as `goldak.power.deposited`."""
        return self._reports.copy()

    @cached_property
    def _balance(self) -> pd.DataFrame:
        return self._series("/balance")

    @property
    def balance(self) -> pd.DataFrame:
        """Energy, mass and momentum over time: `thermal.heat.stored`, `.supplied`, `.error`."""
        return self._balance.copy()

    @cached_property
    def _progress(self) -> pd.DataFrame:
        return _series.progress(self._file.small.get("/progress", ()))

    @property
    def progress(self) -> pd.DataFrame:
        """Steps, their size, sub-steps, iterations and wall time over simulated time."""
        return self._progress.copy()

    def _series(self, topic: str) -> pd.DataFrame:
        return _series.series(self._file.small.get(topic, ()), self._file.columns(topic))
