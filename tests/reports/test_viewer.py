"""The scene that the page's viewer reads."""

import base64
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mfopt.arrays import Array
from mfopt.records.view import DesignView
from reports.viewer import scene


def test_meshes_survive_the_way_into_the_page(machine: Callable[[Array], DesignView]) -> None:
    view = replace(machine(np.full(13, 0.1)), label="</script> & co")
    text = scene([view])
    assert "<" not in text  # it stands inside a script element
    (design,) = json.loads(text)["designs"]
    assert design["label"] == "</script> & co"
    assert len(design["parts"]) == len(view.parts)
    opacities = [part["colour"][3] for part in design["parts"]]
    assert opacities == sorted(opacities, reverse=True)
    sizes = set()
    for part in design["parts"]:
        vertices = np.frombuffer(base64.b64decode(part["vertices"]), "<f4").reshape(-1, 3)
        triangles = np.frombuffer(base64.b64decode(part["triangles"]), "<u4")
        assert triangles.max() < len(vertices)
        sizes.add(len(vertices))
    assert sizes == {len(vertices) for vertices, _ in view.parts.values()}
