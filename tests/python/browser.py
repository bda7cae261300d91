"""A headless Chromium spoken to over its own pipe (DevTools protocol), for tests that look at a page."""

import json
import os
import select
import shutil
import subprocess
import time

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def installed():
    """The path of a browser, or None; `TWINCAL_BROWSER` names another one."""
    return os.environ.get("TWINCAL_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One browser with one tab at a time."""

    def __init__(self, profile):
        to_browser, from_browser = os.pipe(), os.pipe()
        self.write, self.read = to_browser[1], from_browser[0]
        self.buffer, self.count, self.events, self.session = b"", 0, [], None

        def files():
            # The protocol is on 3 and 4; the pipes may have these numbers already.
            reading, writing = os.dup(to_browser[0]), os.dup(from_browser[1])
            os.dup2(reading, 3)
            os.dup2(writing, 4)

        # --no-sandbox: tests run as root in containers, on pages that they made.
        command = [installed(), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
                   "--remote-debugging-pipe", f"--user-data-dir={profile}", "about:blank"]  # fmt: skip
        self.process = subprocess.Popen(command, preexec_fn=files, close_fds=False, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        os.close(to_browser[0])
        os.close(from_browser[1])

    def close(self):
        self.call("Browser.close", session=False)
        os.close(self.write)
        self.process.wait(timeout=30)
        os.close(self.read)

    def message(self, patience):
        """The next message, or None after so many seconds."""
        end = time.monotonic() + patience
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.read], [], [], max(0, end - time.monotonic()))
            if not ready:
                return None
            piece = os.read(self.read, 1 << 16)
            assert piece, "the browser ended"
            self.buffer += piece
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, session=True, **parameters):
        """The result of a command; what else happens is kept in `events`."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if session and self.session:
            message["sessionId"] = self.session
        os.write(self.write, json.dumps(message).encode() + b"\0")
        while (answer := self.message(60)) is not None:
            if answer.get("id") == self.count:
                assert "error" not in answer, (method, answer)
                return answer["result"]
            self.events.append(answer)
        raise TimeoutError(method)

    def wait(self, method, patience=30):
        """The parameters of the first event of this name."""
        end = time.monotonic() + patience
        while True:
            for event in self.events:
                if event.get("method") == method:
                    return event["params"]
            message = self.message(max(0, end - time.monotonic()))
            if message is None:
                raise TimeoutError(method)
            self.events.append(message)

    def open(self, path, width, height, dark=False, script=True):
        """A new tab of this size with a file."""
        self.events, self.session = [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.call("Emulation.setScriptExecutionDisabled", value=not script)
        self.call("Page.navigate", url=path.absolute().as_uri())
        self.wait("Page.loadEventFired")
        if script:
            # Two frames later, what the script drew has its place.
            self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    def value(self, expression):
        """The value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start, end):
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
        for share in (0.3, 0.6, 1.0):
            self.mouse("mouseMoved", *[a + share * (b - a) for a, b in zip(start, end)], button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def happened(self, method):
        return [event["params"] for event in self.events if event.get("method") == method]
