#!/usr/bin/env python3
"""Mutation testing of a random sample with one build.

cargo-mutants builds the tests once for each mutant, which takes days for the mutants of this project. This script asks
cargo-mutants for its list, draws a sample, and writes all mutants of the sample, and those of `chosen.toml`, into a copy
of the tree, each behind a condition that an environment variable turns on. `trace` runs each test and each everyday
benchmark once and records the mutants that it reaches. `run` turns the mutants on one by one and repeats what reaches
them, the shortest first, until something fails.

    pip install tree-sitter tree-sitter-rust
    cargo install cargo-mutants
    git worktree add ../copy
    python tests/mutation/survey.py write --copy ../copy --sample 100
    python tests/mutation/survey.py build --copy ../copy
    python tests/mutation/survey.py trace --copy ../copy
    python tests/mutation/survey.py run --copy ../copy --results mutants.json
    python tests/mutation/survey.py report --results mutants.json
"""

import argparse
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

VARIABLE = "PERIMELT_MUTANT"
TRACE = "PERIMELT_REACHED_MUTANTS"
HERE = Path(__file__).resolve().parent
# tests of whole runs and of what users are told about their mistakes
RUNS = """bodies_that_meet clouds command_line coupled damaged_logs discovery eulerian_walls kill_and_resume logs messages
mistakes modes moving_window python_log random_bodies replayed view""".split()
# what must be covered, with the paths that belong to it
AREAS = {
    "couplers": ["couplers/src/"],
    "physics": ["physics/src/"],
    "core: simulation, schedule, set-up": ["core/src/simulation/", "core/src/schedule.rs", "core/src/setup"],
    "core: solvers": ["core/src/solver/"],
    "core: log": ["core/src/log/"],
    "core: families and kernels": ["core/src/family/", "core/src/pddo/"],
}
# what is built and run: unit tests and tests of runs
TESTED = ["--workspace", "--lib", *[flag for test in RUNS for flag in ("--test", test)]]
PACKAGES = [flag for crate in ("core", "couplers", "physics") for flag in ("-p", f"perimelt-{crate}")]
# the tests of `.ci/run` notice numbers that overflow
CHECKS = {"CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS": "true", "CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS": "true"}
# text for people and sizes in memory are no results
LEFT_OUT = re.compile(r"impl (std::fmt::|fmt::)?(Debug|Display) for|<impl .*(Debug|Display)|memory|::describe|::schema")
SWITCH = f'''//! The mutant that is active, and the mutants that a run reaches.
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{{AtomicBool, Ordering}};
static STATE: OnceLock<(u32, bool)> = OnceLock::new();
static REACHED: [AtomicBool; 4096] = [const {{ AtomicBool::new(false) }}; 4096];
#[doc(hidden)]
#[inline]
pub fn is(number: u32) -> bool {{
    let (active, traced) = *STATE.get_or_init(|| {{
        let active = std::env::var("{VARIABLE}").ok().and_then(|v| v.parse().ok());
        (active.unwrap_or(0), std::env::var_os("{TRACE}").is_some())
    }});
    if traced && !REACHED[number as usize].load(Ordering::Relaxed) {{
        note(number);
    }}
    active == number
}}
#[cold]
fn note(number: u32) {{
    if !REACHED[number as usize].swap(true, Ordering::Relaxed) {{
        let path = std::env::var_os("{TRACE}").expect("traced");
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        let _ = file.and_then(|mut f| f.write_all(format!("{{number}}\\n").as_bytes()));
    }}
}}
'''


def area_of(file):
    for area, paths in AREAS.items():
        if any(file.startswith(path) for path in paths):
            return area
    return None


def listed(tree):
    """Mutants of all areas."""
    text = subprocess.check_output(["cargo", "mutants", "--list", "--json", *PACKAGES], cwd=tree)
    mutants = [m for m in json.loads(text) if m["genre"] != "StructField"]
    return [m for m in mutants if area_of(m["file"]) and not LEFT_OUT.search(m["name"])]


def sample_of(mutants, size, seed):
    """So many mutants of each area."""
    drawn = []
    generator = random.Random(seed)
    for area in AREAS:
        own = [m for m in mutants if area_of(m["file"]) == area]
        drawn += generator.sample(own, min(size, len(own)))
    for mutant in drawn:
        mutant["area"] = area_of(mutant["file"])
        del mutant["diff"]
    return drawn


def chosen():
    """Mutants of our own choice."""
    listed = tomllib.loads((HERE / "chosen.toml").read_text())["mutation"]
    return [{**m, "name": m["what"], "genre": "Chosen", "area": "chosen"} for m in listed]


class Edits:
    """Insertions and replacements in one file, by byte."""

    def __init__(self, text):
        from tree_sitter import Language, Parser
        import tree_sitter_rust

        self.text = text
        self.root = Parser(Language(tree_sitter_rust.language())).parse(text).root_node
        self.starts = [0]
        for line in text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.edits = []
        self.chosen = []

    def offset(self, place):
        line = self.text[self.starts[place["line"] - 1] : self.starts[place["line"]]].decode()
        return self.starts[place["line"] - 1] + len(line[: place["column"] - 1].encode())

    def add(self, mutant, crate):
        """Whether the mutant can be written."""
        if mutant["genre"] == "Chosen":
            return self.add_chosen(mutant, crate)
        start, end = (self.offset(mutant["span"][side]) for side in ("start", "end"))
        switch = f"{crate}::mutant::is({mutant['number']})"
        replacement = mutant["replacement"].split("/*")[0].strip()
        node = self.root.descendant_for_byte_range(start, max(start, end - 1))
        source = lambda n: self.text[n.start_byte : n.end_byte].decode()
        match mutant["genre"]:
            case "FnValue":
                if "impl " in mutant["function"]["return_type"]:
                    return False  # the type must be that of the other value
                self.edits.append((start, start, f"if {switch} {{ return {replacement}; }}\n"))
            case "BinaryOperator":
                node = node.parent
                if node is None or node.type not in ("binary_expression", "compound_assignment_expr"):
                    return False
                left, right = (source(node.child_by_field_name(side)) for side in ("left", "right"))
                operator = self.text[start:end].decode()
                kept, changed = (f"{left} {o} ({right})" for o in (operator, replacement))
                if node.type == "binary_expression":
                    kept, changed = (f"({left}) {o} ({right})" for o in (operator, replacement))
                    text = f"(if {switch} {{ {changed} }} else {{ {kept} }})"
                else:
                    text = f"{{ if {switch} {{ {changed} }} else {{ {kept} }} }}"
                self.edits.append((node.start_byte, node.end_byte, text))
            case "UnaryOperator":
                node = node.parent
                if node is None or node.type != "unary_expression":
                    return False
                inner = source(node.named_children[-1])
                text = f"(if {switch} {{ {inner} }} else {{ {source(node)} }})"
                self.edits.append((node.start_byte, node.end_byte, text))
            case "MatchArmGuard":
                text = f"(if {switch} {{ {replacement} }} else {{ {self.text[start:end].decode()} }})"
                self.edits.append((start, end, text))
            case "MatchArm":
                while node is not None and node.type != "match_arm":
                    node = node.parent
                pattern = node and node.child_by_field_name("pattern")
                if pattern is None or pattern.child_by_field_name("condition") is not None:
                    return False
                self.edits.append((pattern.end_byte, pattern.end_byte, f" if !{switch}"))
        return True

    def add_chosen(self, mutant, crate):
        of, to = mutant["of"], mutant["to"]
        times = self.text.count(of.encode())
        assert times == 1, f"`{of}` occurs {times} times in {mutant['file']}"
        start = self.text.index(of.encode())
        switch = f"{crate}::mutant::is({mutant['number']})"
        text = f"if {switch} {{ {to} }} else {{ {of} }}"
        is_statement = of.endswith(";")
        self.chosen.append((start, start + len(of.encode()), text if is_statement else f"({text})"))
        return True

    def written(self):
        """The text; of edits that overlap only the first counts. Also the numbers of the edits that do not."""
        out, at, left_out = [], 0, []
        number = lambda text: int(re.search(r"mutant::is\((\d+)\)", text)[1])
        edits = list(self.chosen)
        for edit in sorted(self.edits):
            if any(edit[0] < end and start < edit[1] for start, end, _ in self.chosen):
                left_out.append(number(edit[2]))
            else:
                edits.append(edit)
        for start, end, text in sorted(edits):
            if start < at:
                left_out.append(number(text))
                continue
            out += [self.text[at:start], text.encode()]
            at = end
        return b"".join([*out, self.text[at:]]), left_out


def write(args):
    """Writes the mutants into the copy, without those that were found not to compile."""
    copy = Path(args.copy)
    subprocess.check_call(["git", "checkout", "-q", "--", "core", "couplers", "physics"], cwd=copy)
    listing = copy / "mutants.json"
    if listing.exists():
        mutants = json.loads(listing.read_text())
    else:
        mutants = chosen() + sample_of(listed(copy), args.sample, args.seed)
        for number, mutant in enumerate(mutants, 1):
            mutant["number"] = number
    (copy / "core/src/mutant.rs").write_text(SWITCH)
    library = copy / "core/src/lib.rs"
    library.write_text(library.read_text() + "\n#[doc(hidden)]\npub mod mutant;\n")
    for file in sorted({m["file"] for m in mutants}):
        edits = Edits((copy / file).read_bytes())
        crate = "crate" if file.startswith("core/") else "perimelt_core"
        for mutant in mutants:
            if mutant["file"] == file and not mutant.get("unviable"):
                mutant["unviable"] = not edits.add(mutant, crate)
        text, left_out = edits.written()
        for mutant in mutants:
            mutant["unviable"] = mutant.get("unviable", False) or mutant["number"] in left_out
        (copy / file).write_bytes(text)
    listing.write_text(json.dumps(mutants, indent=0))
    print(sum(not m["unviable"] for m in mutants), "mutants written")


def refused(copy):
    """Numbers of the mutants at errors of the compiler."""
    command = ["cargo", "check", "--release", "--keep-going", "--message-format=json", *PACKAGES]
    checked = subprocess.run(command, cwd=copy, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    numbers, unexplained = set(), []
    for line in checked.stdout.decode().splitlines():
        message = json.loads(line).get("message") if line.startswith("{") else None
        if not isinstance(message, dict) or message.get("level") != "error" or not message.get("spans"):
            continue
        spans = message["spans"] + [s for child in message["children"] for s in child["spans"]]
        found = set()
        for span in spans:
            if not (copy / span["file_name"]).exists():
                continue  # of the standard library
            lines = (copy / span["file_name"]).read_text().splitlines()
            text = "\n".join(lines[span["line_start"] - 1 : span["line_end"]])
            found |= {int(n) for n in re.findall(r"mutant::is\((\d+)\)", text)}
        if not found:
            unexplained.append(message["rendered"])
        numbers |= found
    return numbers, unexplained, checked.returncode


def build(args):
    """Removes the mutants that do not compile, then builds tests and program."""
    copy = Path(args.copy)
    while True:
        numbers, unexplained, status = refused(copy)
        if status == 0:
            break
        if not numbers:
            sys.exit("\n".join(unexplained) or "cargo check failed")
        mutants = json.loads((copy / "mutants.json").read_text())
        for mutant in mutants:
            mutant["unviable"] = mutant["unviable"] or mutant["number"] in numbers
        (copy / "mutants.json").write_text(json.dumps(mutants, indent=0))
        print(len(numbers), "mutants do not compile")
        write(args)
    for command in (["test", "--no-run", *TESTED], ["build"]):
        subprocess.check_call(["cargo", *command, "--release"], cwd=copy)


def test_binaries(copy):
    """Programs of the unit tests of crates, and of the tests of runs, and their folders, by name."""
    command = ["cargo", "test", "--release", "--no-run", *TESTED, "--message-format=json"]
    text = subprocess.check_output(command, cwd=copy, stderr=subprocess.DEVNULL).decode()
    found = {}
    for line in text.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["profile"]["test"] and "bin" not in message["target"]["kind"]:
            folder = str(Path(message["manifest_path"]).parent)
            found[message["target"]["name"].removeprefix("perimelt_")] = message["executable"], folder
    return found


def execute(command, folder, timeout=None, **variables):
    """Whether a command succeeds; `None` after the timeout."""
    # the harness of tests stops at the first failure where unstable options are allowed
    environment = {**os.environ, **variables, "RUSTC_BOOTSTRAP": "1"}
    try:
        done = subprocess.run(command, cwd=folder, env=environment, timeout=timeout, capture_output=True)
        return done.returncode == 0
    except subprocess.TimeoutExpired:
        return None


def test_command(program, tests):
    return [program, "-q", "-Zunstable-options", "--fail-fast", "--exact", *tests]


def checks_of(copy):
    """All tests and all cases with everyday benchmarks: name, kind, command without names, folder."""
    for name, (program, folder) in test_binaries(copy).items():
        kind = "tests of runs" if name in RUNS else "unit tests"
        listed = subprocess.check_output([program, "--list"], cwd=folder).decode().splitlines()
        for test in (line.removesuffix(": test") for line in listed if line.endswith(": test")):
            yield {"name": test, "of": name, "kind": kind, "program": program, "folder": folder}
    benchmarks = json.loads((copy / "docs/benchmarks.json").read_text())["checks"]
    program = str(copy / "target/release/perimelt")
    for case in sorted({check["case"] for check in benchmarks if check["level"] == "everyday"}):
        yield {"name": case, "of": "verify", "kind": "benchmarks", "program": program, "folder": str(copy)}


def command_of(check):
    if check["kind"] == "benchmarks":
        return [check["program"], "verify", check["name"]]
    return test_command(check["program"], [check["name"]])


def trace(args):
    """Runs each check without a mutant; records its time and the mutants that it reaches."""
    copy = Path(args.copy).resolve()
    path = copy / "checks.json"
    checks = json.loads(path.read_text()) if path.exists() else []
    known = {(c["of"], c["name"]) for c in checks}
    missing = [c for c in checks_of(copy) if (c["of"], c["name"]) not in known]

    def traced(check):
        with tempfile.NamedTemporaryFile() as file:
            started = time.time()
            passed = execute(command_of(check), check["folder"], **{TRACE: file.name})
            reached = sorted({int(line) for line in file.read().split()})
        return {**check, "passed": passed, "seconds": time.time() - started, "reached": reached}

    with ThreadPoolExecutor(args.workers) as pool:
        for check in pool.map(traced, missing):
            checks.append(check)
            if not check["passed"]:
                print(check["of"], check["name"], "fails without a mutant and is left out")
            if len(checks) % 50 == 0 or check["seconds"] > 10:
                path.write_text(json.dumps(checks))
                print(len(checks), f"{check['seconds']:.0f} s", check["of"], check["name"], flush=True)
    path.write_text(json.dumps(checks))


def killer_of(mutant, checks, budget):
    """What kills a mutant: of the checks that reach it the shortest first, until the budget (s) is spent."""
    variable = {VARIABLE: str(mutant["number"])}
    reaching = sorted((c for c in checks if mutant["number"] in c["reached"]), key=lambda c: c["seconds"])
    short = [c for c in reaching if c["seconds"] < 1 and c["kind"] != "benchmarks"]
    for name in dict.fromkeys(c["of"] for c in short):
        own = [c for c in short if c["of"] == name]
        limit = 20 + 10 * sum(c["seconds"] for c in own)
        outcome = execute(test_command(own[0]["program"], [c["name"] for c in own]), own[0]["folder"], limit, **variable)
        if not outcome:
            return f"{own[0]['kind']}: {name}" + (" (no end)" if outcome is None else "")
    spent = 0.0
    for check in (c for c in reaching if c not in short):
        outcome = execute(command_of(check), check["folder"], 20 + 10 * check["seconds"], **variable)
        if not outcome:
            return f"{check['kind']}: {check['of']} {check['name']}" + (" (no end)" if outcome is None else "")
        spent += check["seconds"]
        if spent > budget:
            break
    return None


def run(args):
    """Tries each mutant that has no result yet."""
    copy, path = Path(args.copy).resolve(), Path(args.results)
    checks = [c for c in json.loads((copy / "checks.json").read_text()) if c["passed"]]
    results = json.loads(path.read_text()) if path.exists() else []
    done = {r["number"] for r in results}
    mutants = [m for m in json.loads((copy / "mutants.json").read_text()) if not m["unviable"]]
    random.Random(args.seed).shuffle(mutants)
    mutants.sort(key=lambda m: m["area"] != "chosen")

    def tried(mutant):
        if args.until and time.time() > args.until:
            return None
        reaching = sum(mutant["number"] in c["reached"] for c in checks)
        return {**mutant, "checks": reaching, "killed": killer_of(mutant, checks, args.budget)}

    with ThreadPoolExecutor(args.workers) as pool:
        for result in pool.map(tried, [m for m in mutants if m["number"] not in done]):
            if result:
                results.append(result)
                path.write_text(json.dumps(results, indent=0))
                print(result["killed"] or f"SURVIVED {result['checks']} checks,", "|", result["name"], flush=True)


def report(args):
    results = json.loads(Path(args.results).read_text())
    print("| area | mutants | killed by unit tests | by tests of runs | by benchmarks | survive | killed |")
    print("|---|---|---|---|---|---|---|")
    for area in [*AREAS, "chosen"]:
        own = [r for r in results if r["area"] == area]
        if not own:
            continue
        by = Counter((r["killed"] or "none").split(":")[0] for r in own)
        kinds = " | ".join(str(by[kind]) for kind in ("unit tests", "tests of runs", "benchmarks", "none"))
        print(f"| {area} | {len(own)} | {kinds} | {100 * (1 - by['none'] / len(own)):.0f} % |")
    print("\nSurvivors:\n")
    for mutant in sorted((r for r in results if not r["killed"]), key=lambda r: r["name"]):
        print(f"- `{mutant['name']}`")


def main():
    os.environ |= CHECKS
    tasks = {"write": write, "build": build, "trace": trace, "run": run, "report": report}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=tasks)
    parser.add_argument("--copy", help="a copy of the tree (a git worktree), which is changed")
    parser.add_argument("--sample", type=int, default=100, help="mutants of each area")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--results", default="mutants.json")
    parser.add_argument("--budget", type=float, default=120, help="time for the long checks of one mutant, s")
    parser.add_argument("--workers", type=int, default=1, help="checks or mutants at once")
    parser.add_argument("--until", type=float, help="tries no mutant after this time (s since 1970)")
    args = parser.parse_args()
    tasks[args.task](args)


if __name__ == "__main__":
    main()
