"""How `make test` comes by a browser: every route in processes of its own, with a PATH and a Playwright made here.

Playwright is the real one, its download comes from a server of this test; browsers, apt-get, sudo and id are scripts.
"""

from __future__ import annotations

import functools
import io
import os
import shutil
import subprocess
import sys
import threading
import time
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from browser import ADVICE

RUNS, BROKEN = "exit 0", "exit 127"
INSTALLS = """echo "$DEBIAN_FRONTEND $*" >> "$LOG"
case "$*" in *" install -y chromium") printf '#!/bin/sh\\n' > "$BIN/chromium"; /bin/chmod +x "$BIN/chromium";; esac"""
DROPPED = {"MOTIONARY_BROWSER", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "http_proxy", "https_proxy", "all_proxy"}


class Machine:
    """A machine with the programs that a test puts there, and what Playwright downloads."""

    def __init__(self, folder: Path, script: Path, port: int):
        self.bin, self.log, self.script, self.served = folder / "bin", folder / "log", script, None
        self.bin.mkdir()
        self.bin.joinpath("env").symlink_to(str(shutil.which("env")))
        self.environment = {name: value for name, value in os.environ.items() if name not in DROPPED} | {
            "PATH": str(self.bin),
            "BIN": str(self.bin),
            "LOG": str(self.log),
            "PLAYWRIGHT_BROWSERS_PATH": str(folder / "playwright"),
            "PLAYWRIGHT_DOWNLOAD_HOST": f"http://127.0.0.1:{port}",
        }
        self.put("id", "echo 1000")

    def put(self, name: str, body: str) -> Path:
        path = self.bin / name
        path.write_text(f"#!/bin/sh\n{body}\n")
        path.chmod(0o755)
        return path

    def run(self, *command: str) -> tuple[int, list[str], str]:
        """Exit code, lines of standard output and standard error of `python tests/browser.py`, or of another."""
        done = subprocess.run(
            [sys.executable, *(command or [str(self.script)])], env=self.environment, capture_output=True, text=True
        )
        return done.returncode, done.stdout.splitlines(), done.stderr

    @functools.cached_property
    def playwrights(self) -> Path:
        """Where Playwright looks for its Chromium."""
        code = "from playwright.sync_api import sync_playwright as p\nwith p() as q: print(q.chromium.executable_path)"
        return Path(self.run("-c", code)[1][0])

    def download(self, body: str | None) -> None:
        """What every download brings from now on: Chromium that does this, or nothing for ever where None."""
        home = Path(self.environment["PLAYWRIGHT_BROWSERS_PATH"])
        inside = "/".join(self.playwrights.relative_to(home).parts[1:])
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr(inside, f"#!/bin/sh\n{body}\n")
        self.served = packed.getvalue() if body else b""


@pytest.fixture
def machine(tmp_path, repository):
    class Downloads(BaseHTTPRequestHandler):
        def do_GET(self):
            if it.served is None:
                return self.send_error(404)
            if not it.served:
                return stop.wait(60)
            self.send_response(200)
            self.send_header("Content-Length", str(len(it.served)))
            self.end_headers()
            self.wfile.write(it.served)

        def log_message(self, format, *args):
            pass

    stop = threading.Event()
    server = ThreadingHTTPServer(("127.0.0.1", 0), Downloads)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    it = Machine(tmp_path, repository / "tests" / "browser.py", server.server_port)
    yield it
    stop.set()
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("name", ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"])
def test_a_browser_on_the_path_is_used(machine, name):
    program = machine.put(name, RUNS)
    assert machine.run() == (0, [f"browser: {program}"], "")


def test_one_that_does_not_run_is_passed_over(machine):
    machine.put("chromium", BROKEN)
    program = machine.put("google-chrome", RUNS)
    assert machine.run() == (0, [f"browser: {program}"], "")


def test_one_named_goes_before_all_and_must_run(machine):
    machine.put("chromium", RUNS)
    mine = machine.environment["MOTIONARY_BROWSER"] = str(machine.put("mine", RUNS))
    assert machine.run() == (0, [f"browser: {mine}"], "")
    machine.put("mine", BROKEN)
    assert machine.run() == (
        1,
        [],
        f"error: MOTIONARY_BROWSER={mine} is no browser that runs here; name another or unset it\n",
    )


def test_playwrights_is_downloaded_once(machine):
    machine.download(RUNS)
    code, lines, errors = machine.run()
    assert (code, errors) == (0, "")
    assert lines[1:] == [f"browser: {machine.playwrights}"]
    assert "Playwright downloads" in lines[0]
    machine.served = None
    assert machine.run() == (0, [f"browser: {machine.playwrights}"], "")
    next(machine.playwrights.parents[1].glob("INSTALLATION_COMPLETE")).unlink()  # as after an interruption
    assert machine.run()[0] == 1


@pytest.mark.parametrize(
    ("who", "download"), [("root", None), ("sudo", BROKEN)], ids=["not there", "without libraries"]
)
def test_the_systems_package_comes_where_playwrights_does_not(machine, who, download):
    if download:
        machine.download(download)
    machine.put("apt-get", INSTALLS)
    if who == "root":
        machine.put("id", "echo 0")
    else:
        machine.put("sudo", '[ "$1" = -n ] || exit 1; shift; [ "$1" = true ] || exec "$@"')
    code, lines, errors = machine.run()
    assert (code, errors) == (0, "")
    assert "apt-get installs" in lines[1]
    assert lines[2:] == [f"browser: {machine.bin / 'chromium'}"]
    steps = [line.split(" ") for line in machine.log.read_text().splitlines()]
    assert [(step[0], step[3:]) for step in steps] == [
        ("noninteractive", ["update"]),
        ("noninteractive", ["install", "-y", "chromium"]),
    ]


@pytest.mark.parametrize(
    ("scripts", "tried"),
    [
        ({}, False),
        ({"apt-get": INSTALLS}, False),
        ({"apt-get": INSTALLS, "sudo": "exit 1"}, False),
        ({"id": "echo 0"}, False),
        ({"id": "echo 0", "apt-get": 'echo "$*" >> "$LOG"; exit 100'}, True),
    ],
    ids=["nothing", "not root", "sudo asks for a password", "no apt-get", "apt-get fails"],
)
def test_where_nothing_can_be_done_one_line_says_what_to_do(machine, scripts, tried):
    for name, body in scripts.items():
        machine.put(name, body)
    code, lines, errors = machine.run()
    assert (code, errors) == (1, f"error: {ADVICE}\n")
    assert len(lines) == 1 + tried
    assert machine.log.exists() == tried


def test_a_download_that_hangs_is_given_up(machine):
    machine.download(None)
    begin = time.monotonic()
    code = f"import sys; sys.path[0] = {str(machine.script.parent)!r}\nimport browser; browser.DOWNLOAD = 3"
    assert machine.run("-c", f"{code}\nsys.exit(browser.main())")[::2] == (1, f"error: {ADVICE}\n")
    assert time.monotonic() - begin < 30
    if Path("/proc").is_dir():
        mark = f"PLAYWRIGHT_BROWSERS_PATH={machine.environment['PLAYWRIGHT_BROWSERS_PATH']}".encode()
        left = [entry for entry in Path("/proc").glob("[0-9]*/environ") if mark in _read(entry)]
        assert not left, "what Playwright started has ended"


@pytest.mark.slow
def test_plain_pytest_fails_with_the_same_line(machine, repository):
    code, lines, _ = machine.run("-m", "pytest", str(repository / "tests/app/test_browser.py"), "-k", "playback")
    assert code == 1
    assert ADVICE in lines


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""
