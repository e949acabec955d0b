"""Mesh files: STL for simulation and printing, glTF for viewing. STEP is in `geometry.step`."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from geometry.mesh import Mesh, corners
from geometry.step import write_step as write_step
from mfopt.files.whole import write_aside

# Colours of the parts in turn [RGBA, 0..255]: Okabe and Ito, told apart by the colour-blind.
COLOURS = (
    (0, 114, 178, 255),
    (230, 159, 0, 255),
    (0, 158, 115, 255),
    (204, 121, 167, 255),
    (86, 180, 233, 255),
    (213, 94, 0, 255),
)
# STL has no unit; workshop programs expect millimetres. [mm/m]
STL_SCALE = 1e3


def write_stl(path: Path, mesh: Mesh) -> None:
    """Write a mesh as binary STL in millimetres, whole or not at all."""
    points = corners(mesh) * STL_SCALE
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(
        len(points), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")]
    )
    facets["normal"], facets["corners"] = normals, points
    header = b"mfopt, millimetres".ljust(80) + np.uint32(len(points)).tobytes()
    write_aside(path, header + facets.tobytes())


def write_gltf(path: Path, meshes: Mapping[str, Mesh]) -> None:
    """Write named meshes, each in its colour, as binary glTF (.glb), whole or not at all.

    glTF uses metres and y up, so the parts are turned.
    """
    trimesh: Any = import_module("trimesh")  # loaded late: it is heavy

    scene = trimesh.Scene()
    for number, (name, mesh) in enumerate(meshes.items()):
        x, y, z = mesh.vertices.T
        part = trimesh.Trimesh(np.column_stack([x, z, -y]), mesh.triangles, process=False)
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=COLOURS[number % len(COLOURS)],
            metallicFactor=0.1,
            roughnessFactor=0.6,
            doubleSided=True,
        )
        part.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(part, node_name=name, geom_name=name)
    write_aside(path, bytes(scene.export(file_type="glb")))
