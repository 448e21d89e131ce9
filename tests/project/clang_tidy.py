#!/usr/bin/env python3
"""Runs clang-tidy on all sources whose verdict may have changed; `./run lint` calls it.

usage: clang_tidy.py DATABASE KEPT JOBS LIBRARIES <NAMES

DATABASE   folder of a compile_commands.json
KEPT       folder in which it keeps what passed
JOBS       how many run at once
LIBRARIES  a text that differs when the tools' or libraries' versions do
NAMES      of all sources, relative to the current folder, each ended by a zero byte

Most of the time goes into headers, so that the files of a folder are looked at together, as one unit that includes
them. A unit that does not compile, as when two files give a name two meanings, is taken apart again: what is found
never depends on units. A file passes as long as neither it nor what it includes changes, nor its flags, nor the checks.
"""

import hashlib
import json
import re
import shlex
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

CHECKED = re.compile(r"(src|query|builder|capi|cli|examples|python)/.*\.cpp")
INCLUDE = re.compile(r'^#include ["<]([a-z_]+/[^">]+)', re.MULTILINE)
OFF = "-bugprone-suspicious-include"  # units include sources
MOST = 12  # files of a unit: more save little, and keep the last core waiting


def flags_of(entry: dict) -> tuple[str, ...]:
    """What the compiler is told, but for the names of source and object. Kernels once, not for each target."""
    words = shlex.split(entry["command"])
    out = words.index("-o")
    return (
        *words[1:out],
        *(w for w in words[out + 2 :] if w not in ("-c", entry["file"])),
        "-DHWY_COMPILE_ONLY_STATIC",
    )


def included(texts: dict[str, str]) -> dict[str, set[str]]:
    """All that each file includes, directly or not, and the file itself."""
    direct = {}
    for name, text in texts.items():
        found = INCLUDE.findall(text)
        direct[name] = [i for f in found for i in (f, "include/" + f, "python/" + f) if i in texts]

    def reach(name: str) -> set[str]:
        seen, todo = set(), [name]
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo += direct[name]
        return seen

    return {name: reach(name) for name in texts}


class Lint:
    """Names of sources in, findings out."""

    def __init__(self, database: Path, kept: Path, libraries: str, names: list[str]):
        self.here, self.passed, self.units = Path.cwd(), kept / "passed", kept / "units"
        self.passed.mkdir(parents=True, exist_ok=True)
        texts = {n: Path(n).read_text() for n in names if n.endswith((".h", ".hpp", ".cpp"))}
        checks = {n: Path(n).read_text() for n in names if Path(n).name == ".clang-tidy"}
        for name, text in checks.items():  # units obey those of their folder
            (self.units / name).parent.mkdir(parents=True, exist_ok=True)
            (self.units / name).write_text(text)
        entries = json.loads((database / "compile_commands.json").read_text())
        self.flags = {str(Path(e["file"]).relative_to(self.here)): flags_of(e) for e in entries}
        beside = {Path(n).parent: flags for n, flags in self.flags.items()}
        self.keys = {}
        for name, seen in included(texts).items():
            if CHECKED.fullmatch(name):
                # A source that is built only where a library lacks is compiled as those beside it.
                self.flags.setdefault(name, beside[Path(name).parent])
                what = name, [(n, texts[n]) for n in sorted(seen)], self.flags[name], sorted(checks.items()), libraries
                self.keys[name] = hashlib.sha256(repr(what).encode()).hexdigest()

    def jobs(self) -> list[list[str]]:
        """Files to look at, as units, those with most text first."""
        groups = defaultdict(list)
        for name, key in sorted(self.keys.items()):
            if not (self.passed / key).exists():
                groups[Path(name).parent, self.flags[name]].append(name)
        units = []
        for (folder, _), files in groups.items():
            most = 1 if folder == Path("examples") else MOST  # each is a program of its own
            units += [files[i : i + most] for i in range(0, len(files), most)]
        return sorted(units, key=lambda files: -sum(Path(f).stat().st_size for f in files))

    def findings(self, files: list[str]) -> str:
        """What clang-tidy says of files that are compiled as one; nothing, if all is well."""
        if len(files) == 1:
            where = files[0]
        else:
            unit = self.units / Path(files[0]).with_suffix(".unit.cpp")
            unit.parent.mkdir(parents=True, exist_ok=True)
            unit.write_text("".join(f'#include "{self.here / f}"\n' for f in files))
            where = str(unit)
        command = ["clang-tidy", "--quiet", f"--checks={OFF}", where, "--", *self.flags[files[0]]]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            for name in files:
                (self.passed / self.keys[name]).touch()
            return ""
        if len(files) > 1 and "clang-diagnostic-" in done.stdout:
            return "".join(self.findings([name]) for name in files)
        return done.stdout or f"{' '.join(files)}: clang-tidy ended with {done.returncode}\n{done.stderr}"


def main() -> int:
    names = [n for n in sys.stdin.read().split("\0") if n]
    lint = Lint(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[4], names)
    jobs = lint.jobs()
    print(f"{sum(map(len, jobs))} files that have changed, or include what has", flush=True)
    with ThreadPoolExecutor(int(sys.argv[3])) as pool:
        found = [text for text in pool.map(lint.findings, jobs) if text]
    print("".join(found), end="")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
