"""Validates case files, or one of them, by the JSON schema that `perimelt schema` prints."""

import json
import sys
import tomllib
from pathlib import Path

from jsonschema import Draft202012Validator

schema = json.loads(Path(sys.argv[1]).read_text())
Draft202012Validator.check_schema(schema)
validator = Draft202012Validator(schema)

place = Path(sys.argv[2])
other = {"materials", "src", "toolpaths", "spacings"}
if place.is_file():
    files = [place]
else:
    files = sorted(place.glob("*/*.toml"))
    files = [file for file in files if file.parent.name not in other]
    assert len(files) > 100, "where are the cases?"

wrong = 0
for file in files:
    error = next(validator.iter_errors(tomllib.loads(file.read_text())), None)
    if error is not None:
        wrong += 1
        key = ".".join(str(part) for part in error.absolute_path)
        print(f"{file.name}: {key}: {error.message[:200]}")
        for inner in error.context or ():
            if "const" not in str(inner.validator):
                print(f"    {list(inner.absolute_path)}: {inner.message[:200]}")
if place.is_dir():
    assert wrong == 0
    print(f"{len(files)} case files are valid")
