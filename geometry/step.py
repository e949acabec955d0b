"""STEP file of hopper and tube for the workshop, exact, not a mesh.

The loft is a polynomial of degree 3 in z, and the corners are circular arcs. So each of the eight
sides is one rational Bezier surface of degree (2, 3) or (1, 3), and the file holds exactly the
surface of `geometry.loft`, up to rounding. STEP programs read a B-spline surface.
"""

import math
import os
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from geometry.loft import Loft, check_loft, check_tube
from geometry.sections import SLACK, Section
from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.files.whole import full_disk_named

# STEP is written in millimetres, what workshops work in. [mm/m]
SCALE = 1e3
SEWING_TOLERANCE = 1e-4  # [mm], far above rounding, far below any workshop's tolerance
# Weight of the middle pole of a quarter circle as a rational Bezier curve of degree 2.
ARC_WEIGHT = math.cos(math.pi / 4)


def write_step(path: Path, loft: Loft, tube_end_z: float) -> None:
    """Write the inner surface of hopper and tube as STEP, an open shell in millimetres.

    Raises:
        ConfigError: without the extra `cad`.
        InvalidDesign: if loft or tube cannot be built.
    """
    check_loft(loft)
    check_tube(loft, tube_end_z)
    _require_cad()
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface_Static.SetCVal_s("write.step.product.name", "hopper and tube, inner surface")
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with full_disk_named(path):
            writer.Transfer(step_shape(loft, tube_end_z), STEPControl_AsIs)
            if writer.Write(str(aside)) != IFSelect_RetDone:
                raise ConfigError(f"cannot write {path}; choose a directory that can be written")
            aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def _require_cad() -> None:
    """Load the CAD kernel and silence its progress messages.

    Raises:
        ConfigError: without the extra `cad`.
    """
    try:
        import_module("OCP.collections")  # since version 8
        from OCP.Message import Message, Message_Gravity
    except ImportError as error:
        raise ConfigError(
            "STEP export needs the extra `cad` (cadquery-ocp-novtk 8 or newer); "
            "install it from mfopt's folder: pip install '.[cad]'"
        ) from error
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)


def step_shape(loft: Loft, tube_end_z: float) -> Any:
    """Shell of hopper and tube in millimetres, an OCP shape."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_Sewing

    sewing = BRepBuilderAPI_Sewing(SEWING_TOLERANCE)
    for poles, weights in surfaces(loft, tube_end_z):
        face = BRepBuilderAPI_MakeFace(_bezier_surface(poles, weights), SEWING_TOLERANCE)
        sewing.Add(face.Face())
    sewing.Perform()
    return sewing.SewedShape()


def surfaces(loft: Loft, tube_end_z: float) -> list[tuple[Array, Array]]:
    """Rational Bezier surfaces of hopper and tube, their normals outwards.

    Returns:
        Poles (m, n, 3) [m] and weights (m,) of each; m poles around, n along z upwards.
    """
    top, outlet = float(loft.heights[0]), float(loft.heights[-1])
    hopper = _bezier_poles(loft)
    found = []
    for quantities, heights in (
        (hopper, np.linspace(top, outlet, 4)),  # z is its own parameter: poles equally spaced
        (hopper[[-1, -1]], np.array([outlet, tube_end_z])),
    ):
        outlines = [_outline_poles(Section(*map(float, q))) for q in quantities[::-1]]
        for sides in zip(*outlines, strict=True):
            flat = len(sides[0]) == 2
            if flat and all(np.ptp(side, axis=0).max() < SLACK for side in sides):
                continue  # the radius is half the side all the way: there is no flat part
            poles = [_at_height(side, z) for side, z in zip(sides, heights[::-1], strict=True)]
            weights = [1.0, 1.0] if flat else [1.0, ARC_WEIGHT, 1.0]
            found.append((np.stack(poles, axis=1), np.array(weights)))
    return found


def _bezier_poles(loft: Loft) -> Array:
    """Length, width, radius and shift as Bezier curves over z, (4 poles, 4) from the top."""
    span = float(loft.heights[-1] - loft.heights[0])
    powers = loft.coefficients * span ** np.arange(4)[:, None]
    to_bernstein = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
    return np.asarray(to_bernstein @ powers)


def _outline_poles(section: Section) -> list[Array]:
    """Poles (3, 2) of each corner and (2, 2) of the flat side after it, counter-clockwise [m]."""
    half_x, half_y = section.length / 2 - section.radius, section.width / 2 - section.radius
    arc = section.radius * np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    centres = np.array([[half_x, half_y], [-half_x, half_y], [-half_x, -half_y], [half_x, -half_y]])
    quarter_turn = np.array([[0.0, 1.0], [-1.0, 0.0]])  # of row vectors
    corners = []
    for centre in centres + np.array([section.shift, 0.0]):
        corners.append(centre + arc)
        arc = arc @ quarter_turn
    poles = []
    for corner, following in zip(corners, corners[1:] + corners[:1], strict=True):
        poles += [corner, np.stack([corner[-1], following[0]])]
    return poles


def _at_height(points: Array, z: float) -> Array:
    """Points (m, 2) lifted to the height `z`, (m, 3)."""
    return np.column_stack([points, np.full(len(points), z)])


def _bezier_surface(poles: Array, weights: Array) -> Any:
    """Geom_BezierSurface in millimetres of `poles` (m, n, 3) [m] with `weights` (m,)."""
    from OCP.collections import Array2_double, Array2_gp_Pnt
    from OCP.Geom import Geom_BezierSurface
    from OCP.gp import gp_Pnt

    m, n = poles.shape[:2]
    points, values = Array2_gp_Pnt(1, m, 1, n), Array2_double(1, m, 1, n)
    for i in range(m):
        for j in range(n):
            points.SetValue(i + 1, j + 1, gp_Pnt(*map(float, poles[i, j] * SCALE)))
            values.SetValue(i + 1, j + 1, float(weights[i]))
    return Geom_BezierSurface(points, values)
