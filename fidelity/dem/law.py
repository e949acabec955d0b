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
    friction: float  # [-] tangent of the smaller friction angle


class Law(NamedTuple):
    """What all contacts of a run share."""

    hertz: bool
    zeta: float  # [-] damping ratio
    rolling: float  # [-] rolling friction
    adhesion: float  # [J/m2]


def law_of(physics: Physics) -> Law:
    """The contact law that `physics` asks for."""
    e = physics.restitution
    return Law(
        hertz=physics.contact_law == "hertz",
        zeta=0.0 if e is None else damping_ratio(physics.contact_law, e),
        rolling=physics.rolling_friction,
        adhesion=physics.adhesion_energy,
    )


def pair_of(a: Material, b: Material, physics: Physics, *, wall: bool) -> Pair:
    """Constants of the contacts of material `a`, a grain's, with `b`, a grain's or a wall's."""
    friction = math.tan(min(a.friction_angle, b.friction_angle))
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
def slide(sx, sy, sz, limit, k):  # type: ignore[no-untyped-def]
    """Limit a spring's force (or moment) to `limit`; also the energy lost in slip [J]."""
    square = sx * sx + sy * sy + sz * sz
    if square <= limit * limit:
        return sx, sy, sz, 0.0
    size = math.sqrt(square)
    factor = limit / size
    loss = limit * (size - limit) / k if k > 0.0 else 0.0
    return sx * factor, sy * factor, sz * factor, loss


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
        tangential stiffness [N/m]; energy lost by slip and by damping [J].
    """
    elastic, kn, kt = stiffness(law.hertz, pair.normal, pair.tangential, radius, overlap)
    elastic, kn, kt = weight * elastic, weight * kn, weight * kt
    un = ux * nx + uy * ny + uz * nz
    tx, ty, tz = ux - un * nx, uy - un * ny, uz - un * nz
    sx, sy, sz = turn_into_plane(sx, sy, sz, nx, ny, nz, twist)
    if law.hertz and un > 0.0:  # the overlap was larger by un dt, the stiffness with it
        shrink = math.sqrt(overlap / (overlap + un * dt))
        sx, sy, sz = sx * shrink, sy * shrink, sz * shrink
    sx, sy, sz = sx - kt * dt * tx, sy - kt * dt * ty, sz - kt * dt * tz
    press = elastic
    damped = 0.0
    if law.zeta > 0.0:
        c = 2.0 * law.zeta * math.sqrt(kn / inverse_mass)
        press = max(0.0, elastic - c * un)
        damped = (elastic - press) * un * dt
    sx, sy, sz, slip = slide(sx, sy, sz, pair.friction * press, kt)
    fx, fy, fz = sx, sy, sz
    if law.zeta > 0.0 and slip == 0.0:  # a sliding contact is damped by its friction
        c = 2.0 * law.zeta * math.sqrt(kt / inverse_mass)
        fx, fy, fz, _ = slide(sx - c * tx, sy - c * ty, sz - c * tz, pair.friction * press, 0.0)
        damped += ((sx - fx) * tx + (sy - fy) * ty + (sz - fz) * tz) * dt
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
        slip,
        damped,
    )
