"""The renderer: areas, hidden surfaces, parallel projection."""

import math

import numpy as np
import pytest

from mfopt.arrays import Array
from reports import raster

FRONT = raster.axes_from(0.0, 0.0)
RED, BLUE = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])


def square_view() -> raster.View:
    return raster.View(FRONT, -1.0, 1.0, -1.0, 1.0, 30.0)


def covered(picture: raster.Picture, view: raster.View) -> float:
    """Area [m2] of what has been drawn."""
    return float(np.isfinite(picture.near).sum()) / view.scale**2


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (0.6, 0.3), (-2.0, 1.2)])
def test_axes_are_orthonormal_and_right_handed(azimuth: float, elevation: float) -> None:
    axes = raster.axes_from(azimuth, elevation)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[1, 2] >= 0.0  # up stays up


def test_a_sphere_covers_its_disc_and_is_nearest_in_its_middle() -> None:
    view = square_view()
    picture = raster.draw_spheres(
        raster.blank(view), view, np.zeros((1, 3)), np.array([0.5]), RED
    )  # fmt: skip
    assert covered(picture, view) == pytest.approx(math.pi * 0.25, rel=5e-3)
    assert picture.near.max() / view.scale == pytest.approx(0.5, rel=5e-3)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_nearer_sphere_hides_the_farther_in_whatever_order(order: list[int]) -> None:
    view = square_view()
    centres = np.array([[0.0, -0.6, 0.0], [0.0, 0.6, 0.0]])  # the viewer stands at -y
    colours = np.concatenate((RED, BLUE))
    picture = raster.draw_spheres(
        raster.blank(view), view, centres[order], np.array([0.3, 0.3]), colours[order]
    )
    middle = picture.colour[view.shape[0] // 2, view.shape[1] // 2]
    assert middle[0] > 0.5
    assert middle[2] == 0.0


def test_a_triangle_covers_its_area_seen_from_either_side() -> None:
    view = square_view()
    vertices = np.array([[-0.8, 0.0, -0.7], [0.9, 0.3, -0.2], [0.1, -0.4, 0.8]])
    area = 0.5 * abs(1.7 * 1.5 - 0.5 * 0.9)  # of its shadow on x, z
    pictures = [
        raster.draw_mesh(raster.blank(view), view, vertices, np.array([t]), (1.0, 1.0, 1.0))
        for t in ([0, 1, 2], [0, 2, 1])
    ]
    assert covered(pictures[0], view) == pytest.approx(area, rel=1e-2)
    np.testing.assert_allclose(pictures[0].colour, pictures[1].colour, atol=1e-6)


def test_neighbouring_triangles_leave_no_gap() -> None:
    view = square_view()
    vertices = np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    picture = raster.draw_mesh(raster.blank(view), view, vertices, triangles, (1.0, 0.0, 0.0))
    assert covered(picture, view) == pytest.approx(1.0, rel=2e-2)
    half = view.shape[0] // 4
    assert np.isfinite(picture.near[half + 2 : -half - 2, half + 2 : -half - 2]).all()


def test_depth_within_a_triangle_is_linear() -> None:
    view = square_view()
    vertices = np.array([[-1.0, 0.5, -1.0], [1.0, -0.5, -1.0], [1.0, -0.5, 1.0]])
    picture = raster.draw_mesh(
        raster.blank(view), view, vertices, np.array([[0, 1, 2]]), (1.0, 1.0, 1.0)
    )
    rows, columns = np.nonzero(np.isfinite(picture.near))
    expected = 0.5 * ((columns + 0.5) / view.scale - 1.0)  # nearness is -y = x / 2
    np.testing.assert_allclose(picture.near[rows, columns] / view.scale, expected, atol=1e-5)


def test_a_translucent_sheet_mixes_with_what_is_behind_and_not_with_what_is_before() -> None:
    view = square_view()
    sheet = np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])

    def middle(y: float) -> Array:
        picture = raster.draw_spheres(
            raster.blank(view), view, np.array([[0.0, y, 0.0]]), np.array([0.2]), RED
        )
        before = picture.colour[view.shape[0] // 2, view.shape[1] // 2].copy()
        drawn = raster.draw_mesh(picture, view, sheet, triangles, (0.0, 0.0, 1.0), opacity=0.5)
        after = drawn.colour[view.shape[0] // 2, view.shape[1] // 2]
        return np.asarray(after - before)

    np.testing.assert_array_equal(middle(-0.5), 0.0)
    assert middle(0.5)[2] > 0.2


def test_a_drawing_leaves_the_picture_given_untouched() -> None:
    view = square_view()
    empty = raster.blank(view)
    raster.draw_spheres(empty, view, np.zeros((1, 3)), np.array([0.5]), RED)
    assert (empty.colour == 1.0).all()
    assert not np.isfinite(empty.near).any()


def test_a_window_holds_every_point() -> None:
    axes = raster.axes_from(0.5, 0.3)
    points = np.random.default_rng(1).normal(size=(50, 3))
    view = raster.window(axes, points, height_px=300)
    seen = view.project(points)
    assert (seen[:, :2] >= 0.0).all()
    assert (seen[:, 0] <= view.shape[1]).all()
    assert (seen[:, 1] <= view.shape[0]).all()
    assert raster.finish(raster.blank(view)).shape[0] == 300
