"""Grains put loosely into a tall vessel, and whether a settled packing can be trusted.

The grains lie in horizontal layers with random headings, placed one by one where they touch
no other grain of the layer (random sequential addition). That fills the vessel far denser than a
lattice of freely turning grains would, so they settle within a short fall.
"""

import numpy as np

from fidelity.engine import Grain, Packing, sizes
from geometry.sections import Section
from mfopt.arrays import Array, frozen
from mfopt.errors import SimulationError
from mfopt.rotation import rotate

CLEARANCE = 1.02  # times the grain width between layers, and between grains of one layer
TRIES_IN_VAIN = 100  # in a row, then the layer is full: fills about half of its area
HOPELESS = 5000  # tries for the first grain of a layer
BATCH = 32  # candidates drawn at a time
# A portion at rest overlaps by about its weight over its stiffness: 800 Pa against 1e5 Pa for
# the softest grains that make sense. Meshes of rounded corners add their chordal error.
MOST_OVERLAP = 0.3  # [sphere radii]


def loose_portion(
    grain: Grain, section: Section, grains: int, seed: int, *, chordal_error: float
) -> Packing:
    """Put `grains` grains in layers into a vessel of that section, from z = 0 up, without overlap.

    `chordal_error` [m] is how far the vessel's mesh may lie within its exact section.

    Raises:
        SimulationError: if the grain is too long for the vessel.
    """
    rng = np.random.default_rng(seed)
    spacing = CLEARANCE * 2 * float(grain.radii.max())
    layers: list[Array] = []
    missing = grains
    while missing:
        layer = _layer(grain, section, missing, chordal_error, rng)
        layers.append(np.column_stack([layer, np.full(len(layer), (len(layers) + 0.5) * spacing)]))
        missing -= len(layer)
    placed = np.concatenate(layers)  # (n, 4): x, y, heading, z
    heading = placed[:, 2]
    zeros = np.zeros_like(heading)
    return Packing(
        positions=frozen(placed[:, [0, 1, 3]]),
        orientations=frozen(
            np.column_stack([np.cos(heading / 2), zeros, zeros, np.sin(heading / 2)])
        ),
    )


def _layer(
    grain: Grain, section: Section, most: int, clearance: float, rng: np.random.Generator
) -> Array:
    """Random sequential addition of lying grains: x, y and heading of each (m, 3)."""
    along, radius = grain.offsets[:, 0], float(grain.radii.max())
    spacing = CLEARANCE * 2 * radius
    half = np.array([section.length, section.width]) / 2 - radius
    placed: list[Array] = []
    spheres = np.empty((0, 2))
    in_vain = 0
    fits_at_all = bool(np.all(half > 0.0))
    while fits_at_all and len(placed) < most and in_vain < (TRIES_IN_VAIN if placed else HOPELESS):
        middles = rng.uniform(-half, half, (BATCH, 2))
        headings = rng.uniform(0.0, np.pi, BATCH)
        axes = np.column_stack([np.cos(headings), np.sin(headings)])
        centres = middles[:, None] + along[:, None] * axes[:, None]  # (BATCH, k, 2)
        fits = np.all(depth_in_section(section, centres) >= radius + clearance, axis=1)
        for candidate in range(BATCH):
            if fits[candidate] and not _near(centres[candidate], spheres, spacing):
                placed.append(np.append(middles[candidate], headings[candidate]))
                spheres = np.concatenate([spheres, centres[candidate]])
                in_vain = 0
            else:
                in_vain += 1
            if len(placed) == most:
                break
    if not placed:
        raise SimulationError(
            f"a grain of {1e3 * (np.ptp(along) + 2 * radius):.0f} mm does not fit into the vessel "
            f"of {1e3 * section.length:.0f} mm x {1e3 * section.width:.0f} mm; use more grains or "
            "a larger vessel"
        )
    return np.array(placed)


def _near(points: Array, others: Array, distance: float) -> bool:
    gaps = points[:, None] - others
    return bool(np.any(np.einsum("ijk,ijk->ij", gaps, gaps) < distance**2))


def depth_in_section(section: Section, points: Array) -> Array:
    """How far points (..., 2) lie inside the outline of `section` [m]; negative outside."""
    shape = np.array([section.length, section.width, section.radius, section.shift])
    return depth_inside(shape, points)


def depth_inside(shapes: Array, points: Array) -> Array:
    """How far points (..., 2) lie inside rounded rectangles (..., 4) of l, w, r, s [m]."""
    radius, shift = shapes[..., 2], shapes[..., 3]
    middle = np.stack([shift, np.zeros_like(shift)], axis=-1)
    q = np.abs(points - middle) - (shapes[..., :2] / 2 - radius[..., None])
    outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
    return np.asarray(radius - outside - np.minimum(q.max(axis=-1), 0.0))


def sphere_centres(grain: Grain, packing: Packing) -> Array:
    """Centres of all spheres (n, k, 3) [m]."""
    turned = rotate(packing.orientations, grain.offsets)
    if packing.scales is not None:
        turned = packing.scales[:, None, None] * turned
    return np.asarray(packing.positions[:, None] + turned)


def sphere_radii(grain: Grain, packing: Packing) -> Array:
    """Radii of all spheres (n, k) [m]."""
    return np.asarray(sizes(packing)[:, None] * grain.radii)


def largest_overlap(grain: Grain, packing: Packing) -> float:
    """Largest overlap of spheres of different grains, in units of the smallest radius."""
    from scipy.spatial import cKDTree  # half a second, which only this needs

    centres, radii = sphere_centres(grain, packing), sphere_radii(grain, packing).ravel()
    flat = centres.reshape(-1, 3)
    pairs = cKDTree(flat).query_pairs(2 * float(radii.max()), output_type="ndarray")
    owner = pairs // centres.shape[1]
    pairs = pairs[owner[:, 0] != owner[:, 1]]
    if not len(pairs):
        return 0.0
    gaps = np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1)
    overlaps = radii[pairs].sum(axis=1) - gaps
    return max(0.0, float(overlaps.max() / radii.min()))


def count_flaw(packing: Packing, grains: int) -> str | None:
    """Why a packing is not one of so many grains, or None."""
    if len(packing.positions) != grains:
        return f"it holds {len(packing.positions)} grains instead of {grains}"
    if np.abs(np.linalg.norm(packing.orientations, axis=1) - 1).max() > 1e-6:
        return "it holds orientations that are no unit quaternions"
    return None


def flaw(grain: Grain, section: Section, top: float, grains: int, packing: Packing) -> str | None:
    """Why a packing in a vessel with its floor at z = 0 cannot be used, or None."""
    if (why := count_flaw(packing, grains)) is not None:
        return why
    centres, radii = sphere_centres(grain, packing), sphere_radii(grain, packing)
    slack = MOST_OVERLAP * float(radii.min())
    depth = depth_in_section(section, centres[..., :2]) - radii
    z = centres[..., 2]
    if min(depth.min(), (z - radii).min(), (top - z - radii).min()) < -slack:
        return "a grain lies outside the vessel"
    overlap = largest_overlap(grain, packing)
    if overlap > MOST_OVERLAP:
        return f"grains overlap by {overlap:.2f} radii, more than {MOST_OVERLAP:g}"
    return None
