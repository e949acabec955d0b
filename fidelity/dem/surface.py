"""Walls prepared for contact: welded triangles that know their neighbours, and where they are.

Walls that share a motion (or stand still) and their end are one body: their vertices are welded,
so that a sphere that rolls from one to the other finds one surface.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fidelity.engine import Wall, WallMotion
from mfopt.arrays import Array, BoolArray, IntArray

WELD = 1e-7  # [m] vertices closer than this are one
COPLANAR = 1e-6  # [rad] neighbours that differ by less are one flat patch
LARGEST_GRID = 4_000_000  # cells
ASKEW = np.array([0.3 * np.sqrt(2.0), 0.3 * np.sqrt(3.0), 0.3 * np.sqrt(5.0)])  # shorter than 1


class Surface(NamedTuple):
    """All triangles, sorted by body; `k` counts triangles, edges and corners are welded."""

    triangles: Array  # (k, 9) corner a, edges b - a and c - a [m], at time 0
    normals: Array  # (k, 3) unit
    body: IntArray  # (k,) number of the moving body; 0 stands still
    wall: IntArray  # (k,) number of the wall in the setup
    face_keys: IntArray  # (k,) one for all triangles of a flat patch
    # For the three edges and corners of each triangle: a key that is unique over faces, edges and
    # corners, or -1 where another triangle answers for it; and its directions into the surface.
    edge_keys: IntArray  # (k, 3)
    edge_first: IntArray  # (k, 3)
    edge_last: IntArray  # (k, 3)
    corner_keys: IntArray  # (k, 3)
    corner_first: IntArray  # (k, 3)
    corner_last: IntArray  # (k, 3)
    directions: Array  # (m, 3) unit


class Grid(NamedTuple):
    """Which triangles may be within reach of a point of a cell; one grid per body."""

    reach: float  # [m]
    cell: Array  # (b,) [m] edge of a cell
    low: Array  # (b, 3) [m]
    shape: IntArray  # (b, 3)
    first_cell: IntArray  # (b,)
    start: IntArray  # (cells + 1,) into `items`
    items: IntArray  # triangle numbers


class Body(NamedTuple):
    """What walls have in common that move as one and go at the same time."""

    motion: WallMotion | None  # None: it stands still
    until: float  # [s] from then on it is gone


def bodies_of(walls: Sequence[Wall]) -> tuple[list[Body], IntArray]:
    """The bodies, the one that stands still for good first, and the body (w,) of every wall."""
    bodies, numbers = [Body(None, math.inf)], []
    for wall in walls:
        same = [b.motion is wall.motion and b.until == wall.until for b in bodies]
        if not any(same):
            same.append(True)
            bodies.append(Body(wall.motion, wall.until))
        numbers.append(same.index(True))
    return bodies, np.array(numbers, dtype=np.int64)


def build_surface(walls: Sequence[Wall], body: IntArray) -> Surface:
    """Weld the walls of each body, and find flat patches, edges and corners."""
    order = np.argsort(body, kind="stable")
    parts = [(walls[i], int(body[i]), int(i)) for i in order]
    corners = np.concatenate(
        [np.asarray(w.vertices)[w.triangles] for w, _, _ in parts] or [np.empty((0, 3, 3))]
    )  # (k, 3, 3)
    counts = [len(w.triangles) for w, _, _ in parts]
    of_body = np.repeat([b for _, b, _ in parts], counts).astype(np.int64)
    of_wall = np.repeat([i for _, _, i in parts], counts).astype(np.int64)
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(area, axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    sound = double > WELD * longest  # higher than the welding distance
    corners, of_body, of_wall = corners[sound], of_body[sound], of_wall[sound]
    normals = area[sound] / double[sound, None]
    vertex = _welded(corners, of_body)  # (k, 3)
    edge = _edges(vertex)  # (k, 3) numbers of edges a-b, b-c, c-a
    patch = _patches(edge, normals, of_wall)
    n_patch = int(patch.max(initial=-1)) + 1
    n_edge = int(edge.max(initial=-1)) + 1
    inward = _inward(corners, normals)
    flat_edge = _within_a_patch(edge, inward, patch)
    bounded = np.bincount(
        vertex.ravel(), weights=~(flat_edge & np.roll(flat_edge, 1, axis=1)).ravel()
    )
    flat_corner = bounded[vertex] == 0
    edge_directions, edge_first, edge_last = _fans(edge, inward)
    corner_directions, corner_first, corner_last = _fans(vertex, _along(corners), per_item=2)
    return Surface(
        triangles=np.concatenate(
            [corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1
        ),
        normals=normals,
        body=of_body,
        wall=of_wall,
        face_keys=patch,
        edge_keys=np.where(_answers(edge), np.where(flat_edge, patch[:, None], n_patch + edge), -1),
        edge_first=edge_first,
        edge_last=edge_last,
        corner_keys=np.where(
            _answers(vertex), np.where(flat_corner, patch[:, None], n_patch + n_edge + vertex), -1
        ),
        corner_first=corner_first + len(edge_directions),
        corner_last=corner_last + len(edge_directions),
        directions=np.concatenate([edge_directions, corner_directions]),
    )


def _welded(corners: Array, body: IntArray) -> IntArray:
    """Number of the vertex at every corner (k, 3); the same number where they coincide."""
    points = np.column_stack([np.repeat(body, 3), corners.reshape(-1, 3)])  # bodies are 1 apart
    points, place = np.unique(points, axis=0, return_inverse=True)
    numbers = _groups(len(points), *_close(np.asarray(points, dtype=np.float64)))
    return numbers[place].reshape(-1, 3)


def _close(points: Array) -> tuple[IntArray, IntArray]:
    """All pairs of points (n, 4) within `WELD` of each other, body numbers counting as metres.

    They are looked for along a line askew to everything that people build, where few points that
    are apart come together.
    """
    along = points[:, 1:] @ ASKEW
    order = np.argsort(along, kind="stable")
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for shift in range(1, len(points)):
        near = np.flatnonzero(along[order[shift:]] - along[order[:-shift]] < WELD)
        if not len(near):
            break
        i, j = order[near], order[near + shift]
        here = np.linalg.norm(points[i] - points[j], axis=1) < WELD
        pairs.append(np.column_stack([i, j])[here])
    first, second = np.concatenate(pairs).T
    return first, second


def _groups(n: int, i: IntArray, j: IntArray) -> IntArray:
    """Number (n,) of the group that each of n items is in, where i[k] and j[k] are linked."""
    lowest = np.arange(n)  # of the group, as far as known
    while (lowest[i] != lowest[j]).any():
        low = np.minimum(lowest[i], lowest[j])
        np.minimum.at(lowest, lowest[i], low)
        np.minimum.at(lowest, lowest[j], low)
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
    return np.unique(lowest, return_inverse=True)[1].astype(np.int64)


def _edges(vertex: IntArray) -> IntArray:
    ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2)
    numbers = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)[1]
    return np.asarray(numbers.reshape(-1, 3), dtype=np.int64)


def _patches(edge: IntArray, normals: Array, wall: IntArray) -> IntArray:
    """Number of the flat patch of each triangle (k,)."""
    order = np.argsort(edge.ravel(), kind="stable")
    number, triangle = edge.ravel()[order], order // 3
    i, j = triangle[:-1], triangle[1:]
    flat = (
        (number[:-1] == number[1:])
        & (wall[i] == wall[j])
        & (np.linalg.norm(np.cross(normals[i], normals[j]), axis=1) < COPLANAR)
    )
    return _groups(len(edge), i[flat], j[flat])


def _within_a_patch(edge: IntArray, inward: Array, patch: IntArray) -> BoolArray:
    """Whether a flat patch goes on across an edge (k, 3): there it is part of the face."""
    number = edge.ravel()
    of = np.repeat(patch, 3)
    low, high = (
        np.full(number.max(initial=-1) + 1, len(patch)),
        np.zeros(number.max(initial=-1) + 1),
    )
    np.minimum.at(low, number, of)
    np.maximum.at(high, number, of)
    total = np.zeros((len(low), 3))
    np.add.at(total, number, inward.reshape(-1, 3))
    both_sides = np.linalg.norm(total, axis=1) < 1e-3
    return np.asarray(((low == high) & both_sides)[edge])


def _answers(number: IntArray) -> BoolArray:
    """Whether a triangle is the first that has this edge or vertex (k, 3)."""
    first = np.zeros(number.size, dtype=bool)
    first[np.unique(number.ravel(), return_index=True)[1]] = True
    return first.reshape(number.shape)


def _inward(corners: Array, normals: Array) -> Array:
    """Unit vectors (k, 3, 1, 3) in each triangle, from each edge, square to it."""
    along = np.roll(corners, -1, axis=1) - corners
    inward = np.cross(normals[:, None], along)
    return np.asarray(inward / np.linalg.norm(inward, axis=2, keepdims=True))[:, :, None]


def _along(corners: Array) -> Array:
    """Unit vectors (k, 3, 2, 3) from each corner along the two edges of its triangle."""
    out = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    both = np.stack([out, back], axis=2)
    return np.asarray(both / np.linalg.norm(both, axis=3, keepdims=True))


def _fans(number: IntArray, vectors: Array, per_item: int = 1) -> tuple[Array, IntArray, IntArray]:
    """Collect the vectors of all triangles that share an edge or corner.

    Returns:
        directions (m, 3), and for each triangle's edge or corner the range of its own.
    """
    order = np.argsort(number.ravel(), kind="stable")
    directions = vectors.reshape(-1, per_item, 3)[order].reshape(-1, 3)
    counts = np.bincount(number.ravel()) * per_item
    last = np.cumsum(counts)
    first = last - counts
    return directions, first[number].astype(np.int64), last[number].astype(np.int64)


def build_grid(surface: Surface, bodies: int, reach: float) -> Grid:
    """For points within `reach` [m] of a triangle, find it by the cell of the point."""
    t = surface.triangles
    corners = np.stack([t[:, :3], t[:, :3] + t[:, 3:6], t[:, :3] + t[:, 6:9]], axis=1)
    cell, low, shape = np.ones(bodies), np.zeros((bodies, 3)), np.ones((bodies, 3), dtype=np.int64)
    starts, items, first_cell = [], [], np.zeros(bodies, dtype=np.int64)
    cells = entries = 0
    for b in range(bodies):
        mine = np.flatnonzero(surface.body == b)
        if len(mine):
            points = corners[mine].reshape(-1, 3)
            low[b] = points.min(axis=0) - reach
            extent = points.max(axis=0) + reach - low[b]
            cell[b] = max(1.5 * reach, (extent.prod() / LARGEST_GRID) ** (1 / 3))
            shape[b] = np.ceil(extent / cell[b]).astype(np.int64)
        counts, found = _cells_of(
            corners[mine], surface.normals[mine], low[b], cell[b], shape[b], reach
        )
        starts.append(entries + np.cumsum(counts) - counts)
        items.append(mine[found])
        first_cell[b] = cells
        cells += len(counts)
        entries += len(found)
    start = np.concatenate([*starts, [entries]]).astype(np.int64)
    return Grid(reach, cell, low, shape, first_cell, start, np.concatenate(items).astype(np.int64))


def _cells_of(
    corners: Array, normals: Array, low: Array, cell: float, shape: IntArray, reach: float
) -> tuple[IntArray, IntArray]:
    """Count of triangles per cell (c,), and their numbers sorted by cell."""
    cells, owners = [], []
    half_diagonal = 0.5 * cell * np.sqrt(3.0)
    for i, corner in enumerate(corners):
        first = np.floor((corner.min(axis=0) - reach - low) / cell).astype(int).clip(0)
        last = np.floor((corner.max(axis=0) + reach - low) / cell).astype(int)
        last = np.minimum(last, shape - 1)
        axes = [np.arange(f, e + 1) for f, e in zip(first, last, strict=True)]
        x, y, z = np.meshgrid(*axes, indexing="ij")
        centres = low + cell * (np.stack([x, y, z], axis=-1) + 0.5)
        near = np.abs((centres - corner[0]) @ normals[i]) <= reach + half_diagonal
        number = ((x * shape[1] + y) * shape[2] + z)[near]
        cells.append(number)
        owners.append(np.full(len(number), i))
    total = int(shape.prod())
    if not cells:
        return np.zeros(total, dtype=np.int64), np.empty(0, dtype=np.int64)
    number, owner = np.concatenate(cells), np.concatenate(owners)
    order = np.argsort(number, kind="stable")
    return np.bincount(number, minlength=total), owner[order]
