"""The browser that the tests of the page use: one that is on this machine, or else one installed now.

    python tests/browser.py  # what `make test` does first: names the browser, or says in one line what to do, and fails

Installed is Playwright's own Chromium, or else the system's package, where that is permitted.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ADVICE = (
    "no browser for the tests of the page: install Chromium (`apt-get install chromium`, or "
    "`.venv/bin/playwright install --with-deps chromium`), or name one with MOTIONARY_BROWSER"
)
DOWNLOAD = 600  # seconds that Playwright's may take; apt-get has limits of its own


def find() -> str | None:
    """The path of a browser that runs, without installing anything: the one named, on PATH, or Playwright's own."""
    named = os.environ.get("MOTIONARY_BROWSER")
    candidates = [shutil.which(name) for name in ([named] if named else NAMES)]
    program = next((path for path in candidates if path and _runs(path)), None)
    return program if program or named else _playwrights()


def missing() -> str:
    """What to do when `find` finds nothing, in one line."""
    named = os.environ.get("MOTIONARY_BROWSER")
    return f"MOTIONARY_BROWSER={named} is no browser that runs here; name another or unset it" if named else ADVICE


@contextlib.contextmanager
def launched(flags: list[str]) -> Iterator[Browser]:
    """A running browser for tests, which fail where there is none."""
    import pytest

    program = find()
    if program is None:
        pytest.fail(missing(), pytrace=False)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=flags)
        yield browser
        browser.close()


def install() -> str | None:
    """Playwright's own Chromium, or else the system's package: the path of the first that comes and runs."""
    _say("none on this machine; Playwright downloads its Chromium (some 180 MB)")
    _download()
    if program := find():
        return program
    prefix = _privilege()
    if prefix is None or shutil.which("apt-get") is None:
        return None
    _say("Playwright's does not come or does not run; apt-get installs the system's chromium")
    apt = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-o", "DPkg::Lock::Timeout=300"]
    _done([*apt, "update"])  # a list that does not come may not be needed
    _done([*apt, "install", "-y", "chromium"])
    return find()


def main() -> int:
    """Names the browser, after installing it where there is none; the exit code is 1 where none can be had."""
    program = find()
    if program is None and not os.environ.get("MOTIONARY_BROWSER"):
        program = install()
    if program is None:
        print(f"error: {missing()}", file=sys.stderr)
        return 1
    _say(program)
    return 0


def _playwrights() -> str | None:
    """Playwright's own Chromium, where it has been downloaded in full and runs."""
    with sync_playwright() as playwright:
        program = Path(playwright.chromium.executable_path)
    complete = any((folder / "INSTALLATION_COMPLETE").is_file() for folder in program.parents)
    return str(program) if complete and _runs(str(program)) else None


def _privilege() -> list[str] | None:
    """What goes before a command to run it as root: nothing, or sudo if it asks no password; else None."""
    if subprocess.run(["id", "-u"], capture_output=True, text=True, check=True).stdout.strip() == "0":
        return []
    return ["sudo", "-n"] if _done(["sudo", "-n", "true"]) else None


def _runs(program: str) -> bool:
    """Whether it starts: a browser without its libraries does not, nor a package that only points to another."""
    return _done([program, "--version"], 60)


def _done(command: list[str], seconds: float | None = None) -> bool:
    """Runs a command silently; whether it ended well, in time."""
    quiet = subprocess.DEVNULL
    try:
        return subprocess.run(command, stdin=quiet, stdout=quiet, stderr=quiet, timeout=seconds).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def _download() -> None:
    """Lets Playwright try, for a limited time, after which all processes that it started end."""
    command = [sys.executable, "-m", "playwright", "install", "--no-shell", "chromium"]
    wait = {"PLAYWRIGHT_DOWNLOAD_CONNECTION_TIMEOUT": "10000"} | os.environ  # milliseconds; it tries several times
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, env=wait, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
    try:
        process.wait(DOWNLOAD)  # not every failure counts: Chromium may come without what it brings for films
    except subprocess.TimeoutExpired:
        pass
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):  # as a rule all have ended
            os.killpg(process.pid, signal.SIGKILL)


def _say(what: str) -> None:
    print(f"browser: {what}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
