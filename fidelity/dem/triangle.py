"""Distance of a point from a triangle, and whether it is a local minimum on the whole surface.

A sphere touches a surface once at every local minimum of the distance from its centre: over a
flat wall once, however many triangles it is made of; in a corner once per wall; over a convex
edge once. On the edge of a triangle the nearest point is such a minimum if no way into a
neighbouring triangle leads closer to the centre; likewise in a corner for the edges that meet
there.

Source: C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (nearest point).
"""

from fidelity.dem.compiled import inlined

FACE, EDGE, CORNER = 0, 1, 2  # where the nearest point lies


@inlined
def nearest_on_triangle(t, px, py, pz):  # type: ignore[no-untyped-def]
    """Nearest point of a triangle to p.

    Args:
        t: (9,) first corner a, and the edges b - a, c - a [m].
        px, py, pz: the point p [m].

    Returns:
        vector from the nearest point to p [m], where it lies, and the number of the edge
        (0: a-b, 1: b-c, 2: c-a) or of the corner.
    """
    apx, apy, apz = px - t[0], py - t[1], pz - t[2]
    abx, aby, abz = t[3], t[4], t[5]
    acx, acy, acz = t[6], t[7], t[8]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return apx, apy, apz, CORNER, 0
    bpx, bpy, bpz = apx - abx, apy - aby, apz - abz
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return bpx, bpy, bpz, CORNER, 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
        return apx - v * abx, apy - v * aby, apz - v * abz, EDGE, 0
    cpx, cpy, cpz = apx - acx, apy - acy, apz - acz
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return cpx, cpy, cpz, CORNER, 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
        return apx - w * acx, apy - w * acy, apz - w * acz, EDGE, 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return (
            bpx - w * (acx - abx),
            bpy - w * (acy - aby),
            bpz - w * (acz - abz),
            EDGE,
            1,
        )
    scale = 1.0 / (va + vb + vc)
    v, w = vb * scale, vc * scale
    return (
        apx - v * abx - w * acx,
        apy - v * aby - w * acy,
        apz - v * abz - w * acz,
        FACE,
        0,
    )


@inlined
def is_local_minimum(directions, first, last, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Whether no direction [first:last] (unit vectors) along the surface leads closer to p.

    d is the vector from the point on the surface to p.
    """
    slack = 1e-9 * (abs(dx) + abs(dy) + abs(dz))
    for k in range(first, last):
        if directions[k, 0] * dx + directions[k, 1] * dy + directions[k, 2] * dz > slack:
            return False
    return True
