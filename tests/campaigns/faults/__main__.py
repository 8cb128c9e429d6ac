"""`python -m tests.campaigns.faults --old OLD --new NEW --count 200 --seed 46 --minutes 60`: plant faults in two trees.

Each fault is planted in a copy of the old tree, in its statement, and in a copy of the new one where that statement is
now. Tests of its folder and of those next to it are asked, those that name it first, until one fails. Exit code 1 if
the old tests caught a fault that the new ones do not.

One line of build/faults/faults.jsonl for each fault; `--minutes` may stop it, and the next call goes on. The table is
build/faults/faults.json, with a report beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from time import monotonic

from tests.campaigns.faults.homes import tests_of
from tests.campaigns.faults.sites import KINDS, Site, files, is_python, ported, sites

BUILD = Path(__file__).parents[3] / "build" / "faults"
LEFT_OUT = (".venv", ".git", "build", "dist", "__pycache__", ".ruff_cache", ".hypothesis")
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.*?)?)(?: - .*)?$", re.MULTILINE)


@dataclass
class Copy:
    """A copy of a tree, in which one fault at a time is planted, and tests that fail in it without one."""

    tree: Path
    folder: Path
    limit_s: float
    most: int
    broken: set[str] = field(default_factory=set)

    @property
    def python(self) -> str:
        """The interpreter of the tree."""
        own = self.tree / ".venv" / "bin" / "python"
        return str(own) if own.exists() else sys.executable

    def make(self) -> None:
        """Copy the tree; its machine code too, which the sources are part of the name of."""
        if not self.folder.exists():
            shutil.copytree(self.tree, self.folder, ignore=shutil.ignore_patterns(*LEFT_OUT))

    def answer(self, site: Site, first: str = "") -> tuple[str, str, float]:
        """What the tests say of a fault: caught, survived, or slow; the test that says so; seconds."""
        start = monotonic()
        asked = tests_of(self.tree, site.file, site.scope, first)[: self.most]
        with self.with_fault(site):
            while True:
                code, test = self.run(asked, self.limit_s - (monotonic() - start))
                if code != 1 or test in self.broken:
                    break
                with self.without_fault(site):
                    alone, _ = self.run([test], self.limit_s)
                if alone == 0:
                    break
                self.broken.add(test)
        said = {0: "survived", 5: "survived", 1: "caught", 2: "caught", -1: "slow"}.get(code, "caught")
        return said, test, round(monotonic() - start, 1)

    def run(self, asked: list[str], seconds: float) -> tuple[int, str]:
        """Exit code of pytest, -1 if it took too long, and the first test that fails."""
        if seconds <= 0:
            return -1, ""
        shown = [f"--deselect={test}" for test in sorted(self.broken)]
        command = [self.python, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=no", "-rfE", *shown, *asked]
        environment = os.environ | {"PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": ""}
        with subprocess.Popen(
            command, cwd=self.folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            start_new_session=True,
        ) as process:  # fmt: skip
            try:
                out, _ = process.communicate(timeout=seconds)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                return -1, ""
        found = FAILED.search(out)
        return process.returncode, found[1] if found else out.strip().rpartition("\n")[2] if process.returncode else ""

    def with_fault(self, site: Site) -> Written:
        """A block in which the fault is there."""
        path = self.folder / "robot_dyn" / site.file
        return Written(path, site.planted((self.tree / "robot_dyn" / site.file).read_bytes()))

    def without_fault(self, site: Site) -> Written:
        """A block in which it is not."""
        return Written(self.folder / "robot_dyn" / site.file, (self.tree / "robot_dyn" / site.file).read_bytes())


@dataclass
class Written:
    """A block in which a file has another content; byte code of it is removed before and after."""

    path: Path
    content: bytes
    before: bytes = b""

    def __enter__(self) -> None:
        self.before = self.path.read_bytes()
        self._write(self.content)

    def __exit__(self, *_: object) -> None:
        self._write(self.before)

    def _write(self, content: bytes) -> None:
        self.path.write_bytes(content)
        for each in (self.path.parent / "__pycache__").glob(f"{self.path.stem}.*"):
            each.unlink(missing_ok=True)


def drawn(tree: Path, seed: int) -> Iterator[Site]:
    """Faults of a tree in random order: kinds in turns, and each folder of a kind as often as another."""
    rng = random.Random(seed)
    waiting: dict[str, dict[str, list[Site]]] = {kind: {} for kind in KINDS}
    for file in files(tree):
        for site in sites(tree, file):
            waiting[site.kind].setdefault(file.split("/")[0], []).append(site)
    while any(waiting.values()):
        for kind in KINDS:
            if folders := waiting[kind]:
                folder = rng.choice(sorted(folders))
                site = folders[folder].pop(rng.randrange(len(folders[folder])))
                if is_python(site.planted((tree / "robot_dyn" / site.file).read_bytes())):
                    yield site
                if not folders[folder]:
                    del folders[folder]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--old", type=Path, required=True)
    parser.add_argument("--new", type=Path, required=True)
    parser.add_argument("--count", type=int, default=200, help="faults that are in both trees")
    parser.add_argument("--seed", type=int, default=46)
    parser.add_argument("--minutes", type=float, default=60.0, help="no fault is begun after them")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds of the tests of one fault in one tree")
    parser.add_argument("--files", type=int, default=8, help="files of tests that are asked about one fault")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--all", action="store_true", help="ask the new tests about faults that the old ones miss, too")
    parser.add_argument("--write", type=Path, default=BUILD)
    options = parser.parse_args()
    options.write.mkdir(parents=True, exist_ok=True)
    lines = options.write / "faults.jsonl"
    known = {each["id"]: each for each in map(json.loads, lines.read_text().splitlines())} if lines.exists() else {}
    old, new = options.old.resolve(), options.new.resolve()
    begun, found, pairs, places = monotonic(), list[dict](), list[tuple[Site, Site]](), dict[str, list[Site]]()
    gone = 0
    for site in drawn(old, options.seed):
        if len(found) + len(pairs) >= options.count:
            break
        if (there := ported(site, new, places)) is None:
            gone += 1
        elif site.id in known:
            found.append(known[site.id])
        else:
            pairs.append((site, there))
    copies: SimpleQueue[tuple[Copy, Copy]] = SimpleQueue()
    for worker in range(options.workers):
        both = [
            Copy(tree, options.write / f"{name}_{worker}", options.limit, options.files)
            for tree, name in ((old, "old"), (new, "new"))
        ]
        for each in both:
            shutil.rmtree(each.folder, ignore_errors=True)  # the tree may have changed since
            each.make()
        copies.put((both[0], both[1]))

    def ask(site: Site, there: Site) -> dict:
        if monotonic() - begun > options.minutes * 60:
            return {}
        in_old, in_new = copies.get()
        try:
            said, test, seconds = in_old.answer(site)
            row = {
                "id": site.id, "kind": site.kind, "file": site.file, "new_file": there.file,
                "statement": site.statement,
                "old": said, "old_test": test, "old_s": seconds, "new": "not asked", "new_test": "", "new_s": 0.0,
            }  # fmt: skip
            if said == "caught" or options.all:
                name = Path(test.partition("::")[0]).name if said == "caught" else ""
                row["new"], row["new_test"], row["new_s"] = in_new.answer(there, name)
        finally:
            copies.put((in_old, in_new))
        return row

    with ThreadPoolExecutor(options.workers) as pool, lines.open("a", encoding="utf-8") as file:
        waiting = {pool.submit(ask, *pair) for pair in pairs}
        while waiting:
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for row in filter(None, (each.result() for each in done)):
                found.append(row)
                print(json.dumps(row), file=file, flush=True)
                print(
                    f"{row['old']:8s} {row['new']:9s} {row['old_s']:5.1f} {row['new_s']:5.1f} s  {row['id']}",
                    flush=True,
                )
    return report(found, gone, options)


def report(found: list[dict], gone: int, options: argparse.Namespace) -> int:
    """Write the table and a report; 1 if the new tests miss what the old ones caught."""
    (options.write / "faults.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    caught = [row for row in found if row["old"] == "caught"]
    lost = [row for row in caught if row["new"] != "caught"]
    text = [
        f"# Planted faults, seed {options.seed}", "",
        f"{len(found)} of {options.count} faults tried; {gone} more are in statements that the new tree does not have.",
        f"The old tests caught {len(caught)}; of these the new ones caught {len(caught) - len(lost)}.", "",
        "| kind | faults | caught by the old tests | of these by the new ones |", "|---|--:|--:|--:|",
    ]  # fmt: skip
    counts = {
        name: Counter(row["kind"] for row in rows) for name, rows in (("all", found), ("old", caught), ("lost", lost))
    }
    text += [
        f"| {kind} | {counts['all'][kind]} | {counts['old'][kind]} | {counts['old'][kind] - counts['lost'][kind]} |"
        for kind in KINDS
    ]
    text += ["", *(f"- not caught ({row['new']}): {row['id']}; by {row['old_test']} before" for row in lost)]
    (options.write / "report.md").write_text("\n".join(text) + "\n", encoding="utf-8")
    print(*text, sep="\n")
    return int(bool(lost))


if __name__ == "__main__":
    sys.exit(main())
