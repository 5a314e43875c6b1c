"""A headless Chromium from the system's packages, driven over its DevTools protocol."""

import base64
import itertools
import json
import os
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

from websockets.sync.client import connect

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--mute-audio",
    "--remote-debugging-port=0",
)
START_TIMEOUT = ANSWER_TIMEOUT = 120.0
"""A browser without a graphics card is slow [s]."""


def chromium():
    """Where it is; a sentence about what would help if it is not there."""
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        raise FileNotFoundError("no Chromium: install the system's package `chromium`, or say where it is in CHROMIUM")
    return path


class Browser:
    """One page.

    Args:
        folder: For its profile, which is empty.
        width, height: Of the page [px].

    Attributes:
        errors: What the console said of errors, and exceptions of the page.
        asked: Addresses that were asked for.
    """

    def __init__(self, folder, width=1400, height=900):
        self.folder, self.size = Path(folder), (width, height)
        self.errors, self.asked = [], []

    def __enter__(self):
        arguments = [
            chromium(),
            *FLAGS,
            f"--user-data-dir={self.folder}",
            f"--window-size={self.size[0]},{self.size[1]}",
        ]
        self._process = subprocess.Popen(
            [*arguments, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            port = self._port()
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                page = next(target for target in json.load(answer) if target["type"] == "page")
            self._socket = connect(page["webSocketDebuggerUrl"], max_size=None, proxy=None, compression=None)
            self._number = itertools.count(1)
            for domain in ("Page", "Runtime", "Network", "Log"):
                self.call(f"{domain}.enable")
            width, height = self.size
            mobile = width < 600
            metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}
            self.call("Emulation.setDeviceMetricsOverride", **metrics)
        except BaseException:
            self._process.kill()
            raise
        return self

    def __exit__(self, *_):
        self._socket.close()
        self._process.kill()
        self._process.wait()

    def _port(self):
        file, end = self.folder / "DevToolsActivePort", time.monotonic() + START_TIMEOUT
        while time.monotonic() < end:
            if file.exists() and (text := file.read_text()):
                return int(text.splitlines()[0])
            time.sleep(0.05)
        raise TimeoutError("Chromium did not start")

    def call(self, method, **parameters):
        """A method of the DevTools protocol; events that come meanwhile are noted."""
        number = next(self._number)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        end = time.monotonic() + ANSWER_TIMEOUT
        while True:
            message = json.loads(self._socket.recv(end - time.monotonic()))
            if message.get("id") == number:
                assert "error" not in message, message["error"]
                return message["result"]
            self._note(message)

    def _note(self, message):
        about = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(about["exceptionDetails"].get("exception", {}).get("description", "exception"))
        elif message.get("method") == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(about["entry"]["text"])
        elif message.get("method") == "Runtime.consoleAPICalled" and about["type"] == "error":
            self.errors.append(" ".join(str(arg.get("value", arg.get("description"))) for arg in about["args"]))
        elif message.get("method") in ("Network.requestWillBeSent", "Network.webSocketCreated"):
            self.asked.append(about.get("request", about)["url"])

    def open(self, address):
        """Go to a page."""
        self.call("Page.navigate", url=address)

    def evaluate(self, script):
        """Value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        return answer["result"].get("value")

    def wait_for(self, script, seconds=60.0):
        """Wait until an expression is true; how long that took [s]."""
        begin = time.monotonic()
        while not self.evaluate(script):
            assert time.monotonic() - begin < seconds, f"not true within {seconds} s: {script}"
            time.sleep(0.05)
        return time.monotonic() - begin

    def screenshot(self, file):
        """What is seen, as a .png."""
        Path(file).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def drag(self, begin, end, steps=12):
        """Press the mouse at a point, move it to another, let go [px]."""
        self._mouse("mouseMoved", begin)
        self._mouse("mousePressed", begin)
        for k in range(1, steps + 1):
            self._mouse("mouseMoved", [a + (b - a) * k / steps for a, b in zip(begin, end, strict=True)])
            time.sleep(0.02)
        self._mouse("mouseReleased", end)

    def click(self, point):
        """Click at a point [px]."""
        self._mouse("mouseMoved", point)
        self._mouse("mousePressed", point)
        self._mouse("mouseReleased", point)

    def _mouse(self, kind, point):
        button = "none" if kind == "mouseMoved" else "left"
        self.call("Input.dispatchMouseEvent", type=kind, x=point[0], y=point[1], button=button, clickCount=1, buttons=1)
