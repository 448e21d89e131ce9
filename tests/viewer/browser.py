"""A headless Chromium, driven through chromedriver: just what the viewer's tests need of W3C WebDriver.

Python's standard library alone, so that the tests need no packages beside Debian's chromium and chromium-driver.
"""
import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

KEYS = {"Shift": "\ue008", "Alt": "\ue00a", "Escape": "\ue00c", "Left": "\ue012", "Up": "\ue013", "Right": "\ue014",
        "Down": "\ue015"}


def missing():
    """What a test would have to be skipped for, or None."""
    for program, package in (("chromium", "chromium"), ("chromedriver", "chromium-driver")):
        if not shutil.which(program):
            return f"{program} is not installed (Debian's package {package})"
    return None


class Browser:
    """One window. Use as a context manager."""

    def __init__(self, width=1280, height=800):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.driver = subprocess.Popen(["chromedriver", "--port=0", "--log-level=SEVERE"], stdout=subprocess.PIPE,
                                       stderr=subprocess.DEVNULL, text=True)
        for line in self.driver.stdout:
            if found := re.search(r"started successfully on port (\d+)", line):
                break
        else:
            raise RuntimeError("chromedriver did not start")
        self.root = f"http://127.0.0.1:{found[1]}"
        arguments = ["--headless=new", f"--user-data-dir={self.profile.name}", f"--window-size={width},{height}",
                     "--hide-scrollbars", "--no-first-run", "--disable-background-networking",
                     "--force-device-scale-factor=1",
                     "--enable-unsafe-swiftshader"]  # WebGL without a graphics card
        if os.geteuid() == 0:
            arguments.append("--no-sandbox")
        options = {"args": arguments}
        if binary := shutil.which("chromium"):
            options["binary"] = binary
        capabilities = {"browserName": "chrome", "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
        self.session = self.send("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})["sessionId"]
        # A window's size includes what headless windows do not show.
        inner = self.script("return [innerWidth, innerHeight]")
        self.command("POST", "/window/rect", {"width": 2 * width - inner[0], "height": 2 * height - inner[1]})

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.send("DELETE", f"/session/{self.session}")
        finally:
            self.driver.terminate()
            self.driver.wait(10)
            self.driver.stdout.close()
            self.profile.cleanup()

    def send(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.root + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def command(self, method, path, body=None):
        return self.send(method, f"/session/{self.session}{path}", body)

    def open(self, path):
        self.command("POST", "/url", {"url": "file://" + os.path.abspath(path)})

    def script(self, text, *arguments):
        """Runs the body of a function in the page; its value."""
        return self.command("POST", "/execute/sync", {"script": text, "args": list(arguments)})

    def release(self):
        """Lets go of all keys and buttons."""
        self.command("DELETE", "/actions")

    def wait_for(self, expression, seconds=60):
        end = time.monotonic() + seconds
        while not self.script(f"return Boolean({expression})"):
            if time.monotonic() > end:
                raise AssertionError(f"{expression} has not come true; failure: " +
                                     self.script("return document.getElementById('failure')?.textContent"))
            time.sleep(0.05)

    def screenshot(self):
        """The window as PNG bytes."""
        return base64.b64decode(self.command("GET", "/screenshot"))

    def console(self):
        """What the console has received since the last call: [(level, message)]."""
        entries = self.command("POST", "/se/log", {"type": "browser"})
        return [(entry["level"], entry["message"]) for entry in entries]

    # ---- input ----

    def act(self, *sources):
        self.command("POST", "/actions", {"actions": list(sources)})

    def keys(self, *keys, held=None):
        """Presses keys one after the other, with one held down."""
        actions = []
        if held:
            actions.append({"type": "keyDown", "value": KEYS[held]})
        for key in keys:
            value = KEYS.get(key, key)
            actions += [{"type": "keyDown", "value": value}, {"type": "keyUp", "value": value}]
        if held:
            actions.append({"type": "keyUp", "value": KEYS[held]})
        self.act({"type": "key", "id": "keyboard", "actions": actions})

    def hover(self, x, y):
        self.act({"type": "pointer", "id": "mouse", "actions": [{"type": "pointerMove", "x": int(x), "y": int(y)}]})

    def drag(self, start, *stops, button=0, touch=False):
        """From one point of the window through others, a little at a time."""
        actions = [{"type": "pointerMove", "x": int(start[0]), "y": int(start[1])},
                   {"type": "pointerDown", "button": button}]
        last = start
        for stop in stops:
            for step in range(1, 6):
                actions.append({"type": "pointerMove", "duration": 20,
                                "x": int(last[0] + (stop[0] - last[0]) * step / 5),
                                "y": int(last[1] + (stop[1] - last[1]) * step / 5)})
            last = stop
        actions.append({"type": "pointerUp", "button": button})
        kind = "touch" if touch else "mouse"
        self.act({"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": actions})

    def wheel(self, x, y, delta):
        self.act({"type": "wheel", "id": "wheel",
                  "actions": [{"type": "scroll", "x": int(x), "y": int(y), "deltaX": 0, "deltaY": int(delta)}]})
