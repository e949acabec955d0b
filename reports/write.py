"""Write the report of a run directory: one self-contained HTML file, and the same as PDF."""

import base64
import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from mfopt.campaign.store import RunDirectory
from mfopt.files.scratch import scratch
from mfopt.files.whole import write_aside
from mfopt.records.view import Describe, no_view
from reports.page import context

HERE = Path(__file__).parent


def write_report(
    run: RunDirectory, *, html: Path, pdf: Path | None = None, describe: Describe = no_view
) -> None:
    """Write the report of a finished, running or broken-off run.

    Both files are written aside and then renamed, so that a reader never finds half of one.
    The HTML is in place before the PDF is begun.

    Args:
        run: the run directory.
        html: file to write.
        pdf: file to write, or None for no PDF.
        describe: gives shape, motion and bounds of a design, or None where there are none.
    """
    with np.errstate(all="ignore"):  # what overflows is shown as such
        page = context(run, describe)
    write_pages(page, HERE, html, pdf)


def write_pages(page: Mapping[str, Any], templates: Path, html: Path, pdf: Path | None) -> None:
    """Set a page by `template.html` and `template.typ` of that folder, the HTML first.

    Args:
        page: what the templates name.
        templates: the folder; templates may also name the shared ones of this folder.
        html: file to write.
        pdf: file to write, or None for no PDF.
    """
    write_aside(html, _html(page, templates).encode())
    if pdf is not None:
        write_aside(pdf, _pdf(page, templates))


def _html(page: Mapping[str, Any], templates: Path) -> str:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader([templates, HERE]), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["svg"] = lambda text: _data("image/svg+xml", text.encode())
    environment.filters["png"] = lambda content: _data("image/png", content)
    style = (HERE / "style.css").read_text(encoding="utf-8")
    script = (HERE / "viewer.js").read_text(encoding="utf-8")
    return environment.get_template("template.html").render(page, style=style, script=script)


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _pdf(page: Mapping[str, Any], templates: Path) -> bytes:
    """Set the page by Typst, in a directory that holds all that it may read.

    The fonts are those that come with matplotlib, so that the pages are the same everywhere.
    """
    import typst
    from matplotlib import get_data_path

    with scratch() as folder:
        designs = []
        for i, (label, picture) in enumerate(page.get("designs", ())):
            (folder / f"{i}.png").write_bytes(picture)
            designs.append((label, f"{i}.png"))
        shown = {key: value for key, value in page.items() if key != "scene"}
        text = json.dumps({**shown, "designs": designs}, default=asdict)
        (folder / "page.json").write_text(text, encoding="utf-8")
        shutil.copy(HERE / "shared.typ", folder)
        shutil.copy(templates / "template.typ", folder)
        return typst.compile(
            folder / "template.typ", root=folder, ignore_system_fonts=True,
            font_paths=[Path(get_data_path(), "fonts", "ttf")],
        )  # fmt: skip
