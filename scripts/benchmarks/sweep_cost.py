"""What a sweep costs: memory, CPU time beside rd.rollouts of the same runs, the time to plan and to resume.

    PYTHONPATH=scripts python -m benchmarks.sweep_cost memory --runs 1000000
    PYTHONPATH=scripts python -m benchmarks.sweep_cost samples --runs 340000
    PYTHONPATH=scripts python -m benchmarks.sweep_cost overhead --arm panda --seconds 60
    PYTHONPATH=scripts python -m benchmarks.sweep_cost cluster --arm panda --seconds 60
    PYTHONPATH=scripts python -m benchmarks.sweep_cost plan
    PYTHONPATH=scripts python -m benchmarks.sweep_cost resume
    PYTHONPATH=scripts python -m benchmarks.sweep_cost scheduler --chunks 20000

CPU times are of the process; overhead is summed over chunks that alternate with the same runs by rd.rollouts.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import psutil

import robot_dyn as rd
from robot_dyn.scene.starters import starter
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps.folder import Folder, opened
from robot_dyn.tools.sweeps.run_sweep import begun
from robot_dyn.tools.sweeps.work import Work

MIB = 2**20
RESUME = """
import time
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps.work import Work
began, cpu, plain, first = time.perf_counter(), time.process_time(), Work.made, []
def made(self, *given):
    first.append(time.perf_counter() - began)
    return plain(self, *given)
Work.made = made
done = sw.read_sweep({out!r})
sw.run(done.sweep, {out!r}, threads=2)
print(f"{{done.folder.count}} chunks: the work begins {{first[0]:.2f}} s after the import of the room;"
      f" with its last chunk {{time.perf_counter() - began:.2f}} s, CPU {{time.process_time() - cpu:.2f}} s")
"""
SCENE = """
robot = "planar_2r"
duration_s = {duration_s}
method = "RK4"
step_s = 0.001
record_every_s = 0.001

[start]
q = [0.4, 0.9]

[[effect]]
kind = "gravity"

[[effect]]
kind = "viscous_friction"
viscous_N_m_s_per_rad = 0.5
"""


def planar(folder: str, runs: int) -> sw.Sweep:
    """200 steps of two bars, with friction, starts and masses that vary."""
    (Path(folder) / "scene.toml").write_text(SCENE.format(duration_s=0.2))
    vary = {
        "viscous_friction.viscous": sw.lognormal(median=0.5, sigma_of_log=0.2),
        "q0": sw.normal(mean=[0.4, 0.9], sd=0.05),
        "mass_scale": sw.normal(mean=1.0, sd=0.1),
    }
    return sw.Sweep(f"{folder}/scene.toml", runs, vary, {"peak": sw.peak("v"), "end": sw.final("q", "joint_2")})


def panda(folder: str, runs: int) -> sw.Sweep:
    """Computed torque of a Panda with friction and masses that vary, half a second by RK4 at 1 ms."""
    text = starter("panda_computed_torque").replace("duration_s = 1.5", "duration_s = 0.5", 1)
    lines = [line for line in text.splitlines() if not line.startswith(("method", "step_s"))]
    at = next(k for k, line in enumerate(lines) if line.startswith("duration_s"))
    lines[at + 1 : at + 1] = ['method = "RK4"', "step_s = 0.001"]
    (Path(folder) / "scene.toml").write_text("\n".join(lines))
    vary = {
        "viscous_friction.viscous": sw.lognormal(median=0.5, sigma_of_log=0.2),
        "mass_scale": sw.normal(mean=1, sd=0.1),
    }
    return sw.Sweep(f"{folder}/scene.toml", runs, vary, {"error": sw.rms_tracking_error(), "peak": sw.peak("u")})


def peak_rss() -> float:
    """Largest resident set of this process so far, in [MiB]."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def rss() -> float:
    return psutil.Process().memory_info().rss / MIB


def memory(given: argparse.Namespace) -> None:
    """Peak RSS of a sweep and of its statistics."""
    with tempfile.TemporaryDirectory() as folder:
        began, cpu = time.perf_counter(), time.process_time()
        done = sw.run(planar(folder, given.runs), f"{folder}/out", threads=2)
        ran = peak_rss()
        spent = f"CPU {time.process_time() - cpu:.1f} s, wall {time.perf_counter() - began:.1f} s"
        chunks = f"{done.folder.count} chunks of {done.folder.chunk}"
        print(f"{given.runs} runs, {chunks}: peak RSS {ran:.0f} MiB; {spent}", flush=True)
        print(*done.quantiles("peak", (0.5, 0.99)), done.probability("failed | peak > 5"), sep="\n")
        print(f"with statistics: peak RSS {peak_rss():.0f} MiB")


def samples(given: argparse.Namespace) -> None:
    """Peak RSS of a sweep that keeps q, v and u of all runs, 9.6 kB each, and of quantiles read back."""
    with tempfile.TemporaryDirectory() as folder:
        done = sw.run(
            replace(planar(folder, given.runs), samples=sw.samples("q", "v", "u")), f"{folder}/out", threads=2
        )
        size = sum(path.stat().st_size for path in Path(folder, "out", "rows").rglob("*") if path.is_file())
        ran, data = peak_rss(), done.samples()
        last = data.q[:, -1, 1].values  # of all runs
        print(f"{given.runs} runs, {size / 2**30:.2f} GiB of rows and samples, chunks of {done.folder.chunk}: peak RSS"
              f" {ran:.0f} MiB; quantiles of q read back {np.quantile(last, (0.05, 0.5, 0.95))}, equal to the rows:"
              f" {(last == done.table('end')['end']).all()}; peak RSS {peak_rss():.0f} MiB", flush=True)  # fmt: skip


def rollouts_of(setup: rd.Setup, values: dict[str, np.ndarray], work: Work) -> None:
    """What a user would call for the runs of a chunk."""
    params = {name: x for name, x in values.items() if name != "q0"}
    rd.rollouts(setup, values.get("q0"), vary=params, record=work.record, threads=1)


def overhead(given: argparse.Namespace) -> None:
    """CPU time of chunks, written, over that of rd.rollouts of the same runs and values."""
    with tempfile.TemporaryDirectory() as folder:
        plan = (panda if given.arm == "panda" else planar)(folder, 10**7)
        known, work = begun(plan, Path(folder) / "out"), Work(plan)
        known.prepare()
        setup, spent = replace(plan.setup, estimate_error=False), {"sweep": 0.0, "rollouts": 0.0}
        chunk = 0
        for chunk in range(10**6):
            start, stop = known.run_range(chunk)

            def sweep(chunk: int = chunk, start: int = start, stop: int = stop) -> None:
                known.write(chunk, *work.run_rows(start, stop))

            values = plan.values(start, stop)

            def rollouts(values: dict[str, np.ndarray] = values) -> None:
                rollouts_of(setup, values, work)

            turns = {"sweep": sweep, "rollouts": rollouts}
            for name in sorted(turns, reverse=bool(chunk % 2)):
                began = time.process_time()
                turns[name]()
                spent[name] += time.process_time() - began
            if chunk == 0:  # the first compiles
                spent = dict.fromkeys(spent, 0.0)
            else:
                ratio = spent["sweep"] / spent["rollouts"] - 1
                print(f"{chunk} chunks of {known.chunk}: {spent['sweep']:.2f} s, {100 * ratio:+.2f} %", flush=True)
            if spent["sweep"] > given.seconds:
                break
        ratio = spent["sweep"] / spent["rollouts"] - 1
        print(f"{given.arm}: chunks of {known.chunk}, {chunk} of them; sweep {spent['sweep']:.2f} s of CPU,"
              f" rd.rollouts {spent['rollouts']:.2f} s: {100 * ratio:+.2f} %")  # fmt: skip


def rollouts_in_a_worker(folder: str, start: int, stop: int) -> float:
    """CPU time of a worker for rd.rollouts of the runs of a chunk, the folder of which it has opened before."""
    work = Work(opened(Path(folder))[1])
    values, setup = work.sweep.values(start, stop), replace(work.sweep.setup, estimate_error=False)
    began = time.process_time()
    rollouts_of(setup, values, work)
    return time.process_time() - began


def cluster(given: argparse.Namespace) -> None:
    """CPU time of workers, scheduler and driver for a chunk, over that of rd.rollouts of its runs in the same workers.

    That of a chunk is the difference between a sweep of many chunks and one of four, so that what each worker does
    once, the setup and its kernels, is told apart.
    """
    many = panda if given.arm == "panda" else planar
    distributed: Any = import_module("distributed")
    with (
        tempfile.TemporaryDirectory() as folder,
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        chunk = begun(many(folder, 10**7), Path(folder) / "pilot").chunk
        workers = [psutil.Process(pid) for pid in client.run(os.getpid).values()]

        def spent() -> float:
            times = [each.cpu_times() for each in workers]
            return time.process_time() + sum(each.user + each.system for each in times)

        def swept(chunks: int) -> float:
            with tempfile.TemporaryDirectory(dir=folder) as out:
                began = spent()
                sw.run(many(folder, chunks * chunk), f"{out}/out", cluster=client, chunk=chunk)
                return spent() - began

        swept(4)  # compiles
        few, whole, rollouts, more = [], [], [], 16
        while sum(whole) < given.seconds:
            few.append(swept(4))
            whole.append(swept(4 + more))
            tasks = [(f"{folder}/pilot", k * chunk, (k + 1) * chunk) for k in range(4, 4 + more)]
            futures = [client.submit(rollouts_in_a_worker, *task, pure=False) for task in tasks]
            rollouts.append(sum(client.gather(futures)))
            ratio = (sum(whole) - sum(few)) / sum(rollouts) - 1
            once = sum(few) / len(few) - 4 * sum(rollouts) / len(rollouts) / more
            print(f"{given.arm}: {more * len(whole)} chunks of {chunk}; sweep {sum(whole) - sum(few):.2f} s,",
                  f"rd.rollouts {sum(rollouts):.2f} s of CPU: {100 * ratio:+.2f} %; once {once:.2f} s",
                  flush=True)  # fmt: skip


def plan(given: argparse.Namespace) -> None:
    """1e8 runs: time from the import to the first row, without a pilot, and memory."""
    with tempfile.TemporaryDirectory() as folder:
        before, began = rss(), time.perf_counter()
        sweep = planar(folder, 10**8)
        known = begun(sweep, Path(folder) / "out", chunk=16_384)
        known.prepare()
        left = known.missing()
        spent = time.perf_counter() - began
        cpu = f"CPU {time.process_time():.2f} s with the import"
        print(f"1e8 runs, {len(left)} chunks planned in {spent:.2f} s ({cpu}),"
              f" {peak_rss() - before:.0f} MiB over the import ({before:.0f} MiB)")  # fmt: skip
        sweep.values(10**8 - 10, 10**8)


def resume(given: argparse.Namespace) -> None:
    """1e4 chunks, all but the last there: from after the import until the first run begins."""
    with tempfile.TemporaryDirectory() as folder:
        sweep = planar(folder, 640_000)
        known = begun(sweep, Path(folder) / "out", chunk=64)
        known.prepare()
        known.write(0, *Work(sweep).run_rows(0, 64))
        for chunk in range(1, known.count - 1):
            os.link(known.file(0), known.file(chunk))
        # in a process of its own, whose kernels are in the store
        code = RESUME.format(out=f"{folder}/out")
        subprocess.run(
            [sys.executable, "-c", code], check=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        )


def without_work() -> None:
    """In a worker: chunks are empty files."""

    def written(self: Folder, chunk: int, *_: Any) -> None:
        self.file(chunk).touch()

    Work.run_rows, Folder.write = (lambda *_: ()), written  # type: ignore[method-assign]


def scheduler(given: argparse.Namespace) -> None:
    """RSS of a scheduler and of the driver, a process each, after many empty chunks."""
    import distributed

    def python(*command: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-m", *command], stderr=subprocess.DEVNULL)

    with tempfile.TemporaryDirectory() as folder:
        known = f"{folder}/scheduler.json"
        first = python("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
                       "--scheduler-file", known)  # fmt: skip
        workers = python("distributed.cli.dask_worker", "--nworkers", "2", "--nthreads", "1", "--no-dashboard",
                         "--host", "127.0.0.1", "--scheduler-file", known)  # fmt: skip
        try:
            while not Path(known).exists():
                time.sleep(0.1)
            with distributed.Client(scheduler_file=known, set_as_default=False) as client:
                client.wait_for_workers(2, 60)
                client.run(without_work)
                its, began = psutil.Process(first.pid), time.perf_counter()

                def tell(done: int, runs: int) -> None:
                    sizes = f"scheduler {its.memory_info().rss / MIB:.0f} MiB, driver {rss():.0f} MiB"
                    print(f"{done} of {runs} chunks, {time.perf_counter() - began:.0f} s: {sizes}", flush=True)

                sw.run(planar(folder, given.chunks), f"{folder}/out", cluster=client, chunk=1, on_progress=tell)
        finally:
            for each in (workers, first):
                each.terminate()
                each.wait()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = {each.__name__: each for each in (memory, samples, overhead, cluster, plan, resume, scheduler)}
    parser.add_argument("what", choices=commands)
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--arm", choices=("panda", "planar"), default="panda")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--chunks", type=int, default=20_000)
    options = parser.parse_args()
    commands[options.what](options)
