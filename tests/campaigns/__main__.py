"""`python -m tests.campaigns`: all campaigns and the tests marked `stress`, in turn; exit code 1 if one fails.

The report is build/stress/report.md, written anew after each campaign: what ran, with which seed, how many, how many
failed, how long. Beside it is what each printed. Random ones run with a fixed seed or that of the day; `--seed` repeats
a day. `--only` runs some; `--scale 0.01` a hundredth of all, to try the campaigns themselves.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from time import perf_counter

from tests.campaigns.fuzz.campaign import FUZZERS

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "stress"
# How each campaign begins a line about what failed.
FAILURES = re.compile(
    r"^(?:MISLEADS|OFF|MISSED|SILENT|DIFFERS|AGAINST|FAILED|ERROR)\b|^\w+ --seed \d+, case ", re.MULTILINE
)


@dataclass(frozen=True)
class Campaign:
    """One command.

    Attributes:
        name: What it is called in the report.
        module: The module that runs.
        arguments: What it is given beside the seed and how many.
        option: Option that says how many; empty if it says so itself.
        count: How many.
        seed: The seed; None for that of the day.
    """

    name: str
    module: str
    arguments: tuple[str, ...] = ()
    option: str = ""
    count: int = 0
    seed: int | None = None


def campaigns() -> list[Campaign]:
    """All, the shortest first."""
    estimates, sweeps = "tests.campaigns.estimates", "tests.campaigns.sweeps"
    return [
        *(Campaign(f"fuzz, {name}", "tests.campaigns.fuzz", (name,), "--cases", 4000) for name in FUZZERS),
        Campaign("sweeps, flipped bits", sweeps, ("flips",), "--count", 400),
        Campaign("sweeps, rows by run(i)", sweeps, ("repeats",), "--count", 200),
        Campaign("sweeps, killed", "tests.campaigns.sweep_kills", ("--workers", "20"), "--drivers", 50),
        Campaign("batches and single runs", "tests.campaigns.batches", (), "--scenes", 300),
        Campaign("pairs of runs", "tests.campaigns.run_pairs", (), "--pairs", 200),
        Campaign("exported C", "tests.campaigns.exported_c"),
        Campaign("formulas", "tests.campaigns.symbols"),
        Campaign("faults of arms in logs", "tests.campaigns.identify", ("--clean", "100"), "--logs", 10),
        Campaign("estimates, thin layers", estimates, (), "--layers", 400),
        Campaign("accuracy asked for, smooth", estimates, (), "--requests", 400),
        Campaign("accuracy asked for, stops and dry friction", estimates, ("--held",), "--scenes", 200),
        Campaign("estimates", estimates, (), "--scenes", 600, seed=1),
        Campaign("estimates", estimates, (), "--scenes", 600),
        Campaign("hard cases", "tests.campaigns.hard", ("--full", "--write")),
        Campaign("tests marked stress", "pytest", ("-n", "auto", "--dist", "worksteal", "-m", "stress")),
    ]


def run(campaign: Campaign, seed: int, scale: float) -> dict[str, str]:
    """Run one; return its row of the report."""
    command = [sys.executable, "-m", campaign.module, *campaign.arguments]
    seed = seed if campaign.seed is None else campaign.seed
    count = max(1, round(scale * campaign.count))
    seeded = campaign.module != "pytest"
    command += ["--seed", str(seed)] * seeded + ([campaign.option, str(count)] if campaign.option else [])
    print("$", *command[1:], flush=True)
    start = perf_counter()
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    log = BUILD / f"{re.sub('[^a-z]+', '_', campaign.name)}_{seed}.log"
    log.write_text(done.stdout, encoding="utf-8")
    last = done.stdout.strip().splitlines()[-1:] or ["nothing"]
    print(*last, flush=True)
    return {
        "campaign": campaign.name, "seed": str(seed) if seeded else "",
        "how many": str(count) if campaign.option else "",
        "failed": str(len(FAILURES.findall(done.stdout))), "passes": "no" if done.returncode else "yes",
        "minutes": f"{(perf_counter() - start) / 60:.1f}", "last line": last[0].strip("= ").replace("|", "\\|"),
    }  # fmt: skip


def report(rows: list[dict[str, str]]) -> str:
    """The table of what ran."""
    heads = list(rows[0])
    lines = [heads, ["---"] * len(heads), *([row[head] for head in heads] for row in rows)]
    failed = sum(row["passes"] == "no" for row in rows)
    total = sum(float(row["minutes"]) for row in rows)
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"# Stress\n\n{len(rows)} campaigns in {total:.0f} min; {failed} do not pass.\n\n{table}\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=int(date.today().strftime("%Y%m%d")))
    parser.add_argument("--only", default="", help="only campaigns whose name holds this text")
    parser.add_argument("--scale", type=float, default=1.0, help="fraction of how many")
    options = parser.parse_args()
    chosen = [each for each in campaigns() if options.only in each.name]
    if not chosen:
        parser.error(f"no campaign holds {options.only!r}; there are: {', '.join(each.name for each in campaigns())}")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # campaigns use processes
    BUILD.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, str]] = []
    for campaign in chosen:
        rows.append(run(campaign, options.seed, options.scale))
        (BUILD / "report.md").write_text(report(rows), encoding="utf-8")
    print(report(rows))
    return int(any(row["passes"] == "no" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
