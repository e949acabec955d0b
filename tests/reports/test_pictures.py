"""Pictures of designs and grains: sections and turns against closed forms."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidelity.scenes.heap.scene import Heap
from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.view import DesignView
from mfopt.rotation import rotate
from reports.pictures import section, shapes, snapshots, wall_lines
from reports.result import result
from reports.rows import read_rows


def test_turned_offsets_agree_with_scipy() -> None:
    rng = np.random.default_rng(2)
    quaternions = rng.normal(size=(7, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    offsets = rng.normal(size=(5, 3))
    turned = rotate(quaternions, offsets)
    for q, its in zip(quaternions, turned, strict=True):
        expected = Rotation.from_quat(q[[1, 2, 3, 0]]).apply(offsets)
        np.testing.assert_allclose(its, expected, atol=1e-14)


def test_the_section_of_a_prism_is_its_two_sides() -> None:
    corners = np.array([[1, 2], [-1, 2], [-1, -2], [1, -2]], dtype=float)
    vertices = np.array([[x, y, z] for z in (0.0, 3.0) for x, y in corners])
    triangles = np.array(
        [t for i in range(4) for j in [(i + 1) % 4] for t in ((i, j, i + 4), (j, j + 4, i + 4))]
    )
    cut = section((vertices, triangles))
    lengths = np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(2 * 3.0)  # each side once, no triangle twice
    np.testing.assert_allclose(np.abs(cut[:, :, 0]), 1.0)


def test_a_mesh_beside_the_plane_has_no_section() -> None:
    vertices = np.array([[0, 1, 0], [1, 1, 0], [0, 2, 1]], dtype=float)
    assert section((vertices, np.array([[0, 1, 2]]))).shape == (0, 2, 2)


def test_shapes_are_pngs_of_one_size(machine: Callable[[Array], DesignView]) -> None:
    from io import BytesIO

    from PIL import Image

    x = np.array([0.133, 0.101, 0.025, 0, 0.112, 0.085, 0.025, 0, 0.25, 0.25, 0.75, 0.75, 1.0])
    wide = x.copy()
    wide[0] = 0.18
    images = [Image.open(BytesIO(png)) for png in shapes([machine(x), machine(wide)])]
    assert images[0].size == images[1].size
    assert len({tuple(p) for p in np.asarray(images[0]).reshape(-1, 3)}) > 20
    assert (np.asarray(images[0]) != np.asarray(images[1])).any()


def test_snapshots_need_stored_moments(
    finished_run: RunDirectory, machine: Callable[[Array], DesignView]
) -> None:
    found = result(read_rows(finished_run), ["reduced", "bullet-300", "yade-1000"])
    assert found is not None
    evaluation = finished_run.evaluation(found.typical.index)
    assert evaluation is not None
    svg = snapshots(evaluation.outcome.raw, machine(found.x))
    assert svg is not None
    for text in ("50 ms", "500 ms", "speed of the grain [m/s]", "x [mm]", "z [mm]"):
        assert text in svg
    assert snapshots({"f": np.array(1.0)}, machine(found.x)) is None


def test_a_moment_without_any_grain_left_is_drawn_empty(
    finished_run: RunDirectory, machine: Callable[[Array], DesignView]
) -> None:
    raw = next(
        dict(e.outcome.raw) for e in finished_run.evaluations()
        if e.candidate.purpose == "confirm best"
    )  # fmt: skip
    for name in ("positions", "orientations", "speeds"):
        array = raw[f"snapshot_{name}"].copy()
        array[-1] = np.nan
        raw[f"snapshot_{name}"] = array
    assert snapshots(raw, machine(np.full(13, 0.1))) is not None


def test_the_cup_is_drawn_where_its_motion_has_taken_it(
    machine: Callable[[Array], DesignView],
) -> None:
    x = np.array([0.133, 0.101, 0.025, 0, 0.112, 0.085, 0.025, 0, 0.3, 0.45, 0.7, 0.6, 1.2])
    view = machine(x)
    only_cup = dataclasses.replace(
        view,
        parts={"cup": view.parts["cup"]},
        motion_positions=view.motion_positions - 0.2,  # counted from the hole
    )
    start = view.parts["cup"][0][:, 0].mean()
    for i in (0, 40, 120):
        time, place = view.motion_times[i], view.motion_positions[i] - view.motion_positions[0]
        middle = wall_lines(only_cup, time)[:, :, 0].mean()
        assert middle == pytest.approx(start + place, abs=1e-9)


def test_a_cylinder_is_drawn_as_high_as_it_was_lifted() -> None:
    heap = Heap()
    view = heap.view(heap.problem().baseline, None)
    only_cylinder = dataclasses.replace(view, parts={"cylinder": view.parts["cylinder"]})
    start, half, end = (wall_lines(only_cylinder, time)[:, :, 1].min() for time in (0.0, 0.75, 1.7))
    assert (start, half, end) == pytest.approx((0.0, 0.075, 0.15))  # 100 mm/s, up to 150 mm
