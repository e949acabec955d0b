"""Files for other programs, read back."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hopper_designs import CURVED, TOUCHING, TUBE_END, prism, straight

from geometry.export import write_gltf, write_step, write_stl
from geometry.loft import Loft
from geometry.parts import passage
from geometry.sections import Section
from geometry.step import surfaces
from mesh_checks import capped, distances, volume
from mfopt.arrays import Array
from mfopt.errors import ConfigError, InvalidDesign


def test_stl_is_the_mesh_in_millimetres(tmp_path: Path) -> None:
    mesh = capped(passage(CURVED, TUBE_END, 0.001))
    write_stl(tmp_path / "passage.stl", mesh)
    content = (tmp_path / "passage.stl").read_bytes()
    assert content[:80].rstrip() == b"mfopt, millimetres"
    assert struct.unpack("<I", content[80:84])[0] == len(mesh.triangles)
    read = trimesh.load(tmp_path / "passage.stl")
    assert read.is_watertight
    assert read.volume == pytest.approx(1e9 * volume(mesh), rel=1e-5)
    assert read.bounds[:, 2] == pytest.approx([1e3 * TUBE_END, 0.0], abs=1e-3)
    assert list(tmp_path.iterdir()) == [tmp_path / "passage.stl"]  # nothing left aside


def test_gltf_keeps_names_colours_and_metres_with_y_up(tmp_path: Path) -> None:
    closed = capped(passage(CURVED, TUBE_END, 0.001))
    write_gltf(tmp_path / "machine.glb", {"hopper": closed, "copy": closed})
    scene = trimesh.load(tmp_path / "machine.glb")
    assert set(scene.geometry) == {"hopper", "copy"}
    hopper, copy = scene.geometry["hopper"], scene.geometry["copy"]
    assert hopper.volume == pytest.approx(volume(closed), rel=1e-5)
    assert hopper.bounds[:, 1] == pytest.approx([TUBE_END, 0.0], abs=1e-6)
    colours = [tuple(part.visual.material.baseColorFactor) for part in (hopper, copy)]
    assert colours[0] != colours[1]


def test_step_surfaces_are_the_loft_itself() -> None:
    # Points of the rational Bezier patches against the section at their height.
    for loft in (CURVED, TOUCHING, straight(), prism(Section(0.08, 0.08, 0.04, 0.0))):
        for poles, weights in surfaces(loft, TUBE_END):
            around, along = bernstein(len(poles) - 1), bernstein(poles.shape[1] - 1)
            weighted = around * weights
            points = np.einsum("um,mnk,vn->uvk", weighted, poles, along)
            points /= weighted.sum(axis=1)[:, None, None]
            assert np.abs(distances(points.reshape(-1, 3), loft)).max() < 1e-12


def bernstein(degree: int) -> Array:
    t = np.linspace(0, 1, 21)[:, None]
    k = np.arange(degree + 1)
    choose = np.array([1, 1, 1] if degree == 2 else [1] * (degree + 1), dtype=float)
    choose[1:-1] = degree
    return choose * t**k * (1 - t) ** (degree - k)


@pytest.mark.parametrize(
    "loft", [CURVED, TOUCHING, straight(), prism(Section(0.08, 0.08, 0.04, 0.0))]
)
def test_step_holds_the_volume_of_the_mesh(
    loft: Loft, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("OCP.collections", reason="needs the extra `cad`")
    write_step(tmp_path / "hopper.step", loft, TUBE_END)
    assert "SI_UNIT(.MILLI.,.METRE.)" in (tmp_path / "hopper.step").read_text()
    assert capfd.readouterr().out == ""  # the CAD kernel stays silent
    fine = volume(capped(passage(loft, TUBE_END, 0.0001)))
    # The mesh is inscribed in the corners: up to 2/3 sagitta x perimeter / area, 0.2 % here.
    assert volume_of_step(tmp_path / "hopper.step") == pytest.approx(fine * 1e9, rel=0.002)


def volume_of_step(path: Path) -> float:
    """Volume [mm3] of the shell in a STEP file, with plane caps; it must have two rims."""
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakeSolid,
        BRepBuilderAPI_Sewing,
    )
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.ShapeAnalysis import ShapeAnalysis_FreeBounds
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_SHELL, TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    shell = reader.OneShape()
    assert BRepCheck_Analyzer(shell).IsValid()
    sewing = BRepBuilderAPI_Sewing(1e-3)
    sewing.Add(shell)
    rims = TopExp_Explorer(ShapeAnalysis_FreeBounds(shell).GetClosedWires(), TopAbs_WIRE)
    count = 0
    while rims.More():
        sewing.Add(BRepBuilderAPI_MakeFace(TopoDS.Wire(rims.Current()), True).Face())
        rims.Next()
        count += 1
    assert count == 2
    sewing.Perform()
    closed = TopExp_Explorer(sewing.SewedShape(), TopAbs_SHELL).Current()
    properties = GProp_GProps()
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell(closed)).Solid()
    BRepGProp.VolumeProperties_s(solid, properties, 1e-7)
    return abs(properties.Mass())


def test_step_without_the_extra_names_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "OCP.collections", None)
    with pytest.raises(ConfigError, match=r"pip install '.\[cad\]'"):
        write_step(tmp_path / "hopper.step", CURVED, TUBE_END)


def test_step_refuses_an_invalid_tube(tmp_path: Path) -> None:
    with pytest.raises(InvalidDesign, match="tube end"):
        write_step(tmp_path / "hopper.step", CURVED, -0.1)
    assert not list(tmp_path.iterdir())
