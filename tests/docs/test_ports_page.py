"""docs/guides/port.md: its table is that of the stored certificates, and each certificate is one."""

import importlib
import json
from pathlib import Path

import pytest

from endotsr.errors import InputError
from endotsr.port.judge.certificate import read_certificate

ROOT = Path(__file__).parents[2]
made = importlib.import_module("pages.ports.certified")


def test_every_stored_certificate_has_its_row():
    found = [read_certificate(file) for file in made.FOLDER.glob("*.json")]
    assert found and all(one.claim in made.table() for one in found)


def test_a_certificate_with_another_claim_is_refused(tmp_path):
    content = json.loads(next(iter(sorted(made.FOLDER.glob("*.json")))).read_text(encoding="utf-8"))
    file = tmp_path / "c.json"
    file.write_text(json.dumps({**content, "level": content["level"] - 1}), encoding="utf-8")
    with pytest.raises(InputError, match="claim"):
        read_certificate(file)


def test_the_guide_names_every_training_case():
    guide = (ROOT / "docs" / "guides" / "port.md").read_text(encoding="utf-8")
    part = guide[guide.index("## 6. Training") : guide.index("## 7.")]
    cases = [folder.name for folder in (ROOT / "golden" / "cases" / "training").iterdir() if folder.is_dir()]
    assert len(cases) > 1 and [case for case in cases if f"{case}`" not in part] == []
