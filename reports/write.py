"""Write the report of a run directory: one self-contained HTML file, and the same as PDF."""

from pathlib import Path
from typing import Any

from mfopt.errors import MfoptError
from mfopt.store import RunDirectory, write_aside
from reports.design import Describe
from reports.page import context

HERE = Path(__file__).parent


def write_report(
    run: RunDirectory, *, describe: Describe, html: Path, pdf: Path | None = None
) -> None:
    """Write the report of a finished, running or broken-off run.

    Both files are written aside and then renamed, so that a reader never finds half of one.
    The HTML is in place before the PDF is begun.

    Args:
        run: the run directory.
        describe: gives shape, motion and bounds of a design, or None where there are none.
        html: file to write.
        pdf: file to write, or None for no PDF.

    Raises:
        MfoptError: if the libraries that set the PDF are missing.
    """
    page = context(run, describe)
    write_aside(html, render(page, interactive=True).encode())
    if pdf is not None:
        write_aside(pdf, _pdf(render(page, interactive=False)))


def render(page: dict[str, Any], *, interactive: bool) -> str:
    """Set the page: with the viewer, or for print."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    style = (HERE / "style.css").read_text(encoding="utf-8")
    script = (HERE / "viewer.js").read_text(encoding="utf-8") if interactive else ""
    template = environment.get_template("template.html")
    return template.render(page, style=style, script=script, interactive=interactive)


def _pdf(html: str) -> bytes:
    try:
        from weasyprint import HTML
    except OSError as error:  # it loads Pango, which pip cannot install
        raise MfoptError(
            f"the PDF needs the library Pango ({error}); install it "
            "(Debian, Ubuntu: libpango-1.0-0 libpangoft2-1.0-0), or open the HTML and print it"
        ) from error
    return bytes(HTML(string=html).write_pdf())
