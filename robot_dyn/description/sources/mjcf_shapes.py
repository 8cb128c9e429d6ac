"""The geoms of a MJCF file as <visual> elements of a URDF.

Drawn are geoms of the groups 0 to 2, as in MuJoCo's viewer, that are not transparent: of a body those that touch
nothing, which are there to be seen; all, if each touches something. A capsule is a cylinder and two spheres. A mesh is
drawn from its file, in the colour of the geom; MuJoCo places its corners x in the frame of the geom at

    R_mᵀ (R_refᵀ S (x − p_ref) − p_m)      S: scale; R_m, p_m: its own frame of the mesh; R_ref, p_ref: of the file
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.sources.mjcf_model import Compiled
from robot_dyn.foundations.spatial import rpy_of

_GROUPS = 3  # 0 to 2
_UNSTATED = (0.5, 0.5, 0.5, 1.0)  # the colour for which MuJoCo takes that of the material
_NOT_DRAWN = ("plane", "hfield")  # scenery without end
_Placed = tuple[str, dict[str, str], np.ndarray, np.ndarray]  # tag, attributes, R, p


class Shapes:
    """Writes the geoms of bodies; `left_out` says which kinds are not drawn."""

    def __init__(self, of: Compiled) -> None:
        self.of, self.model, self.left_out = of, of.model, list[str]()

    def draw(self, link: Any, body: int) -> None:
        """Add the geoms of a body to its link."""
        first = int(self.model.body_geomadr[body])
        seen = [*filter(self.seen, range(first, first + int(self.model.body_geomnum[body])))]
        for geom in [geom for geom in seen if not self.touches(geom)] or seen:
            for tag, attributes, R, p in self.placed(geom):
                visual = etree.SubElement(link, "visual")
                etree.SubElement(visual, "origin", xyz=_words(p), rpy=_words(rpy_of(R)))
                etree.SubElement(etree.SubElement(visual, "geometry"), tag, attributes)
                rgba = _words(self.color(geom))  # and its name, since urdfdom refuses a material without one
                etree.SubElement(etree.SubElement(visual, "material", name=rgba), "color", rgba=rgba)

    def kind(self, geom: int) -> str:
        """Its kind as MJCF writes it, such as "box"."""
        return self.of.mujoco.mjtGeom(int(self.model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()

    def seen(self, geom: int) -> bool:
        """Whether MuJoCo's viewer shows it, and it ends somewhere."""
        hidden = self.model.geom_group[geom] >= _GROUPS or self.kind(geom) in _NOT_DRAWN
        return not hidden and self.color(geom)[3] > 0

    def touches(self, geom: int) -> bool:
        """Whether it can be in contact with another one."""
        return bool(self.model.geom_contype[geom] or self.model.geom_conaffinity[geom])

    def color(self, geom: int) -> np.ndarray:
        """Red, green, blue and opacity, (4,): its own, else that of its material."""
        own, material = self.model.geom_rgba[geom], int(self.model.geom_matid[geom])
        return self.model.mat_rgba[material] if material >= 0 and np.allclose(own, _UNSTATED) else own

    def placed(self, geom: int) -> Iterator[_Placed]:
        """The shapes of URDF that make up a geom, in the frame of its body; none if URDF has none for it."""
        R, p, kind = self.of.rotation(self.model.geom_quat[geom]), self.model.geom_pos[geom], self.kind(geom)
        x, y, z = map(float, self.model.geom_size[geom])
        if kind == "box":
            yield "box", {"size": _words((2 * x, 2 * y, 2 * z))}, R, p
        elif kind in ("cylinder", "capsule"):
            yield "cylinder", {"radius": repr(x), "length": repr(2 * y)}, R, p
            for end in (-y, y) if kind == "capsule" else ():
                yield "sphere", {"radius": repr(x)}, R, p + R[:, 2] * end
        elif kind == "sphere" or (kind == "ellipsoid" and x == y == z):
            yield "sphere", {"radius": repr(x)}, R, p
        elif kind == "mesh":
            yield from self.mesh(int(self.model.geom_dataid[geom]), R, p)
        else:
            self.left_out.append(kind)

    def mesh(self, mesh: int, R: np.ndarray, p: np.ndarray) -> Iterator[_Placed]:
        """The file of a mesh, in the frame of the body of a geom at R, p; nothing if URDF cannot place it."""
        model, scale = self.model, self.model.mesh_scale[mesh]
        reference = self.of.references.get(self.of.name("mesh", mesh))
        start = int(model.mesh_pathadr[mesh])
        if start < 0 or reference is None:
            self.left_out.append("mesh without a file")
            return
        p_ref, R_ref = reference[0], self.of.rotation(reference[1])
        if np.ptp(scale) and not np.array_equal(R_ref, np.eye(3)):
            self.left_out.append("mesh scaled along turned axes")
            return
        R = R @ self.of.rotation(model.mesh_quat[mesh]).T
        p = p - R @ model.mesh_pos[mesh]
        R = R @ R_ref.T
        file = bytes(model.paths[start:]).partition(b"\0")[0].decode(errors="replace")
        address = os.path.relpath(file, self.of.path.parent)
        attributes = {"filename": Path(address).as_posix(), "scale": _words(scale), "materials": "ignored"}
        yield "mesh", attributes, R, p - R @ (scale * p_ref)


def _words(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
