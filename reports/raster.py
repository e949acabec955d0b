"""A small software renderer: triangles and spheres, seen in parallel projection.

It needs numpy only. A report must also work on a machine without OpenGL, where other renderers end
the whole process instead of raising an error. A pixel shows what is nearest to the viewer (depth
buffer). Against jagged edges, each pixel is the average of `SAMPLES` x `SAMPLES` finer pixels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mfopt.arrays import AnyArray, Array, IntArray

Pixels = NDArray[np.float32]

SAMPLES = 2  # finer pixels per side of a pixel
AMBIENT, DIFFUSE = 0.45, 0.55  # shares of light, for a matt surface
SPHERE_AMBIENT = 0.65  # more, so that a grain's colour can be compared with the colour bar
LIGHT = np.array([-0.35, 0.45, 0.82]) / np.linalg.norm([-0.35, 0.45, 0.82])  # in view axes
OUTLINE_JUMP = 0.006  # [m] a step in depth that is drawn as an edge; finer than a wall
OUTLINE_SHADE = 0.45  # brightness of such an edge


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A parallel projection onto a window of so many pixels."""

    axes: Array  # (3, 3) rows: right, up, towards the viewer
    left: float  # [m] edges of the window on the right and up axes
    right: float
    bottom: float
    top: float
    pixels_per_metre: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the finer pixels."""
        scale = self.scale
        return (
            max(SAMPLES, round((self.top - self.bottom) * scale / SAMPLES) * SAMPLES),
            max(SAMPLES, round((self.right - self.left) * scale / SAMPLES) * SAMPLES),
        )

    @property
    def scale(self) -> float:
        """Finer pixels per metre."""
        return self.pixels_per_metre * SAMPLES

    def project(self, points: Array) -> Array:
        """Points (n, 3) [m] to column, row and nearness (n, 3) in finer pixels."""
        seen = points @ self.axes.T * self.scale
        seen[:, 0] -= self.left * self.scale
        seen[:, 1] = self.top * self.scale - seen[:, 1]
        return np.asarray(seen)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """The drawing so far."""

    colour: Pixels  # (rows, columns, 3) 0..1
    near: Pixels  # (rows, columns) nearness in finer pixels; -inf where nothing is


def axes_from(azimuth: float, elevation: float) -> Array:
    """Axes of a viewer at `azimuth` [rad] from the -y axis and `elevation` [rad] above."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    right = np.array([ca, sa, 0.0])
    towards = np.array([sa * ce, -ca * ce, se])
    return np.stack((right, np.cross(towards, right), towards))


def window(axes: Array, points: Array, *, height_px: int, margin: float = 0.01) -> View:
    """The view along `axes` that holds all `points` (n, 3) [m] with a margin [m]."""
    seen = points @ axes.T
    low, high = seen.min(axis=0) - margin, seen.max(axis=0) + margin
    return View(axes, low[0], high[0], low[1], high[1], height_px / (high[1] - low[1]))


def blank(view: View) -> Picture:
    """An empty white picture."""
    return Picture(
        np.ones((*view.shape, 3), dtype=np.float32),
        np.full(view.shape, -np.inf, dtype=np.float32),
    )


def draw_mesh(
    picture: Picture,
    view: View,
    vertices: Array,
    triangles: IntArray,
    colour: tuple[float, float, float],
    *,
    opacity: float = 1.0,
) -> Picture:
    """Draw a triangle mesh, matt and lit from both sides; edges in depth are drawn darker."""
    near, light = _surface(view, view.project(vertices)[triangles])
    rows, columns = np.nonzero(near > picture.near)
    if not rows.size:
        return picture
    part = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    visible = near[part] > picture.near[part]
    shade = np.where(_edges(near[part], view.scale), light[part] * OUTLINE_SHADE, light[part])
    share = (opacity * visible)[..., None]
    mixed, kept = picture.colour.copy(), picture.near.copy()
    mixed[part] = (1.0 - share) * mixed[part] + share * shade[..., None] * np.array(colour)
    if opacity == 1.0:
        kept[part] = np.where(visible, near[part], kept[part])
    return Picture(mixed, kept)


def _surface(view: View, corners: Array) -> tuple[Pixels, Pixels]:
    """Nearness and brightness of triangles (t, 3, 3) of column, row, nearness, per pixel.

    Within a triangle nearness and the two barycentric weights are linear in column and row.
    """
    near = np.full(view.shape, -np.inf, dtype=np.float32)
    light = np.zeros(view.shape, dtype=np.float32)
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(ab, ac)
    seen = np.abs(normals[:, 2]) > 1e-9  # the others are seen edge on
    a, ab, ac, normals = a[seen], ab[seen], ac[seen], normals[seen]
    lit = np.abs(normals @ (LIGHT * [1.0, -1.0, 1.0])) / np.linalg.norm(normals, axis=1)
    first = np.ceil(corners[seen, :, :2].min(axis=1) - 0.5).astype(int).clip(0)
    last = np.floor(corners[seen, :, :2].max(axis=1) + 0.5).astype(int)
    last = np.minimum(last, (view.shape[1], view.shape[0]))
    slope_b = np.column_stack((ac[:, 1], -ac[:, 0])) / normals[:, 2:]
    slope_c = np.column_stack((-ab[:, 1], ab[:, 0])) / normals[:, 2:]
    slope_depth = slope_b * ab[:, 2:] + slope_c * ac[:, 2:]
    for t in np.flatnonzero((last > first).all(axis=1)):
        part = np.s_[first[t, 1] : last[t, 1], first[t, 0] : last[t, 0]]
        x = np.arange(first[t, 0], last[t, 0]) + (0.5 - a[t, 0])
        y = np.arange(first[t, 1], last[t, 1])[:, None] + (0.5 - a[t, 1])
        b = x * slope_b[t, 0] + y * slope_b[t, 1]
        c = x * slope_c[t, 0] + y * slope_c[t, 1]
        depth = a[t, 2] + x * slope_depth[t, 0] + y * slope_depth[t, 1]
        wins = (np.minimum(b, c) >= -1e-9) & (b + c <= 1.0 + 1e-9) & (depth > near[part])
        near[part][wins] = depth[wins]
        light[part][wins] = AMBIENT + DIFFUSE * lit[t]
    return near, light


def _edges(near: Pixels, scale: float) -> AnyArray:
    """Where the surface ends or steps back by more than `OUTLINE_JUMP`."""
    there = np.isfinite(near)
    far = np.pad(np.where(there, near, -1e9), 1, constant_values=-1e9)
    middle, limit = far[1:-1, 1:-1], OUTLINE_JUMP * scale
    lowest = np.minimum(np.minimum(far[:-2, 1:-1], far[2:, 1:-1]),
                        np.minimum(far[1:-1, :-2], far[1:-1, 2:]))  # fmt: skip
    return np.asarray(there & (middle - lowest > limit))


def draw_spheres(
    picture: Picture, view: View, centres: Array, radii: Array, colours: Array
) -> Picture:
    """Draw spheres (n, 3) [m], (n,) [m] in colours (n, 3), matt with shaded rims."""
    if not len(centres):
        return picture
    near, colour = picture.near.copy(), picture.colour.copy()
    seen, r = view.project(centres), radii * view.scale
    reach = int(np.ceil(r.max()))
    corner = np.floor(seen[:, :2]).astype(int)
    offsets = [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)]
    hits = [h for o in offsets if (h := _hit(near, seen, r, corner, o)) is not None]
    for pixel, depth, _, _ in hits:
        np.maximum.at(near.reshape(-1), pixel, depth)
    for pixel, depth, who, brightness in hits:
        wins = depth >= near.reshape(-1)[pixel]
        colour.reshape(-1, 3)[pixel[wins]] = colours[who[wins]] * brightness[wins, None]
    return Picture(colour, near)


def _hit(
    near: Pixels, seen: Array, r: Array, corner: IntArray, offset: tuple[int, int]
) -> tuple[IntArray, Pixels, IntArray, Array] | None:
    """Pixels at one offset from the spheres' centres: index, nearness, sphere, brightness."""
    rows, columns = near.shape
    column, row = corner[:, 0] + offset[0], corner[:, 1] + offset[1]
    away_x, away_y = (column + 0.5 - seen[:, 0]) / r, (row + 0.5 - seen[:, 1]) / r
    square = away_x * away_x + away_y * away_y
    within = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
    who = np.flatnonzero((square < 1.0) & within)
    if not who.size:
        return None
    height = np.sqrt(1.0 - square[who])
    normal = np.column_stack((away_x[who], -away_y[who], height))
    brightness = SPHERE_AMBIENT + (1.0 - SPHERE_AMBIENT) * np.clip(normal @ LIGHT, 0.0, 1.0)
    depth = (seen[who, 2] + r[who] * height).astype(np.float32)
    return row[who] * columns + column[who], depth, who, brightness


def finish(picture: Picture) -> NDArray[np.uint8]:
    """The picture (height, width, 3) as bytes 0..255, averaged from the finer pixels."""
    rows, columns, _ = picture.colour.shape
    fine = picture.colour.reshape(rows // SAMPLES, SAMPLES, columns // SAMPLES, SAMPLES, 3)
    mean = fine.mean(axis=(1, 3)).clip(0.0, 1.0)
    return np.asarray(np.round(255.0 * mean), dtype=np.uint8)
