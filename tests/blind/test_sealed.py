"""A sealed truth: not readable by chance, whole, and open only to who has a verdict."""

import json

import pytest

from tests.blind.multibody.seal import seal_truth
from tests.blind.sealed import LEDGER, SealError, open_truth, reopened, seal

TRUTH = {
    "world": "magic", "seed": 3, "kind": "known", "drive_type": "mixed", "noise": "white", "unknown": None,
    "effects": [{"effect": "payload_mass", "where": None, "parameters": {"delta_mass": 120.0}, "detectability": 9.0}],
}  # fmt: skip


def test_opens_only_after_the_verdict_and_notes_both_hashes(tmp_path):
    case = tmp_path / "c1"
    raw = seal(case, TRUTH).read_bytes()
    assert b"payload" not in raw
    with pytest.raises(SealError, match="no verdict"):
        open_truth(case)
    (case / "verdict.json").write_text('{"verdict": "named"}')
    assert open_truth(case) == TRUTH
    (line,) = (tmp_path / LEDGER).read_text().splitlines()
    assert {"case", "truth", "verdict"} <= set(json.loads(line))
    assert reopened(tmp_path / LEDGER) == ()


def test_verdict_that_changed_after_the_truth_was_seen_is_found(tmp_path):
    case = tmp_path / "c1"
    seal(case, TRUTH)
    for verdict in ("named", "cannot_tell"):
        (case / "verdict.json").write_text(verdict)
        open_truth(case)
    assert reopened(tmp_path / LEDGER) == ("c1",)


def test_changed_or_incomplete_truth_is_refused(tmp_path):
    path = seal(tmp_path / "c1", TRUTH)
    (tmp_path / "c1" / "verdict.json").write_text("{}")
    raw = bytearray(path.read_bytes())
    raw[-3] ^= 1
    path.write_bytes(bytes(raw))
    with pytest.raises(SealError, match="changed"):
        open_truth(tmp_path / "c1")
    with pytest.raises(SealError, match="without seed"):
        seal(tmp_path / "c2", {k: v for k, v in TRUTH.items() if k != "seed"})
    with pytest.raises(SealError, match="expected one of"):
        seal(tmp_path / "c2", {**TRUTH, "kind": "named"})
    with pytest.raises(SealError, match="unknown"):
        seal(tmp_path / "c2", {**TRUTH, "kind": "unknown"})


def test_truth_of_the_multibody_world_reads_as_the_others(tmp_path):
    case = tmp_path / "case_0007"
    case.mkdir()
    one = {"effect": "payload_mass", "where": None, "values": {"delta_mass": 90.0}, "known": True, "z": 9.0}
    seal_truth(case, {"hidden": [one], "programme": "city", "noise": "white", "seed": [5, 7]})
    with pytest.raises(SealError, match="no verdict"):
        open_truth(case)
    (case / "verdict.json").write_text("{}")
    truth = open_truth(case)
    assert (truth["world"], truth["kind"], truth["drive_type"]) == ("multibody", "known", "city")
    assert truth["effects"][0]["parameters"] == {"delta_mass": 90.0}
    assert truth["effects"][0]["detectability"] == 9.0
    assert reopened(tmp_path / LEDGER) == ()
