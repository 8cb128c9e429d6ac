"""The geoms of a MJCF file as <visual> elements of a URDF.

Geoms of the groups 0 to 2 that are not transparent are drawn, as in MuJoCo's viewer. If a body has geoms without
contacts, which exist to be visible, only those are drawn. A capsule becomes a cylinder and two spheres. A mesh is drawn
from its file in the colour of the geom; MuJoCo places its vertices x in the frame of the geom at

    R_mᵀ (R_refᵀ S (x − p_ref) − p_m)      S: scale; R_m, p_m: its own frame of the mesh; R_ref, p_ref: of the file
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.markup import vector_text
from robot_dyn.description.sources.mjcf_model import Compiled
from robot_dyn.foundations.spatial import rpy_of

_GROUPS = 3  # 0 to 2
_UNSTATED = (0.5, 0.5, 0.5, 1.0)  # the colour for which MuJoCo takes that of the material
_NOT_DRAWN = ("plane", "hfield")  # unbounded scenery
_Placed = tuple[str, dict[str, str], np.ndarray, np.ndarray]  # tag, attributes, R, p


class Shapes:
    """Writer of the geoms of bodies; `left_out` lists the kinds that are not drawn."""

    def __init__(self, compiled: Compiled) -> None:
        self.compiled, self.model, self.left_out = compiled, compiled.model, list[str]()

    def draw(self, link: etree._Element, body: int) -> None:
        """Add the geoms of a body to its link."""
        first = int(self.model.body_geomadr[body])
        visible = [*filter(self.visible, range(first, first + int(self.model.body_geomnum[body])))]
        for geom in [geom for geom in visible if not self.touches(geom)] or visible:
            for tag, attributes, R, p in self.placed(geom):
                visual = etree.SubElement(link, "visual")
                etree.SubElement(visual, "origin", xyz=vector_text(p), rpy=vector_text(rpy_of(R)))
                etree.SubElement(etree.SubElement(visual, "geometry"), tag, attributes)
                rgba = vector_text(self.color(geom))  # also its name: urdfdom refuses a material without one
                etree.SubElement(etree.SubElement(visual, "material", name=rgba), "color", rgba=rgba)

    def kind(self, geom: int) -> str:
        """Return the kind of a geom in MJCF's words, such as "box"."""
        return self.compiled.mujoco.mjtGeom(int(self.model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()

    def visible(self, geom: int) -> bool:
        """Return True if MuJoCo's viewer shows a geom and it is bounded."""
        hidden = self.model.geom_group[geom] >= _GROUPS or self.kind(geom) in _NOT_DRAWN
        return not hidden and self.color(geom)[3] > 0

    def touches(self, geom: int) -> bool:
        """Return True if a geom can be in contact with another one."""
        return bool(self.model.geom_contype[geom] or self.model.geom_conaffinity[geom])

    def color(self, geom: int) -> np.ndarray:
        """Return red, green, blue and opacity, (4,), of a geom, or of its material if it has none."""
        own, material = self.model.geom_rgba[geom], int(self.model.geom_matid[geom])
        return self.model.mat_rgba[material] if material >= 0 and np.allclose(own, _UNSTATED) else own

    def placed(self, geom: int) -> Iterator[_Placed]:
        """Return the URDF shapes that make up a geom, in the frame of its body; none if URDF has no such shape."""
        R, p, kind = self.compiled.rotation(self.model.geom_quat[geom]), self.model.geom_pos[geom], self.kind(geom)
        x, y, z = map(float, self.model.geom_size[geom])
        if kind == "box":
            yield "box", {"size": vector_text((2 * x, 2 * y, 2 * z))}, R, p
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
        """Return the file of a mesh in the body frame, for a geom at R, p; nothing if URDF cannot place it."""
        model, scale = self.model, self.model.mesh_scale[mesh]
        reference = self.compiled.references.get(self.compiled.name("mesh", mesh))
        start = int(model.mesh_pathadr[mesh])
        if start < 0 or reference is None:
            self.left_out.append("mesh without a file")
            return
        p_ref, R_ref = reference[0], self.compiled.rotation(reference[1])
        if np.ptp(scale) and not np.array_equal(R_ref, np.eye(3)):
            self.left_out.append("mesh scaled along turned axes")
            return
        R = R @ self.compiled.rotation(model.mesh_quat[mesh]).T
        p = p - R @ model.mesh_pos[mesh]
        R = R @ R_ref.T
        file = bytes(model.paths[start:]).partition(b"\0")[0].decode(errors="replace")
        address = os.path.relpath(file, self.compiled.path.parent)
        attributes = {"filename": Path(address).as_posix(), "scale": vector_text(scale), "materials": "ignored"}
        yield "mesh", attributes, R, p - R @ (scale * p_ref)
