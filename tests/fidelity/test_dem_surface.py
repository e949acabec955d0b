"""Walls prepared for contact: flat patches, edges, corners, and which triangles are near."""

import numpy as np
import pytest

from benchmarks.engine.small_scenes import fan, material, mesh, plane, shattered, trough
from fidelity.dem.surface import Surface, bodies_of, build_grid, build_surface
from fidelity.engine import Wall, WallMotion
from mfopt.arrays import Array, IntArray


def surface_of(*walls: Wall) -> Surface:
    return build_surface(walls, bodies_of(walls)[1])


def cube(cuts: int = 1) -> tuple[Array, IntArray]:
    """A unit cube, each side in 2 cuts^2 triangles."""
    vertices: list[Array] = []
    faces: list[list[int]] = []
    ticks = np.linspace(0.0, 1.0, cuts + 1)
    for axis in range(3):
        for end in (0.0, 1.0):
            base = len(vertices)
            for u in ticks:
                for v in ticks:
                    vertices.append(np.roll([end, u, v], axis))
            for i in range(cuts):
                for j in range(cuts):
                    a = base + i * (cuts + 1) + j
                    faces += [[a, a + 1, a + cuts + 2], [a, a + cuts + 2, a + cuts + 1]]
    return np.array(vertices), np.array(faces)


def own(keys: IntArray, faces: IntArray) -> set[int]:
    """Keys of edges or corners that are not part of a flat patch."""
    return set(keys[keys >= 0].tolist()) - set(faces.tolist())


@pytest.mark.parametrize("cuts", [1, 3])
def test_a_cube_has_six_faces_twelve_edges_and_eight_corners(cuts: int) -> None:
    # However finely its sides are cut: each edge then has so many pieces, with corners between.
    surface = surface_of(mesh(*cube(cuts)))
    assert len(set(surface.face_keys.tolist())) == 6
    assert len(own(surface.edge_keys, surface.face_keys)) == 12 * cuts
    assert len(own(surface.corner_keys, surface.face_keys)) == 8 + 12 * (cuts - 1)


def test_keys_of_faces_edges_and_corners_differ() -> None:
    surface = surface_of(mesh(*cube(2)))
    faces = set(surface.face_keys.tolist())
    edges = own(surface.edge_keys, surface.face_keys)
    assert not edges & own(surface.corner_keys, surface.face_keys)
    assert not edges & faces


@pytest.mark.parametrize("meshed", [fan(6, 0.1), fan(20, 0.1), shattered(4, 200, 0.1)])
def test_a_plane_is_one_patch_and_its_inner_edges_are_part_of_it(
    meshed: tuple[Array, IntArray],
) -> None:
    vertices, faces = meshed
    surface = surface_of(mesh(vertices, faces))
    assert len(set(surface.face_keys.tolist())) == 1
    edges = np.sort(np.concatenate([faces, np.roll(faces, -1, axis=1)], axis=0).reshape(2, -1).T)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    rim = int((counts == 1).sum())
    assert len(own(surface.edge_keys, surface.face_keys)) == rim
    assert len(own(surface.corner_keys, surface.face_keys)) == rim


def test_only_one_triangle_answers_for_an_edge() -> None:
    surface = surface_of(mesh(*trough(9, 0.1)))
    keys = surface.edge_keys[surface.edge_keys >= 0]
    outside = keys[~np.isin(keys, surface.face_keys)]
    assert len(outside) == len(set(outside.tolist()))


def test_a_step_of_a_trough_ends_a_patch() -> None:
    surface = surface_of(mesh(*trough(30, 0.1)))
    assert len(set(surface.face_keys.tolist())) == 30


@pytest.mark.parametrize("gap", [0.0, 1e-12, 5e-8])
@pytest.mark.parametrize("at", [0.0, 0.0123456, 0.01234565])
def test_walls_that_meet_are_welded_wherever_they_are(gap: float, at: float) -> None:
    corners = np.array([[at - 0.1, 0, 0], [at, 0, 0], [at, 1, 0], [at - 0.1, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    walls = (
        Wall("left", corners, faces, material()),
        Wall("right", corners + np.array([0.1 + gap, 0, 0]), faces, material()),
    )
    surface = surface_of(*walls)
    seam = surface.edge_last - surface.edge_first == 2
    # The diagonal of each square, and the edge that both share, seen from both sides.
    assert seam.sum() == 6
    assert len(set(surface.face_keys.tolist())) == 2  # materials may differ


def test_walls_of_different_motion_are_not_welded() -> None:
    still = WallMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
    surface = surface_of(plane(), plane(motion=still))
    assert set(surface.body.tolist()) == {0, 1}
    assert (surface.edge_last - surface.edge_first <= 2).all()


def test_triangles_without_an_area_are_left_out() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [2, 0, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 0, 2], [1, 3, 4]])
    surface = surface_of(mesh(vertices, faces))
    assert len(surface.normals) == 1
    assert np.isfinite(surface.normals).all()


def test_no_walls_make_an_empty_surface() -> None:
    surface = surface_of()
    grid = build_grid(surface, 1, 0.01)
    assert len(surface.normals) == 0
    assert len(grid.items) == 0


@pytest.mark.parametrize("meshed", [cube(2), trough(12, 0.3), shattered(7, 50, 0.3)])
def test_the_grid_finds_every_triangle_within_reach(meshed: tuple[Array, IntArray]) -> None:
    vertices, faces = meshed
    reach = 0.05
    surface = surface_of(mesh(vertices, faces))
    grid = build_grid(surface, 1, reach)
    rng = np.random.default_rng(2)
    for point in rng.uniform(vertices.min(axis=0) - reach, vertices.max(axis=0) + reach, (300, 3)):
        cell = np.floor((point - grid.low[0]) / grid.cell[0]).astype(int)
        found: set[int] = set()
        if ((cell >= 0) & (cell < grid.shape[0])).all():
            number = (cell[0] * grid.shape[0, 1] + cell[1]) * grid.shape[0, 2] + cell[2]
            found = set(grid.items[grid.start[number] : grid.start[number + 1]].tolist())
        weights = rng.dirichlet(np.ones(3), size=200)
        for k, corners in enumerate(vertices[faces]):
            if np.linalg.norm(weights @ corners - point, axis=1).min() < reach:
                assert k in found
