"""Damage of bytes and of texts, which any format may suffer."""

from __future__ import annotations

import numpy as np

WORDS = [
    "nan", "inf", "-1", "0", "1e308", "1e-320", "9" * 400, "true", '""', "[]", "{}", "\0", "\x1b[31m", "\u202e", "é",
]  # fmt: skip
WORDS += ["'", '"', "[", "]", "=", "\n", "#", ".", "a" * 20_000, "[" * 3000, '"urdf"', "../..", "/dev/zero", "-"]


def damage(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes flipped, cut, removed, doubled or exchanged, once or a few times."""
    for _ in range(int(rng.integers(1, 4))):
        i, j = sorted(int(k) for k in rng.integers(0, len(data) + 1, 2))
        j = min(j, i + int(rng.choice([1, 4, 64, 4096])))
        match int(rng.integers(6)):
            case 0:
                data = data[:i] + bytes(rng.integers(0, 256, j - i, dtype=np.uint8)) + data[j:]
            case 1:
                data = data[:i]
            case 2:
                data = data[:i] + data[j:]
            case 3:
                data = data[:j] + data[i:j] + data[j:]
            case 4:
                data = data[:i] + bytes(b ^ (1 << int(rng.integers(8))) for b in data[i : i + 1]) + data[i + 1 :]
            case _:
                data = data[j:] + data[:i]
    return data


def damage_text(rng: np.random.Generator, text: str) -> str:
    """Lines exchanged, doubled or removed; words replaced by odd ones."""
    for _ in range(int(rng.integers(1, 4))):
        lines = text.split("\n")
        i, j = (int(k) for k in rng.integers(0, len(lines), 2))
        word = WORDS[int(rng.integers(len(WORDS)))]
        line = lines[i]
        cut = int(rng.integers(0, len(line) + 1))
        key, equals, _ = line.partition("=")
        match int(rng.integers(6)):
            case 0:
                lines[i], lines[j] = lines[j], line
            case 1:
                lines.insert(j, line)
            case 2:
                del lines[i]
            case 3:
                lines[i] = line[:cut] + word + line[cut:]
            case 4:
                lines[i] = f"{key}{equals} {word}"
            case _:
                lines[i] = line[:cut]
        text = "\n".join(lines)
    return text
