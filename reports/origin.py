"""Where the runs of a calibration or diagnosis come from: versions, machine, seed."""

from mfopt.campaign.store import RunDirectory


def origin(run: RunDirectory, what: str) -> list[tuple[str, str]]:
    """What of the header a page shows; `what` is the calibration or diagnosis."""
    header = run.header
    return [
        ("mfopt", str(header["mfopt_version"])),
        *((program, str(version)) for program, version in (header.get("versions") or {}).items()),
        ("platform", str(header["platform"])),
        ("started", str(header["created"])),
        ("workers", str(header["workers"])),
        (f"seed of the {what}", str(header["seed"])),
    ]
