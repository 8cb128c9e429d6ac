"""Run files: damaged bytes; members changed, exchanged, missing or lying about their size; JSON with other values.

What is accepted is used: its summary, its table, its robot, what is drawn of it.
"""

from __future__ import annotations

import io
import json
import zipfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.scene import starter
from robot_dyn.simulation import robot_of
from robot_dyn.view import PLOTS, PlotError, document_of
from robot_dyn.view.plots.plots import _view
from tests.campaigns.fuzz.bytes import WORDS, damage

ODD = [None, True, -1, 0.5, 10**400, float("nan"), "", "x", "\ud800", "\x1b[31m", [], {}, [[]], {"a": 1}]
HEADERS = [b"(0,)", b"(-1,)", b"(10**9,)", b"(99999999999999999,)", b"(", b"'<f9'", b"'|O'", b"'<f4'", b"True", b"\0"]


def seeds(folder: Path) -> list[bytes]:
    """Whole run files: of a joint reference with friction and a wrench, and of a controller on a sliding joint."""
    runs = []
    for name, duration in (("cart_pole", "4.0"), ("double_pendulum", "3.0")):
        path = folder / f"{name}.toml"
        path.write_text(starter(name).replace(duration, "0.1", 1), encoding="utf-8")
        runs.append(rd.simulate(rd.read_scene(path)))
    runs.append(replace(runs[0], at_stop=runs[0].q > 0, desired=runs[0].q, tracking_error=runs[0].v))
    return [run.save(folder / f"seed{k}.npz").read_bytes() for k, run in enumerate(runs)]


def mutate(rng: np.random.Generator, seed: bytes) -> bytes:
    kind = int(rng.choice([0, 1, 2, 2]))
    if kind == 0:
        return damage(rng, seed)
    with np.load(io.BytesIO(seed)) as file:
        arrays = dict(file)
    if kind == 1:
        return _zipped(rng, arrays)
    for _ in range(int(rng.integers(1, 3))):
        _change(rng, arrays)
    stream = io.BytesIO()
    members: dict[str, Any] = {name: np.asarray(x) for name, x in arrays.items()}
    np.savez(stream, **members)
    return stream.getvalue()


def attempt(mutant: bytes, folder: Path) -> str:
    path = folder / "mutant.npz"
    path.write_bytes(mutant)
    run = rd.read(path)
    assert isinstance(run.summary, str)
    (folder / "mutant.csv").unlink(missing_ok=True)
    run.save(folder / "mutant.csv")
    run.save(path)
    robot_of(run)
    with suppress(RobotDynError):  # of a run that plots or replays refuse
        view = _view(run, run.joint_names, None, 180.0)
        for panel in PLOTS.values():
            with suppress(PlotError), np.errstate(all="ignore"):
                panel(view)
        document_of((run,), (), None, False)
    return "accepted"


def _change(rng: np.random.Generator, arrays: dict[str, np.ndarray]) -> None:
    """One member becomes another array, or goes, or a new one comes."""
    names = list(arrays)
    name, other = (names[int(k)] for k in rng.integers(0, len(names), 2))
    if rng.random() < 0.4 and "about" in arrays:
        arrays["about"] = np.array(_text(rng, str(arrays["about"])))
        return
    x = arrays[name]
    k = int(rng.integers(max(1, x.size)))
    match int(rng.integers(8)):
        case 0:
            arrays[name], arrays[other] = arrays[other], x
        case 1:
            del arrays[name]
        case 2:
            arrays[name] = x[..., :-1] if x.ndim else x[None]
        case 3:
            arrays[name] = x.astype([np.float32, np.int64, bool, "<U3"][k % 4]) if x.dtype.kind in "fb" else x
        case 4 if x.dtype.kind == "f" and x.size:
            arrays[name] = x.copy()
            arrays[name].flat[k] = [np.nan, np.inf, -1e300, 1e-320][k % 4]
        case 5:
            arrays[f"{name}/{WORDS[k % len(WORDS)][:9999]}".replace("\0", "")] = x
        case 6:
            arrays[name] = np.zeros((0,) * x.ndim, x.dtype)
        case _:
            arrays[name] = np.repeat(x[None], 2, axis=0)


def _text(rng: np.random.Generator, text: str) -> str:
    """The JSON with one value changed, at any depth; or damaged as a text."""
    if rng.random() < 0.2:
        return damage(rng, text.encode()).decode("utf-8", "replace") or " "
    try:
        about = json.loads(text)
    except ValueError:
        return text
    fields = about["value"] if isinstance(about, dict) and isinstance(about.get("value"), dict) else {}
    table: Any = about
    if fields and rng.random() < 0.8:  # of one that is not the name of an array
        table = fields[str(rng.choice([key for key, value in fields.items() if isinstance(value, dict | list)]))]
    while isinstance(table, dict | list) and table:
        i = int(rng.integers(len(table)))
        key: Any = list(table)[i] if isinstance(table, dict) else i
        if not isinstance(table[key], dict | list) or not table[key] or rng.random() < 0.3:
            table[key] = ODD[int(rng.integers(len(ODD)))]
            break
        table = table[key]
    return json.dumps(about)


def _zipped(rng: np.random.Generator, arrays: dict[str, np.ndarray]) -> bytes:
    """A zip file whose members lie: headers of arrays replaced, other compressions, doubled names, strange members."""
    stream = io.BytesIO()
    method = int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]))
    victim = list(arrays)[int(rng.integers(len(arrays)))]
    with zipfile.ZipFile(stream, "w", method if rng.random() < 0.3 else zipfile.ZIP_DEFLATED) as file:
        for name, x in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(x))
            data = member.getvalue()
            if name == victim:
                old = [str(x.shape).encode(), repr(x.dtype.str).encode(), b"False", b"NUMPY", b"\x01\x00"]
                data = data.replace(old[int(rng.integers(5))], HEADERS[int(rng.integers(len(HEADERS)))], 1)
                data = damage(rng, data) if rng.random() < 0.3 else data
            file.writestr(f"{name}.npy" if name != victim or rng.random() < 0.9 else "../../etc/x", data)
    data = stream.getvalue()
    return damage(rng, data) if rng.random() < 0.2 else data
