"""The contact law: from overlap, relative velocity and history to a force.

Linear: springs of Cundall & Strack (1979, doi:10.1680/geot.1979.29.1.47) with the stiffnesses of
YADE's FrictMat: two springs in series, 2 E r each, on a wall with the radius 2 r; the ratio of
tangential to normal stiffness is `poisson_ratio`.
Hertz: Hertz normally, Mindlin's no-slip stiffness 8 G* sqrt(R* overlap) tangentially; when
the overlap shrinks the tangential force shrinks with that stiffness, or the contact would gain
energy (Elata & Berryman 1996, doi:10.1016/S0167-6636(96)00034-8).
Both: Coulomb friction; viscous damping 2 zeta sqrt(stiffness m), m the mass that the contact
feels, see `restitution`; the same zeta tangentially; adhesion as a constant pull 2 pi R* w while in
contact (Derjaguin, Muller & Toporov 1975, doi:10.1016/0021-9797(75)90018-1).
"""

import math
from typing import NamedTuple

from fidelity.dem.compiled import inlined
from fidelity.dem.restitution import damping_ratio
from fidelity.engine import Material, Physics


class Pair(NamedTuple):
    """What a contact between two materials needs; radii come in with the contact.

    With the radius R* = r_i r_j / (r_i + r_j), on a wall r. Linear: stiffness over radius.
    Hertz: `normal` is E*, `tangential` G*.
    """

    normal: float  # [Pa]
    tangential: float  # [Pa]
    friction: float  # [-] tangent of the friction angle


class Law(NamedTuple):
    """What all contacts of a run share."""

    hertz: bool
    zeta: float  # [-] damping ratio
    rolling: float  # [-] rolling friction
    rolling_spring: float  # [-] stiffness of the rolling spring over kt R*^2
    adhesion: float  # [J/m2]


def law_of(physics: Physics) -> Law:
    """The contact law that `physics` asks for."""
    e = physics.restitution
    return Law(
        hertz=physics.contact_law == "hertz",
        zeta=0.0 if e is None else damping_ratio(physics.contact_law, e),
        rolling=physics.rolling_friction,
        rolling_spring=physics.rolling_stiffness,
        adhesion=physics.adhesion_energy,
    )


def pair_of(
    a: Material,
    b: Material,
    physics: Physics,
    *,
    wall: bool,
    friction_angle: float | None = None,
) -> Pair:
    """Constants of the contacts of material `a`, a grain's, with `b`, a grain's or a wall's.

    `friction_angle` [rad] is that of this contact; None: the smaller one of the two materials.
    """
    least = min(a.friction_angle, b.friction_angle)
    friction = math.tan(least if friction_angle is None else friction_angle)
    if physics.contact_law == "hertz":
        compliance = [(1 - m.poisson_ratio**2) / m.young_modulus for m in (a, b)]
        shear = [
            2 * (2 - m.poisson_ratio) * (1 + m.poisson_ratio) / m.young_modulus for m in (a, b)
        ]
        return Pair(1 / sum(compliance), 1 / sum(shear), friction)
    normal = [m.young_modulus for m in (a, b)]
    tangential = [m.young_modulus * m.poisson_ratio for m in (a, b)]
    if wall:  # counts as a sphere of twice the radius
        return Pair(
            _series(normal[0], 2 * normal[1]), _series(tangential[0], 2 * tangential[1]), friction
        )
    return Pair(2 * _series(*normal), 2 * _series(*tangential), friction)


def _series(a: float, b: float) -> float:
    """2 a b / (a + b), as two springs in series of half their length each."""
    return 2.0 * a * b / (a + b) if a + b > 0.0 else 0.0


@inlined
def stiffness(hertz, normal, tangential, radius, overlap):  # type: ignore[no-untyped-def]
    """Elastic force [N], normal and tangential stiffness [N/m] of a contact; see `Pair`."""
    if hertz:
        a = math.sqrt(radius * overlap)
        kn = 2.0 * normal * a
        return kn * overlap / 1.5, kn, 8.0 * tangential * a
    kn = normal * radius
    return kn * overlap, kn, tangential * radius


@inlined
def slide(sx, sy, sz, limit):  # type: ignore[no-untyped-def]
    """Limit a force (or moment) to the size `limit`; also whether it was above."""
    square = sx * sx + sy * sy + sz * sz
    if square <= limit * limit:
        return sx, sy, sz, False
    factor = limit / math.sqrt(square)
    return sx * factor, sy * factor, sz * factor, True


@inlined
def spring_loss(hx, hy, hz, sx, sy, sz, ux, uy, uz, before, now, dt):  # type: ignore[no-untyped-def]
    """Energy [J] that a spring neither kept nor gave to the grains in a step.

    What it held, less what it holds, less its work: half of it by the old force, half by the new.

    Args:
        hx, hy, hz: old force, carried to this step [N].
        sx, sy, sz: new force [N].
        ux, uy, uz: velocity of its end in the step [m/s].
        before, now: old and new stiffness [N/m], above 0.
        dt: [s].
    """
    held = 0.5 * (hx * hx + hy * hy + hz * hz) / before
    holds = 0.5 * (sx * sx + sy * sy + sz * sz) / now
    work = 0.5 * dt * ((hx + sx) * ux + (hy + sy) * uy + (hz + sz) * uz)
    return held - holds - work


@inlined
def viscosity(zeta, k, inverse_mass, dt):  # type: ignore[no-untyped-def]
    """Dashpot [N s/m] of the damping ratio zeta beside a spring k.

    It acts with the velocity of half a step ago, u(t - dt/2) = u - du/dt dt/2, and so takes
    c dt/2 off the mass: m - c dt/2 on k and c has the damping ratio zeta for this c.
    """
    c = 2.0 * zeta * math.sqrt(k / inverse_mass)
    late = 0.25 * dt * inverse_mass * c
    return c * (math.sqrt(1.0 + late * late) - late)


@inlined
def turn_into_plane(sx, sy, sz, nx, ny, nz, twist):  # type: ignore[no-untyped-def]
    """Carry a tangential history to a contact with the normal n that twisted by `twist` [rad]."""
    if twist != 0.0:
        cx, cy, cz = ny * sz - nz * sy, nz * sx - nx * sz, nx * sy - ny * sx
        sx, sy, sz = sx + twist * cx, sy + twist * cy, sz + twist * cz
    off = sx * nx + sy * ny + sz * nz
    return sx - off * nx, sy - off * ny, sz - off * nz


@inlined
def contact_force(  # type: ignore[no-untyped-def]
    law, pair, radius, weight, overlap, nx, ny, nz, ux, uy, uz, sx, sy, sz, twist, inverse_mass, dt
):
    """Force on grain i in a contact.

    Args:
        law, pair: see there.
        radius: R* [m].
        weight: share of this contact in a wall that several contacts stand for; else 1.
        overlap: [m].
        nx, ny, nz: unit normal, towards i.
        ux, uy, uz: velocity of i relative to j at the contact [m/s].
        sx, sy, sz: tangential spring force on i after the last step [N].
        twist: mean rotation of both about n in this step [rad].
        inverse_mass: 1 / mass that the contact feels [1/kg]; only read with damping.
        dt: [s].

    Returns:
        force (3) [N]; tangential spring force (3) [N]; pressing force [N]; normal and
        tangential stiffness [N/m]; the latter relative to that of the last step; energy lost by
        slip [J]; viscous part (3) of the force [N].
    """
    elastic, kn, kt = stiffness(law.hertz, pair.normal, pair.tangential, radius, overlap)
    elastic, kn, kt = weight * elastic, weight * kn, weight * kt
    un = ux * nx + uy * ny + uz * nz
    tx, ty, tz = ux - un * nx, uy - un * ny, uz - un * nz
    hx, hy, hz = turn_into_plane(sx, sy, sz, nx, ny, nz, twist)
    grown = 1.0  # tangential stiffness, relative to the last step
    if law.hertz and overlap + un * dt > 0.0:
        grown = math.sqrt(overlap / (overlap + un * dt))
    keep = min(1.0, grown)
    sx, sy, sz = keep * hx - kt * dt * tx, keep * hy - kt * dt * ty, keep * hz - kt * dt * tz
    press = elastic
    if law.zeta > 0.0:
        c = viscosity(law.zeta, kn, inverse_mass, dt)
        press = max(0.0, elastic - c * un)
    sx, sy, sz, slips = slide(sx, sy, sz, pair.friction * press)
    slip = 0.0
    if kt > 0.0 and (slips or law.hertz):
        slip = spring_loss(hx, hy, hz, sx, sy, sz, tx, ty, tz, kt / grown, kt, dt)
    if kt > 0.0 and un * dt >= overlap:  # opens before the next step: nobody will ask again
        slip += spring_loss(sx, sy, sz, 0.0, 0.0, 0.0, tx, ty, tz, kt, kt, dt)
    fx, fy, fz = sx, sy, sz
    if law.zeta > 0.0 and not slips:  # a sliding contact is damped by its friction
        c = viscosity(law.zeta, kt, inverse_mass, dt)
        fx, fy, fz, _ = slide(sx - c * tx, sy - c * ty, sz - c * tz, pair.friction * press)
    normal = press
    if law.adhesion > 0.0:
        normal -= 2.0 * math.pi * law.adhesion * radius * weight
    return (
        fx + normal * nx,
        fy + normal * ny,
        fz + normal * nz,
        sx,
        sy,
        sz,
        press,
        kn,
        kt,
        grown,
        slip,
        fx - sx + (press - elastic) * nx,
        fy - sy + (press - elastic) * ny,
        fz - sz + (press - elastic) * nz,
    )
