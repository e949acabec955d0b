"""Pictures of designs: their shape in 3-D, and the grains of a run at several moments."""

import io
import math
from collections.abc import Mapping, Sequence

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.records.view import Colour, DesignView, Mesh
from mfopt.rotation import rotate
from reports import charts, raster

GREY = (0.7, 0.7, 0.7)  # of parts without a colour
AZIMUTH, ELEVATION = math.radians(32.0), math.radians(16.0)
SHAPE_HEIGHT_PX = 440
SNAPSHOT_HEIGHT_PX = 500
FARTHEST = 100.0  # [m] from the machine; a grain beyond has left the picture


def part_colour(view: DesignView, name: str) -> Colour:
    """Colour of a part of that name."""
    return view.colours.get(name, GREY)


def extent(views: Sequence[DesignView]) -> Array:
    """Points (n, 3) [m] that pictures of the designs must show; a backdrop may be cut off."""
    meshes = [m for view in views for name, m in view.parts.items() if name not in view.backdrop]
    return np.concatenate([vertices for vertices, _ in meshes])


def shapes(views: Sequence[DesignView]) -> list[bytes]:
    """One PNG of each design, all from the same side and at the same scale."""
    if not views:
        return []
    axes = raster.axes_from(AZIMUTH, ELEVATION)
    view = raster.window(axes, extent(views), height_px=SHAPE_HEIGHT_PX)
    return [_shape(view, design) for design in views]


def _shape(view: raster.View, design: DesignView) -> bytes:
    picture = raster.blank(view)
    for name in sorted(design.parts, key=lambda n: design.translucent.get(n, 1.0), reverse=True):
        vertices, triangles = design.parts[name]
        picture = raster.draw_mesh(
            picture, view, vertices, triangles, part_colour(design, name),
            opacity=design.translucent.get(name, 1.0),
        )  # fmt: skip
    return png(raster.finish(picture))


def png(pixels: AnyArray) -> bytes:
    """Pixels (height, width, 3) as a PNG file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", optimize=False)
    return file.getvalue()


def snapshots(raw: Mapping[str, AnyArray], design: DesignView) -> str | None:
    """Grains at the stored moments, coloured by speed, walls cut open at y = 0; as SVG.

    None if the run stored no moments, or the design does not say what a grain looks like.
    """
    if "snapshot_positions" not in raw or not len(design.grain_radii) or not design.parts:
        return None
    times, positions = raw["snapshot_times"], raw["snapshot_positions"]
    positions = np.where(np.abs(positions) < FARTHEST, positions, np.nan)
    speeds = raw["snapshot_speeds"][np.isfinite(raw["snapshot_speeds"])]
    top_speed = charts.round_up(float(np.quantile(speeds, 0.99)) if speeds.size else 0.0)
    cuts = [wall_lines(design, float(t)) for t in times]
    view = _front(cuts, wall_lines(design, 0.0), positions)
    pixels = [
        _grains(view, design, positions[i], raw["snapshot_orientations"][i],
                charts.speed_colours(raw["snapshot_speeds"][i], top_speed))
        for i in range(len(times))
    ]  # fmt: skip
    extent = (view.left, view.right, view.bottom, view.top)
    return charts.snapshots(times, pixels, cuts, extent, top_speed)


def _front(cuts: Sequence[Array], start: Array, positions: Array) -> raster.View:
    """The front view that holds the grains and the machine, but not the whole plate.

    What is lifted may leave it: it is as high as the machine at the start, or the grains.
    """
    walls = np.concatenate(cuts).reshape(-1, 2)
    standing = start.reshape(-1, 2)
    upright = np.concatenate([c[np.ptp(c[:, :, 1], axis=1) > 0.0] for c in cuts]).reshape(-1, 2)
    grains = positions.reshape(-1, 3)
    grains = grains[np.isfinite(grains).all(axis=1)][:, [0, 2]]
    across = np.concatenate((upright if len(upright) else walls, grains))
    inside = np.concatenate((standing, grains))
    corners = np.array([
        (across[:, 0].min(), 0.0, inside[:, 1].min()),
        (across[:, 0].max(), 0.0, inside[:, 1].max()),
    ])  # fmt: skip
    axes = raster.axes_from(0.0, 0.0)
    return raster.window(axes, corners, height_px=SNAPSHOT_HEIGHT_PX, margin=0.015)


def _grains(
    view: raster.View, design: DesignView, positions: Array, orientations: Array, colours: Array
) -> AnyArray:
    there = np.isfinite(positions).all(axis=1)
    turned = rotate(orientations[there], design.grain_offsets)
    centres = (positions[there][:, None, :] + turned).reshape(-1, 3)
    k = len(design.grain_radii)
    radii = np.tile(design.grain_radii, int(there.sum()))
    picture = raster.draw_spheres(
        raster.blank(view), view, centres, radii, np.repeat(colours[there], k, axis=0)
    )
    return raster.finish(picture)


def wall_lines(design: DesignView, time: float) -> Array:
    """Segments (m, 2, 2) of x and z where the parts cross y = 0 at `time` [s]."""
    moved = 0.0
    if len(design.motion_times):
        since_start = design.motion_positions - design.motion_positions[0]
        moved = float(np.interp(time, design.motion_times, since_start))
    way = np.array([0.0, moved] if design.upwards else [moved, 0.0])
    made = []
    for name, mesh in design.parts.items():
        made.append(section(mesh) + (way if name in design.moving else 0.0))
    return np.concatenate(made)


def section(mesh: Mesh) -> Array:
    """Segments (m, 2, 2) of x and z where a mesh crosses the plane y = 0."""
    corners = mesh[0][mesh[1]]
    y = corners[:, :, 1] + 1e-12  # a vertex exactly in the plane counts to one side
    crossing = (y.min(axis=1) < 0.0) & (y.max(axis=1) > 0.0)
    segments = []
    for triangle, sides in zip(corners[crossing], y[crossing], strict=True):
        ends = []
        for i in range(3):
            j = (i + 1) % 3
            if sides[i] * sides[j] < 0.0:
                share = sides[i] / (sides[i] - sides[j])
                point = triangle[i] + share * (triangle[j] - triangle[i])
                ends.append(point[[0, 2]])
        segments.append(ends)
    return np.array(segments).reshape(-1, 2, 2)
