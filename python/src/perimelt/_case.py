"""Cases as dictionaries, and changes to them."""

from __future__ import annotations

import copy
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from .errors import CaseError, UnknownNameError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Case = Mapping[str, Any]
# Values by their paths. A string is split at its dots; a tuple has one key an entry, for names that
# contain dots. Several types, because the keys of a Mapping are invariant.
Changes = (
    Mapping[str, Any] | Mapping[tuple[str | int, ...], Any] | Mapping[Sequence[str | int], Any]
)


def parse(text: str, name: str) -> dict[str, Any]:
    """The case in a TOML text that is called `name`."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CaseError(f"{name} is not TOML: {error}") from error


def read_case(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The case in a file."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"cannot read the case {path}: {error}") from error
    return parse(text, str(path))


def case_text(case: Case) -> str:
    """The TOML text of a case."""
    text: str = tomli_w.dumps(_plain(case, ()))
    return text


def change_case(case: Case, changes: Changes) -> dict[str, Any]:
    """A copy of a case with other values.

    Keys are paths: `"time.end"`, `"bodies.plate.spacing"`, `"couplers.goldak.power"`. An entry of a
    list is chosen by its `type` or `name` where only one entry has it, or by its number from 0:
    `"couplers.1.power"`. A path with names that contain dots is a tuple: `("probes", "1.5 mm",
    "kind")`. The value None removes the key. Sections that the case does not have are added;
    whether it then makes sense is checked by the program.

    Raises:
        CaseError, UnknownNameError: the case has no such path
    """
    changed: dict[str, Any] = copy.deepcopy(dict(case))
    for path, value in changes.items():
        keys = path.split(".") if isinstance(path, str) else list(path)
        if not keys or any(key == "" for key in keys):
            raise CaseError(f"{path!r} is not a path of keys, such as `time.end`")
        target: Any = changed
        for depth, key in enumerate(keys[:-1]):
            place = ".".join(map(str, keys[:depth]))
            target = _enter(target, key, place)
        _set(target, keys[-1], value, ".".join(map(str, keys[:-1])))
    return changed


def _enter(target: Any, key: str | int, place: str) -> Any:
    if isinstance(target, list):
        return target[_entry(target, key, place)]
    if not isinstance(target, dict):
        raise CaseError(f"`{place}` is {target!r}, which has no key `{key}`")
    return target.setdefault(str(key), {})


def _set(target: Any, key: str | int, value: Any, place: str) -> None:
    if isinstance(target, list):
        number = _entry(target, key, place)
        if value is None:
            del target[number]
        else:
            target[number] = value
    elif not isinstance(target, dict):
        raise CaseError(f"`{place}` is {target!r}, which has no key `{key}`")
    elif value is None:
        target.pop(str(key), None)
    else:
        target[str(key)] = value


def _entry(entries: list[Any], key: str | int, place: str) -> int:
    """Number of the entry of a list that a key means."""
    names = [
        (number, entry.get(label))
        for number, entry in enumerate(entries)
        if isinstance(entry, dict)
        for label in ("name", "type")
    ]
    found = [number for number, name in names if name == key]
    if len(found) > 1:
        numbers = " and ".join(f"`{place}.{number}`" for number in found)
        raise CaseError(f"several entries of `{place}` are called `{key}`: {numbers}")
    if found:
        return found[0]
    if isinstance(key, int) or key.lstrip("-").isdecimal():
        number = int(key)
        if not -len(entries) <= number < len(entries):
            raise CaseError(f"`{place}` has {len(entries)} entries; there is no `{place}.{key}`")
        return number % len(entries)
    raise UnknownNameError(f"entry of `{place}`", key, [name for _, name in names if name])


def _plain(value: Any, path: tuple[str, ...]) -> Any:
    """A value of types that TOML has."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(entry, (*path, str(number))) for number, entry in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, (bool, int, float, str)):
        return value
    raise CaseError(
        f"`{'.'.join(path)}` is {value!r}; expected a number, text, true or false, list or table"
    )
