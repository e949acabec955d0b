"""Contacts of the compiled engine with triangle meshes: one surface, however it is cut."""

import math

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    LEVEL,
    YOUNG,
    G,
    R,
    Start,
    fan,
    forces_at,
    material,
    mesh,
    moved,
    plane,
    ridge,
    scene,
    shattered,
    spheres_in_line,
    still,
    trough,
    wall_stiffness,
)
from fidelity.engine import ContactLaw, Movement, Physics, Wall
from mfopt.arrays import Array

OVERLAP = 0.02 * R
APART = 3 * R  # spheres that must not feel each other


def tumbling(floor: Wall, law: ContactLaw = "linear") -> Movement:
    """A clump that lands turning, then rolls and slides, and a sphere that rolls."""
    physics = Physics(contact_law=law, restitution=0.7, damping=0.0, gravity=G)
    clump = Start((-0.05, 0.01, 2.5 * R), (0.8, 0.2, 0.5, 0.1), (0.5, 0.05, -0.3), (5.0, 20.0, 9.0))
    grain = spheres_in_line(3)
    return moved(scene(grain, [clump], floor, physics=physics, duration=0.25, friction=0.5))


@pytest.mark.parametrize("law", ["linear", "hertz"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_plane_in_random_triangles_is_the_same_plane(law: ContactLaw, seed: int) -> None:
    whole = tumbling(plane(friction=0.5, half=0.3), law)
    cut = tumbling(mesh(*shattered(seed, 400, 0.3), friction=0.5), law)
    assert whole.max_overlap > 1e-3
    # Rounding in the nearest points is 1e-16 of a position, and grows as the clump tumbles.
    assert cut.positions == pytest.approx(whole.positions, abs=1e-9)
    assert cut.orientations == pytest.approx(whole.orientations, abs=1e-7)


@pytest.mark.parametrize("triangles", [6, 20])
def test_a_sphere_that_rolls_over_the_middle_of_a_fan_notices_nothing(triangles: int) -> None:
    def end(floor: Wall) -> Movement:
        overlap = spheres_in_line(1).mass * G / wall_stiffness()
        spin = (0.0, 0.2 / R, 0.0)
        start = Start((-0.02, 0.0, R - overlap), LEVEL, (0.2, 0.0, 0.0), spin)
        physics = still(gravity=G, restitution=0.5)
        grain = spheres_in_line(1)
        return moved(scene(grain, [start], floor, physics=physics, duration=0.2, friction=0.5))

    whole = end(plane(friction=0.5, half=0.3))
    over = end(mesh(*fan(triangles, 0.3), friction=0.5))
    assert over.positions[0, 0] > 0.015
    assert over.positions == pytest.approx(whole.positions, abs=1e-12)
    assert over.angular_velocities == pytest.approx(whole.angular_velocities, abs=1e-9)


@pytest.mark.parametrize("triangles", [6, 20])
def test_on_the_middle_of_a_fan_the_force_is_that_of_one_contact(triangles: int) -> None:
    force = forces_at(np.array([[0.0, 0.0, R - OVERLAP]]), mesh(*fan(triangles, 0.1)))
    assert force[0] == pytest.approx([0.0, 0.0, wall_stiffness() * OVERLAP], rel=1e-9, abs=1e-9)


def test_a_seam_between_two_walls_is_part_of_the_surface() -> None:
    # Coplanar triangles of two walls: never two contacts, never none.
    left = np.array([[-0.2, -1, 0], [0, -1, 0], [0, 1, 0], [-0.2, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    walls = (
        Wall("left", left, faces, material()),
        Wall("right", left + np.array([0.2, 0, 0]), faces, material()),
    )
    x = np.concatenate([np.linspace(-1.5 * R, 1.5 * R, 61), [-1e-13, 1e-13, -1e-10, 1e-10]])
    centres = np.column_stack([x, APART * (np.arange(len(x)) - 32), np.full(len(x), R - OVERLAP)])
    force = forces_at(centres, *walls)
    expected = np.tile([0.0, 0.0, wall_stiffness() * OVERLAP], (len(x), 1))
    assert force == pytest.approx(expected, rel=1e-9, abs=1e-9)


def crossing(angle: float, samples: int, law: ContactLaw = "linear") -> tuple[Array, Array]:
    """Overlap with the nearer flank and force, as a sphere is led level over an edge.

    Args:
        angle: that each flank falls away from the edge [rad]; below 0 it is a valley.
        samples: places on the way.
        law: of the contact.
    """
    x = np.linspace(-R, R, samples)
    span = APART * (samples + 1)
    if angle > 0.0:  # on the edge the sphere touches its line, beside it a flank
        z = R - OVERLAP
        nearest = np.where(
            np.abs(x) < z * math.tan(angle),
            np.hypot(x, z),
            np.abs(x) * math.sin(angle) + z * math.cos(angle),
        )
    else:
        z = (R - OVERLAP) / math.cos(angle)
        nearest = z * math.cos(angle) - np.abs(x) * math.sin(-angle)
    centres = np.column_stack([x, APART * (1 + np.arange(samples)), np.full(samples, z)])
    force = forces_at(centres, mesh(*ridge(angle, span)), physics=still(contact_law=law))
    return R - nearest, force


@pytest.mark.parametrize("degrees", [5.0, 15.0, 45.0])
def test_over_a_convex_edge_the_force_is_that_of_the_nearest_point(degrees: float) -> None:
    overlap, force = crossing(math.radians(degrees), 201)
    size = np.linalg.norm(force, axis=1)
    assert size == pytest.approx(wall_stiffness() * np.maximum(overlap, 0.0), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("law", ["linear", "hertz"])
@pytest.mark.parametrize("degrees", [2.0, 5.0, 7.5])
def test_in_a_shallow_valley_two_contacts_stand_for_one(law: ContactLaw, degrees: float) -> None:
    # Flanks within 15 degrees share the stiffness: never more than the force of one contact.
    overlap, force = crossing(-math.radians(degrees), 401, law)
    size = np.linalg.norm(force, axis=1)
    if law == "linear":
        alone = wall_stiffness() * overlap
    else:
        modulus = YOUNG / (2 * (1 - 0.3**2))
        alone = 4 / 3 * modulus * math.sqrt(R) * overlap**1.5
    assert (size <= alone * (1 + 1e-9)).all()
    assert (size > 0.7 * alone).all()


def test_in_a_right_angled_corner_both_walls_push_with_their_full_force() -> None:
    overlap, force = crossing(-math.radians(45), 3)
    full = wall_stiffness() * overlap[1]  # of each flank, at 45 degrees to the vertical
    assert force[1] == pytest.approx([0.0, 0.0, math.sqrt(2) * full], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("degrees", [45.0, 15.0, -10.0, -15.0, -20.0, -30.0, -45.0])
def test_the_force_over_an_edge_is_continuous(degrees: float) -> None:
    # Four times as many places: the largest step of the force is a quarter.
    steps = []
    for samples in (401, 1601):
        _, force = crossing(math.radians(degrees), samples)
        steps.append(np.linalg.norm(np.diff(force, axis=0), axis=1).max())
    assert steps[0] / steps[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("degrees", [1.0, 2.5, 4.0, 5.0])
def test_in_a_valley_shallower_than_the_contact_the_force_jumps_by_little(degrees: float) -> None:
    # Where the foot of the further flank's contact reaches the edge, that contact ends with the
    # overlap b and the weight w = b^4 / (a^4 + b^4), a that of the nearer flank: the force jumps
    # by k w |b n_b - a n_a|.
    angle = math.radians(degrees)
    rise = (R - OVERLAP) * math.tan(angle) ** 2
    a, b = OVERLAP + rise, OVERLAP - rise
    weight = b**4 / (a**4 + b**4)
    expected = weight * math.hypot((a + b) * math.sin(angle), (a - b) * math.cos(angle))
    _, force = crossing(-angle, 4001)
    steps = np.sort(np.linalg.norm(np.diff(force, axis=0), axis=1)) / wall_stiffness()
    assert steps[-1] == pytest.approx(expected, abs=1.5 * steps[-5])  # on both sides of the edge
    assert steps[-1] < 0.07 * a


def rocking_time(facets: int) -> float:
    """Time [s] in which a sphere that rolls in a trough swings from one side to the other."""
    radius = 12 * R
    way = radius - R
    angle = 0.2
    overlap = spheres_in_line(1).mass * G / wall_stiffness()
    place = (way + overlap) * np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    physics = still(gravity=G, restitution=0.3)
    times = np.arange(0.15, 0.4, 1e-3)
    setup = scene(
        spheres_in_line(1),
        [Start(place)],
        mesh(*trough(facets, radius), friction=1.0),
        physics=physics,
        duration=0.41,
        friction=1.0,
        snapshots=times,
    )
    movement = moved(setup, share=0.2)
    x = movement.snapshots["snapshot_positions"][:, 0, 0]
    at = movement.snapshots["snapshot_times"]
    turn = int(np.argmax(x))
    curve = np.polyfit(at[turn - 25 : turn + 26] - at[turn], x[turn - 25 : turn + 26], 2)
    return float(at[turn] - curve[1] / (2 * curve[0]))


def test_a_sphere_rolls_in_a_faceted_trough_as_in_a_round_one() -> None:
    # w^2 = g / (way (1 + I / (m R^2))), longer by angle^2 / 16 for the amplitude.
    expected = math.pi * math.sqrt(11 * R * 7 / 5 / G) * (1 + 0.2**2 / 16)
    errors = [abs(rocking_time(facets) / expected - 1) for facets in (45, 135, 405)]
    assert errors[-1] < 0.01
    assert errors[-1] < errors[0]


def test_a_sphere_in_the_corner_of_a_box_touches_each_wall_once() -> None:
    side = 0.1
    corners = np.array(
        [[0, 0, 0], [side, 0, 0], [side, side, 0], [0, side, 0], [0, 0, side], [side, 0, side],
         [0, side, side]]
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 5], [0, 5, 4], [0, 3, 6], [0, 6, 4]])
    force = forces_at(np.full((1, 3), R - OVERLAP), mesh(corners, faces))
    assert force[0] == pytest.approx(np.full(3, wall_stiffness() * OVERLAP), rel=1e-9)


def test_where_a_mesh_does_not_fit_together_the_force_stays_that_of_one_contact() -> None:
    # A long edge on one side, two short ones on the other: their middle vertex is a T-junction.
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-0.1, 0.5, 0], [0, 0.5, 0], [0.1, 0.5, 0]], float)
    faces = np.array([[0, 1, 2], [0, 4, 3], [3, 4, 1]])
    centres = np.array([[x, 0.5 + y, R - OVERLAP] for x in (-1e-5, 0.0, 1e-5) for y in (0.0, 1e-5)])
    for centre in centres:
        force = forces_at(centre[None], mesh(vertices, faces))
        assert force[0] == pytest.approx([0, 0, wall_stiffness() * OVERLAP], rel=0.01, abs=0.02)
