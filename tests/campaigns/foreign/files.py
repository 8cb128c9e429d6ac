"""The record of one foreign file, and the sound arm that most of them are."""

from __future__ import annotations

from dataclasses import dataclass

from tests.hostile.kinds import ARM, arm, inside

__all__ = ["ARM", "XACRO", "Foreign", "arm", "inside"]

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


@dataclass(frozen=True)
class Foreign:
    """One file.

    Attributes:
        id: What is foreign in it.
        text: Its content.
        said: For each of its warnings some fragments; empty if it loads in silence.
        refused: Fragments of the refusal; empty if it loads.
        sound: A file without the oddity, whose dynamics it has.
    """

    id: str
    text: str | bytes
    said: tuple[tuple[str, ...], ...] = ()
    refused: tuple[str, ...] = ()
    sound: str = ARM
