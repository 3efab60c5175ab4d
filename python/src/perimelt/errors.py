"""What can go wrong, in sentences for the user."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class PerimeltError(Exception):
    """Base of all errors of this package."""


class LogError(PerimeltError):
    """A file is not the log of a run, or cannot be read."""


class DamagedError(LogError):
    """A part of a log whose checksum or form is wrong.

    Attributes:
        offset: start of the damaged record in the file, bytes
        reason: what is wrong with it
    """

    def __init__(self, offset: int, reason: str, what: str = "the log") -> None:
        super().__init__(f"{what} is damaged at byte {offset}: {reason}")
        self.offset = offset
        self.reason = reason


class UnknownNameError(PerimeltError, KeyError):
    """A body, field, component or plugin that is not there."""

    def __init__(self, what: str, name: str, known: Iterable[str], note: str = "") -> None:
        names = list(known)
        close = get_close_matches(name, names, n=1)
        hint = f"; did you mean `{close[0]}`?" if close else "."
        listed = ", ".join(f"`{known}`" for known in names) or "none"
        super().__init__(f"there is no {what} `{name}`{hint} Known: {listed}{note}")

    def __str__(self) -> str:
        # KeyError prints the representation of its argument
        return str(self.args[0])


class NoStateError(PerimeltError, LookupError):
    """A time at which no state was logged."""


class CaseError(PerimeltError, ValueError):
    """A case that cannot be read, or a change that does not fit it."""


class RunError(PerimeltError):
    """The program was not found, refused the case, or stopped with an error.

    Attributes:
        status: exit status of the program; None if it did not start
    """

    def __init__(self, message: str, status: int | None = None) -> None:
        super().__init__(message)
        self.status = status


class DamageWarning(UserWarning):
    """A part of a log is missing or damaged; what remains is used."""
