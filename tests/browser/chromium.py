"""Chromium without a window, driven by its debugging protocol over two pipes."""

import json
import os
import pathlib
import shutil
import subprocess
import time

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--remote-debugging-pipe",
    "about:blank",
)


def find():
    """Returns the program; None if none is installed."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


class Browser:
    """A browser with a new profile in `folder`, and one page. Downloads go to `folder`/downloads."""

    def __init__(self, program, folder):
        self.downloads = pathlib.Path(folder) / "downloads"
        self.downloads.mkdir()
        to_browser, self.requests = os.pipe()
        self.answers, from_browser = os.pipe()
        # The protocol uses the descriptors 3 and 4.
        redirected = f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}'
        command = ["bash", "-c", redirected, program, f"--user-data-dir={folder}/profile", *ARGUMENTS]
        silent = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(command, pass_fds=(to_browser, from_browser), **silent)
        os.close(to_browser)
        os.close(from_browser)
        self.number = 0
        self.received = b""
        # Messages of the consoles, and addresses that were requested.
        self.errors = []
        self.addresses = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.page = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Log", "Runtime"):
            self.call(f"{domain}.enable", self.page)
        self.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.requests)
        os.close(self.answers)
        self.process.kill()
        self.process.wait()

    def call(self, method, session=None, **parameters):
        """Calls a method of the protocol and returns its result."""
        self.number += 1
        request = {"id": self.number, "method": method, "params": parameters}
        if session:
            request["sessionId"] = session
        os.write(self.requests, json.dumps(request).encode() + b"\0")
        while True:
            message = self._next_message()
            if message.get("id") == self.number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message)

    def _next_message(self):
        while b"\0" not in self.received:
            part = os.read(self.answers, 1 << 16)
            if not part:
                raise RuntimeError("the browser ended")
            self.received += part
        message, self.received = self.received.split(b"\0", 1)
        return json.loads(message)

    def _note(self, message):
        parameters = message.get("params", {})
        match message["method"]:
            case "Log.entryAdded" if parameters["entry"]["level"] == "error":
                self.errors.append(parameters["entry"]["text"])
            case "Runtime.exceptionThrown":
                self.errors.append(str(parameters["exceptionDetails"]))
            case "Network.requestWillBeSent":
                self.addresses.append(parameters["request"]["url"])

    def open(self, file):
        """Opens a file and waits until its scripts have run."""
        self.call("Page.navigate", self.page, url=pathlib.Path(file).resolve().as_uri())
        self.wait("document.readyState === 'complete' && location.protocol === 'file:'", 60)

    def evaluate(self, script):
        """Returns the value of a script, which may be a promise."""
        result = self.call(
            "Runtime.evaluate", self.page, expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in result:
            raise RuntimeError(str(result["exceptionDetails"]))
        return result["result"].get("value")

    def wait(self, condition, limit_s):
        """Waits until a script is true."""
        end = time.monotonic() + limit_s
        while not self.evaluate(condition):
            if time.monotonic() > end:
                raise TimeoutError(f"{condition} is not true after {limit_s} s")
            time.sleep(0.1)

    def choose_files(self, selector, files):
        """Selects files in a file chooser, as a user does."""
        root = self.call("DOM.getDocument", self.page)["root"]["nodeId"]
        node = self.call("DOM.querySelector", self.page, nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", self.page, nodeId=node, files=[str(file) for file in files])

    def drop_files(self, selector, files):
        """Drops files onto an element, as a user does."""
        box = self.evaluate(f"JSON.stringify(document.querySelector({selector!r}).getBoundingClientRect())")
        box = json.loads(box)
        place = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", self.page, type=kind, data=data, **place)

    def download(self, selector, name):
        """Clicks on a link and returns the bytes that it saves."""
        file = self.downloads / name
        file.unlink(missing_ok=True)
        self.evaluate(f"document.querySelector({selector!r}).click()")
        end = time.monotonic() + 30
        # The browser writes to another name until the file is complete.
        while not file.exists():
            if time.monotonic() > end:
                raise TimeoutError(f"{name} is not saved after 30 s")
            time.sleep(0.1)
        return file.read_bytes()
