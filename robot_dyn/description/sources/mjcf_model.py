"""An MJCF file compiled by MuJoCo, with MuJoCo's warnings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.foundations.errors import DescriptionError, shorten
from robot_dyn.foundations.extras import needs


@final
@dataclass(frozen=True, eq=False)
class Compiled:
    """A compiled MJCF file.

    Attributes:
        mujoco: The module `mujoco`.
        model: The `MjModel`.
        path: The file.
        references: `refpos` and `refquat` of each mesh by name, which the model does not store.
        warnings: Warnings of MuJoCo, as sentences.
    """

    mujoco: Any
    model: Any
    path: Path
    references: dict[str, tuple[np.ndarray, np.ndarray]]
    warnings: tuple[str, ...]

    def name(self, kind: str, index: int) -> str:
        """Return the name of a body, joint, mesh …; for example body_3 if it has none."""
        kind_number = getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return (self.mujoco.mj_id2name(self.model, kind_number, index) or "").strip() or f"{kind}_{index}"

    def disabled(self, *flags: str) -> bool:
        """Return True if `<option>` disables one of these flags; flags unknown to this MuJoCo do not count."""
        bits = (int(getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}", 0)) for flag in flags)
        return any(int(self.model.opt.disableflags) & bit for bit in bits)

    def rotation(self, quaternion: np.ndarray) -> np.ndarray:
        """Return the matrix (3, 3) of a quaternion (w, x, y, z)."""
        R = np.zeros(9)
        self.mujoco.mju_quat2Mat(R, quaternion / np.linalg.norm(quaternion))
        return R.reshape(3, 3)


def compile_model(path: Path) -> Compiled:
    """Compile an MJCF file.

    Raises:
        MissingExtraError: If MuJoCo is not installed.
        DescriptionError: If MuJoCo rejects the file.
    """
    mujoco: Any = needs("mujoco", extra="mjcf")
    with _warnings(mujoco) as warnings:
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
            meshes = mujoco.MjSpec.from_file(str(path)).meshes if model.nmesh else ()
        except Exception as error:  # ValueError from the compiler, and errors from its mesh readers
            raise DescriptionError(f"{path}: MuJoCo rejects it: {shorten(' '.join(str(error).split()), 300)}") from None
    references = {mesh.name or Path(mesh.file).stem: (mesh.refpos.copy(), mesh.refquat.copy()) for mesh in meshes}
    sentences = (f"MuJoCo warns: {shorten(' '.join(text.split()), 300)}" for text in dict.fromkeys(warnings))
    return Compiled(mujoco, model, path, references, tuple(sentences))


@contextmanager
def _warnings(mujoco: Any) -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo, which would otherwise go to MUJOCO_LOG.TXT in the working directory."""
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        yield warnings
    finally:
        mujoco.set_mju_user_warning(before)
