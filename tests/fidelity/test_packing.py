import dataclasses
import multiprocessing
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import pytest

from fidelity.engine import Grain, Material, Movement, Packing, Physics, Setup
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.grains.packing import digest, settled_packing
from fidelity.grains.portion import (
    depth_in_section,
    flaw,
    largest_overlap,
    loose_portion,
    sphere_centres,
)
from fidelity.grains.settings import DemSettings
from fidelity.scenes.dosing.filling import CupFilling
from fidelity.scenes.dosing.run import cup_filling
from fidelity.scenes.dosing.settings import DosingSettings
from geometry.sections import Section
from mfopt.errors import SimulationError

ORDER = cup_filling(DosingSettings(), DemSettings(grains=60, spheres_per_grain=3), seed=0)


@dataclass(frozen=True)
class Still:
    """An engine that leaves every grain where it is, and notes each call in a file."""

    notes: Path
    status: str = "finished"
    name: str = field(default="still")
    cost_factor: float = 2.0

    def version(self) -> str:
        return "1"

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        return 1e-2

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        with open(self.notes, "a") as notes:
            notes.write("moved\n")
        packing, n = setup.packing, len(setup.packing.positions)
        return Movement(
            self.status, None if self.status == "finished" else "it broke",  # type: ignore[arg-type]
            np.full(n, np.nan), packing.positions, packing.orientations, np.zeros((n, 3)),
            np.zeros((n, 3)), 0.1, 10, 100.0, 1e-2, 0.0, 0.0, 0.5,
        )  # fmt: skip

    def calls(self) -> int:
        return len(self.notes.read_text().splitlines()) if self.notes.exists() else 0


@pytest.fixture
def engine(tmp_path: Path) -> Still:
    return Still(tmp_path / "notes")


def tall(order: CupFilling) -> CupFilling:
    """Loose layers stand high: a collar that the still engine's packing fits into."""
    return dataclasses.replace(order, collar=2.0)


@pytest.mark.parametrize("seed", range(3))
def test_loose_portion_is_in_the_cup_and_free_of_overlaps(seed: int) -> None:
    loose = loose_portion(ORDER.grain, ORDER.cup.section, 60, seed, chordal_error=2e-3)
    centres = sphere_centres(ORDER.grain, loose)
    depth = depth_in_section(ORDER.cup.section, centres[..., :2]) - ORDER.grain.radii
    assert loose.positions.shape == (60, 3)
    assert depth.min() >= 2e-3
    assert (centres[..., 2] - ORDER.grain.radii).min() >= 0
    assert largest_overlap(ORDER.grain, loose) == 0.0


def test_loose_portion_differs_by_seed_only() -> None:
    a, b, c = (
        loose_portion(ORDER.grain, ORDER.cup.section, 60, seed, chordal_error=1e-3).positions
        for seed in (5, 5, 6)
    )
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_grain_too_long_for_the_cup_is_named() -> None:
    small = Section(0.03, 0.03, 0.005, 0.0)
    with pytest.raises(SimulationError, match="does not fit into the vessel of 30 mm"):
        loose_portion(ORDER.grain, small, 3, 0, chordal_error=1e-3)


def test_depth_is_the_distance_to_the_outline() -> None:
    section = Section(0.13, 0.10, 0.02, 0.01)
    points = np.array([[0.01, 0.0], [0.075, 0.0], [0.075, 0.05], [0.0, 0.06]])
    corner = 0.02 - np.hypot(0.02, 0.02)
    assert depth_in_section(section, points) == pytest.approx([0.05, 0.0, corner, -0.01])


def test_overlap_of_two_grains_is_that_of_their_nearest_spheres() -> None:
    r = float(ORDER.grain.radii[0])
    pair = Packing(np.array([[0.0, 0, 0], [0.0, 1.9 * r, 0]]), np.tile([1.0, 0, 0, 0], (2, 1)))
    assert largest_overlap(ORDER.grain, pair) == pytest.approx(0.1)


def test_packing_is_made_once_per_order(engine: Still, tmp_path: Path) -> None:
    made = settled_packing(engine, tall(ORDER), tmp_path, time_limit_s=9)
    kept = settled_packing(engine, tall(ORDER), tmp_path, time_limit_s=9)
    assert engine.calls() == 1
    assert (made.cpu_s, made.work) == (0.5, 200.0)
    assert (kept.cpu_s, kept.work) == (0.0, 0.0)
    assert np.array_equal(made.packing.positions, kept.packing.positions)


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 1},
        {"grains": 59},
        {"collar": 0.4},
        {"chordal_error": 1e-3},
        {"physics": dataclasses.replace(ORDER.physics, timestep_factor=0.5)},
        {"grain_material": dataclasses.replace(ORDER.grain_material, young_modulus=2e6)},
        {"wall_material": dataclasses.replace(ORDER.wall_material, poisson_ratio=0.1)},
        {"grain": dataclasses.replace(ORDER.grain, inertia=2 * ORDER.grain.inertia)},
        {"cup": dataclasses.replace(ORDER.cup, volume=1e-3)},
    ],
)
def test_digest_depends_on_everything(engine: Still, change: dict[str, object]) -> None:
    assert digest(engine, dataclasses.replace(ORDER, **change)) != digest(engine, ORDER)  # type: ignore[arg-type]


def test_digest_depends_on_the_engine_and_its_fields() -> None:
    assert digest(BulletEngine(), ORDER) != digest(BulletEngine(timestep_s=5e-4), ORDER)


@pytest.mark.parametrize("damage", ["torn", "value", "missing", "moved"])
def test_damaged_packing_is_made_again(engine: Still, tmp_path: Path, damage: str) -> None:
    order = tall(ORDER)
    settled_packing(engine, order, tmp_path, time_limit_s=9)
    (path,) = tmp_path.glob("*.h5")
    if damage == "torn":
        path.write_bytes(path.read_bytes()[:200])
    else:
        with h5py.File(path, "r+") as file:
            if damage == "missing":
                del file["checksum"]
            else:
                file["positions"][0, 0] += 1e-9 if damage == "value" else 1.0
    again = settled_packing(engine, order, tmp_path, time_limit_s=9)
    assert engine.calls() == 2
    assert flaw(order.grain, order.cup.section, order.collar, 60, again.packing) is None
    settled_packing(engine, order, tmp_path, time_limit_s=9)
    assert engine.calls() == 2


def test_flaws_are_named() -> None:
    loose = loose_portion(ORDER.grain, ORDER.cup.section, 60, 0, chordal_error=1e-3)
    section = ORDER.cup.section

    def flaw_of(positions: np.ndarray, grains: int = 60) -> str:
        packing = Packing(positions, loose.orientations[: len(positions)])
        return flaw(ORDER.grain, section, 2.0, grains, packing) or ""

    shifted = np.array(loose.positions)
    shifted[3, 0] += 0.2
    stacked = np.array(loose.positions)
    stacked[1] = stacked[0] + [0.0, 0.0, 1e-4]
    assert flaw_of(loose.positions) == ""
    assert "outside the vessel" in flaw_of(shifted)
    assert "overlap" in flaw_of(stacked)
    assert "59 grains instead of 60" in flaw_of(loose.positions[:59])


def test_failed_settling_is_told_and_nothing_is_kept(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="settling the portion in the cup failed: it broke"):
        settled_packing(Still(tmp_path / "n", "crashed"), tall(ORDER), tmp_path, time_limit_s=9)
    assert not list(tmp_path.glob("*.h5"))


def _settle(engine: Still, cache: Path) -> None:
    settled_packing(engine, tall(ORDER), cache, time_limit_s=9)


def test_of_two_processes_one_makes_the_packing(engine: Still, tmp_path: Path) -> None:
    spawn = multiprocessing.get_context("spawn")
    both = [spawn.Process(target=_settle, args=(engine, tmp_path)) for _ in range(2)]
    for process in both:
        process.start()
    for process in both:
        process.join()
    assert [process.exitcode for process in both] == [0, 0]
    assert engine.calls() == 1


def test_a_packing_that_no_disk_takes_is_used_all_the_same(
    engine: Still, caplog: pytest.LogCaptureFixture
) -> None:
    settled_packing(engine, tall(ORDER), Path("/proc/packings"), time_limit_s=9)
    assert engine.calls() == 1
    assert "cannot be kept" in caplog.text
