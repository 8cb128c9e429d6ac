"""The cache of kernels: entries with damaged bytes or headers, or under the name of another. None is handed out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robot_dyn.codegen import Store, digest_of_texts
from tests.campaigns.fuzz.bytes import damage

PAYLOADS = {digest_of_texts(["kernel", str(i)]): bytes(range(200)) * (1 + 5 * i) for i in range(3)}


def seeds(folder: Path) -> list[tuple[str, bytes]]:
    """Entries as the store writes them."""
    store = _store(folder)
    for name, payload in PAYLOADS.items():
        store.save(name, payload, "a kernel")
    return [(name, next(store.folder.glob(f"{name}*")).read_bytes()) for name in PAYLOADS]


def mutate(rng: np.random.Generator, seed: tuple[str, bytes]) -> tuple[str, bytes]:
    """An entry that is damaged, or stands under the key of another."""
    name, data = seed
    if rng.random() < 0.1:
        return list(PAYLOADS)[int(rng.integers(len(PAYLOADS)))], data
    return name, damage(rng, data)


def attempt(mutant: tuple[str, bytes], folder: Path) -> str:
    """Ask for it: what is given out is what was saved under that key, or nothing."""
    name, data = mutant
    store = _store(folder)
    (store.folder / f"{name}.kernel").write_bytes(data)
    given = store.load(name)
    if given is None:
        return "refused"
    return "accepted" if given == PAYLOADS[name] else "foreign: a payload that was not saved under its key"


def _store(folder: Path) -> Store:
    return Store(folder / "kernels")
