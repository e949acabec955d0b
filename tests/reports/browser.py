"""A headless Chromium that tests drive through its debugging pipe, without a library for it."""

import base64
import fcntl
import io
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from mfopt.arrays import AnyArray

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-pipe",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
    "--no-first-run", "--disable-extensions", "--disable-background-networking",
)  # fmt: skip
PATIENCE_S = 120.0  # on a busy machine
KEYS = {"ArrowLeft": 37, "ArrowUp": 38, "Tab": 9}


class Page:
    """A tab: opens one file, and keeps what the console and the network say of it.

    Args:
        call: sends a command of the DevTools protocol and returns its result.
        events: of the tab, in order; grows while calls are made.
    """

    def __init__(self, call: Callable[..., Any], events: list[dict[str, Any]]) -> None:
        self._call, self._events = call, events

    def open(self, path: Path, *, width: int, height: int = 900, scripts: bool = True) -> None:
        """Load a page at a size [px], and wait until it has drawn."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **size)
        self._call("Emulation.setScriptExecutionDisabled", value=not scripts)
        self._call("Page.navigate", url=path.as_uri())
        until = time.monotonic() + PATIENCE_S
        while not self._said("Page.loadEventFired"):
            assert time.monotonic() < until, "the page does not load"
            self._call("Runtime.evaluate", expression="0")

    def _said(self, *methods: str) -> list[dict[str, Any]]:
        return [event["params"] for event in self._events if event["method"] in methods]

    def complaints(self) -> list[dict[str, Any]]:
        """Exceptions, warnings and errors of the console and of the browser itself."""
        logged = [
            params
            for params in self._said("Runtime.consoleAPICalled", "Log.entryAdded")
            if params.get("type", params.get("entry", {}).get("level")) in ("error", "warning")
        ]
        return self._said("Runtime.exceptionThrown") + logged

    def addresses(self) -> list[str]:
        """Addresses that were asked for."""
        return [params["request"]["url"] for params in self._said("Network.requestWillBeSent")]

    def value(self, expression: str) -> Any:
        """The value of a JavaScript expression, or of the promise that it gives."""
        done = self._call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def picture(self, selector: str) -> AnyArray:
        """Pixels (height, width, 3) of an element, after it was scrolled to and has drawn."""
        box = self.place(selector)
        scroll = self.value("[scrollX, scrollY]")
        clip = {"x": box["x"] + scroll[0], "y": box["y"] + scroll[1], "width": box["width"],
                "height": box["height"], "scale": 1}  # fmt: skip
        png = base64.b64decode(self._call("Page.captureScreenshot", clip=clip)["data"])
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))

    def place(self, selector: str) -> dict[str, float]:
        """Where an element stands in the window [px], after it was scrolled to and has drawn."""
        found: dict[str, float] = self.value(
            f"(async () => {{ const e = document.querySelector({json.dumps(selector)});"
            "e.scrollIntoView({block: 'center'});"
            "await new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)));"
            "return e.getBoundingClientRect().toJSON(); })()"
        )
        return found

    def drag(self, selector: str, dx: float, dy: float) -> None:
        """Press the mouse in the middle of an element, move it, and let it go."""
        box = self.place(selector)
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        steps = [("mousePressed", 0.0), ("mouseMoved", 0.5), ("mouseMoved", 1.0)]
        for kind, share in (*steps, ("mouseReleased", 1.0)):
            self._call(
                "Input.dispatchMouseEvent", type=kind, x=x + share * dx, y=y + share * dy,
                button="left", buttons=int(kind != "mouseReleased"), clickCount=1,
            )  # fmt: skip

    def press(self, key: str) -> None:
        """Press a key and let it go."""
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=key, code=key,
                       windowsVirtualKeyCode=KEYS[key])  # fmt: skip


class Browser:
    """A running Chromium; `page` opens a tab."""

    def __init__(self, write_to: int, read_from: int) -> None:
        self._out, self._in, self._rest = write_to, read_from, b""
        self._events: dict[str, list[dict[str, Any]]] = {}  # by session
        self._answers: dict[int, dict[str, Any]] = {}
        self._number = 0

    @contextmanager
    def page(self) -> Iterator[Page]:
        """A tab of its own."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        events = self._events.setdefault(session, [])
        try:
            yield Page(lambda method, **given: self.call(method, session, **given), events)
        finally:
            self.call("Target.closeTarget", targetId=target)

    def call(self, method: str, session: str = "", /, **given: Any) -> Any:
        """Send a command, and wait for its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": given}
        if session:
            message["sessionId"] = session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while self._number not in self._answers:
            self._listen()
        answer = self._answers.pop(self._number)
        assert "result" in answer, answer
        return answer["result"]

    def _listen(self) -> None:
        ready, _, _ = select.select([self._in], [], [], PATIENCE_S)
        assert ready, "Chromium does not answer"
        *whole, self._rest = (self._rest + os.read(self._in, 1 << 20)).split(b"\0")
        for message in map(json.loads, whole):
            if "id" in message:
                self._answers[message["id"]] = message
            elif "sessionId" in message:
                self._events.setdefault(message["sessionId"], []).append(message)


@contextmanager
def chromium(folder: Path) -> Iterator[Browser]:
    """Chromium with a profile of its own in `folder`, ended with the block."""
    assert CHROMIUM is not None
    to_it, from_us = os.pipe()
    to_us, from_it = os.pipe()
    # Chromium reads from descriptor 3 and writes to 4, which may be taken here.
    theirs = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_it, from_it)]
    command = f'exec "$@" 3<&{theirs[0]} 4>&{theirs[1]}'
    log = folder / "chromium.log"
    with open(log, "wb") as errors, subprocess.Popen(
        ["bash", "-c", command, "bash", CHROMIUM, *OPTIONS, f"--user-data-dir={folder}"],
        pass_fds=theirs, stdout=errors, stderr=errors,
    ) as process:  # fmt: skip
        for end in (to_it, from_it, *theirs):
            os.close(end)
        try:
            yield Browser(from_us, to_us)
        finally:
            process.terminate()
            for end in (from_us, to_us):
                os.close(end)
