"""The designs in the format of the viewer in the page."""

import base64
import json
from collections.abc import Sequence

import numpy as np

from mfopt.records.view import DesignView
from reports.pictures import extent, part_colour


def scene(views: Sequence[DesignView]) -> str:
    """Meshes of the designs as JSON that can stand inside an HTML script element.

    All designs share one centre and one radius [m], so that they appear at the same scale.
    """
    points = extent(views)
    low, high = points.min(axis=0), points.max(axis=0)
    made = {
        "centre": ((low + high) / 2.0).tolist(),
        "radius": float(np.linalg.norm(high - low)) / 2.0,
        "designs": [{"label": view.label, "parts": _parts(view)} for view in views],
    }
    return json.dumps(made).replace("<", "\\u003c")


def _parts(view: DesignView) -> list[dict[str, object]]:
    """Parts of one design, opaque ones first as blending wants them."""
    names = sorted(view.parts, key=lambda name: view.translucent.get(name, 1.0), reverse=True)
    return [
        {
            "colour": [*part_colour(view, name), view.translucent.get(name, 1.0)],
            "vertices": _base64(view.parts[name][0].astype("<f4").tobytes()),
            "triangles": _base64(view.parts[name][1].astype("<u4").tobytes()),
        }
        for name in names
    ]


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
