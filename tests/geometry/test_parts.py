"""Meshes of cup, plate, hopper and tube."""

import numpy as np
import pytest
import trimesh
from hopper_designs import CURVED, HEIGHTS, HOLE, TOUCHING, TUBE, TUBE_END, drawn, prism, straight

from geometry.loft import Loft, check_loft
from geometry.mesh import Mesh
from geometry.parts import Cup, cup_wall, passage, plate_with_hole
from geometry.rings import ring
from geometry.sections import Section
from mesh_checks import (
    DEGENERATE,
    capped,
    chordal_error,
    distances,
    merged,
    open_edges,
    quality,
    smallest_quality,
    volume,
)
from mfopt.arrays import Array
from mfopt.errors import ConfigError, InvalidDesign

CUP = Cup(Section(0.13, 0.1, 0.02, 0.0), 1.279e-3)


@pytest.mark.parametrize("error", [0.0005, 0.001, 0.0015])
def test_cup_holds_its_volume(error: float) -> None:
    cavity = capped(cup_wall(CUP, error))
    assert CUP.section.area * CUP.height == pytest.approx(1.279e-3)
    assert volume(cavity) == pytest.approx(1.279e-3, rel=0.005)
    assert volume(cavity) < 1.279e-3  # inscribed
    assert len(open_edges(cavity)) == 0
    assert smallest_quality(cavity) > DEGENERATE


def test_cup_wall_is_open_at_both_ends_and_can_be_made_higher() -> None:
    wall = cup_wall(CUP, 0.001, height=0.3)
    rims = wall.vertices[np.unique(open_edges(wall)), 2]
    assert set(rims) == {0.0, 0.3}
    assert np.all(outward_of_axis(wall))


@pytest.mark.parametrize("error", [0.0005, 0.001, 0.0015])
@pytest.mark.parametrize("loft", [CURVED, TOUCHING, straight(), prism(TUBE)])
def test_passage_keeps_its_chordal_error(loft: Loft, error: float) -> None:
    mesh = passage(loft, TUBE_END, error)
    reached = chordal_error(mesh, loft)
    assert 0.2 * error < reached <= error


def test_every_vertex_lies_on_the_exact_surface() -> None:
    mesh = passage(CURVED, TUBE_END, 0.001)
    assert np.abs(distances(mesh.vertices, CURVED)).max() < 1e-12


def test_measured_error_sees_a_dent() -> None:
    mesh = passage(straight(), TUBE_END, 0.001)
    dented = mesh.vertices.copy()
    dented[0, 0] -= 0.004
    assert chordal_error(Mesh(dented, mesh.triangles), straight()) == pytest.approx(0.004, rel=0.1)


def test_sections_equal_to_the_tube_give_exactly_a_prism() -> None:
    mesh = capped(passage(prism(TUBE), TUBE_END, 0.001))
    base = ring(TUBE, 0.0, 0.001).points[:, :2]
    for z in np.unique(mesh.vertices[:, 2]):
        assert np.array_equal(mesh.vertices[mesh.vertices[:, 2] == z, :2], base)
    x, y = base.T
    area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2
    assert volume(mesh) == pytest.approx(0.56 * area, rel=1e-12)


def test_volume_converges_to_the_integral_of_the_section() -> None:
    z = np.linspace(-0.26, 0.0, 2001)
    areas = np.array([CURVED.section(height).area for height in z])
    exact = np.trapezoid(areas, z) + 0.3 * TUBE.area
    errors = [
        abs(volume(capped(passage(CURVED, TUBE_END, e))) / exact - 1) for e in (2e-3, 5e-4, 1e-4)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.001


def test_straight_hopper_needs_few_triangles() -> None:
    # Only the corners are curved: one span for the hopper, one for the tube.
    assert len(passage(straight(), TUBE_END, 0.001).triangles) <= 100


def test_five_hundred_random_designs_are_watertight_or_named_invalid() -> None:
    rng = np.random.default_rng(20240507)
    valid, named = 0, True
    for _ in range(500):
        loft = drawn(rng)
        try:
            closed = capped(passage(loft, TUBE_END, 0.001))
        except InvalidDesign as error:
            named = named and ("radius" in str(error) or "flat part" in str(error))
            continue
        valid += 1
        assert smallest_quality(closed) > DEGENERATE
        solid = trimesh.Trimesh(closed.vertices, closed.triangles, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert volume(closed) == pytest.approx(solid.volume)
        assert volume(closed) > 0
    assert named
    assert 350 < valid < 450  # about a quarter asks for too large a radius


@pytest.mark.parametrize("loft", [CURVED, TOUCHING, straight()])
def test_plate_and_passage_join_without_an_inner_open_edge(loft: Loft) -> None:
    plate = plate_with_hole(loft.sections[0], 0.8, 0.3, 0.001)
    joined = merged([plate, passage(loft, TUBE_END, 0.001)])
    rims = joined.vertices[open_edges(joined)].mean(axis=1)
    at_plate_edge = (np.abs(rims[:, 0]) > 0.399) | (np.abs(rims[:, 1]) > 0.149)
    assert np.all(at_plate_edge | (rims[:, 2] == TUBE_END))
    solid = trimesh.Trimesh(joined.vertices, joined.triangles, process=False)
    assert solid.is_winding_consistent
    assert smallest_quality(plate) > DEGENERATE


def test_plate_is_one_sheet_with_the_area_around_the_hole() -> None:
    hole = Section(0.15, 0.115, 0.025, 0.02)
    plate = plate_with_hole(hole, 0.8, 0.3, 0.0001)
    a, b, c = np.moveaxis(plate.vertices[plate.triangles], 1, 0)
    facing = np.cross(b - a, c - a)[:, 2] / 2
    assert np.all(facing < 0)  # down, out of the grains' space
    assert -facing.sum() == pytest.approx(0.8 * 0.3 - hole.area, rel=1e-4)


def test_closing_sides_leave_no_thin_triangles() -> None:
    # A flat part of some hundredths of a millimetre would give needles.
    for flat in (0.0, 1e-9, 1e-5, 2e-4, 4e-4, 1e-3):
        nearly = Section(0.08 + flat, 0.08, 0.04, 0.0)
        mesh = capped(passage(prism(nearly), TUBE_END, 0.001))
        assert quality(mesh).min() > DEGENERATE
        assert len(open_edges(mesh)) == 0
        assert chordal_error(passage(prism(nearly), TUBE_END, 0.001), prism(nearly)) <= 0.001


def test_impossible_parts_are_named() -> None:
    with pytest.raises(InvalidDesign, match=r"tube end z = -200 mm must lie below .* -260 mm"):
        passage(CURVED, -0.2, 0.001)
    with pytest.raises(InvalidDesign, match="plate length = 140 mm must exceed 150 mm"):
        plate_with_hole(HOLE, 0.14, 0.3, 0.001)
    with pytest.raises(ConfigError, match="chordal_error = 0 m must lie between"):
        passage(CURVED, TUBE_END, 0.0)
    with pytest.raises(InvalidDesign, match="cup height"):
        cup_wall(Cup(CUP.section, -1.0), 0.001)


def test_invalid_loft_is_never_meshed() -> None:
    with pytest.raises(InvalidDesign, match="pinched"):
        passage(Loft(HEIGHTS, (HOLE, *(Section(0.12, 0.06, 0.03, 0.0),) * 2, TUBE)), -0.56, 0.001)
    check_loft(CURVED)


def outward_of_axis(mesh: Mesh) -> Array:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return np.sum(np.cross(b - a, c - a)[:, :2] * (a + b + c)[:, :2], axis=1) > 0
