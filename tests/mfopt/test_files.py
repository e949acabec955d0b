import errno
import os
from pathlib import Path

import pytest

from mfopt.errors import ConfigError
from mfopt.files.whole import write_aside


@pytest.mark.parametrize("number", [errno.EIO, errno.EROFS, errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("call", ["fsync", "write", "rename"])
def test_a_disk_that_refuses_is_named_and_leaves_the_old_file(
    call: str, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    write_aside(path, b"old")

    def refuse(*arguments: object, **more: object) -> None:
        raise OSError(number, os.strerror(number))

    match call:
        case "fsync":
            monkeypatch.setattr(os, "fsync", refuse)
        case "write":
            monkeypatch.setattr("builtins.open", refuse)
        case "rename":
            monkeypatch.setattr(Path, "replace", refuse)
    full = number in (errno.ENOSPC, errno.EDQUOT)
    with pytest.raises(
        ConfigError, match="no disk space left" if full else "cannot write .*file: "
    ):
        write_aside(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"]
