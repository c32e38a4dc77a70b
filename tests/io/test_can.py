"""DBC decoding against cantools, frame by frame."""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path

import cantools.database
import numpy as np
import pytest

from aqualog.core.errors import LogError
from aqualog.io.can import decode_signal, load_dbc, pgn

REAL = Path(__file__).parents[2].parent / "shared" / "real_logs"

DBC = """VERSION ""

BU_: ECU

BO_ 100 Plain: 8 ECU
 SG_ LittleUnsigned : 3|11@1+ (0.1,-5) [0|0] "km/h" ECU
 SG_ LittleSigned : 14|13@1- (0.25,0) [0|0] "deg" ECU
 SG_ BigUnsigned : 39|12@0+ (1,0) [0|0] "" ECU
 SG_ BigSigned : 43|9@0- (-0.5,3) [0|0] "" ECU
 SG_ Flag : 63|1@1+ (1,0) [0|1] "" ECU

BO_ 101 Wide: 8 ECU
 SG_ All : 0|64@1+ (1,0) [0|0] "" ECU

BO_ 102 WideBig: 8 ECU
 SG_ AllBig : 7|64@0- (1,0) [0|0] "" ECU

BO_ 103 NineBytes: 16 ECU
 SG_ Crossing : 5|62@1- (0.001,0) [0|0] "" ECU
 SG_ Late : 96|20@1+ (1,0) [0|0] "" ECU

BO_ 104 Floats: 12 ECU
 SG_ Single : 0|32@1- (2,1) [0|0] "" ECU
 SG_ Double : 39|64@0- (1,0) [0|0] "" ECU

BO_ 105 Muxed: 8 ECU
 SG_ Mode M : 0|4@1+ (1,0) [0|0] "" ECU
 SG_ InZero m0 : 8|16@1+ (0.5,0) [0|0] "" ECU
 SG_ InOne m1 : 8|8@1- (1,0) [0|0] "" ECU
 SG_ Always : 56|8@1+ (1,0) [0|0] "" ECU

BO_ 106 Nested: 8 ECU
 SG_ Outer M : 0|4@1+ (1,0) [0|0] "" ECU
 SG_ Inner m1M : 4|4@1+ (1,0) [0|0] "" ECU
 SG_ Deep m3 : 16|16@1+ (1,0) [0|0] "" ECU
 SG_ Other m0 : 16|8@1+ (1,0) [0|0] "" ECU

BO_ 107 Fast: 64 ECU
 SG_ Tail : 500|12@1+ (1,0) [0|0] "" ECU

BO_ 2566844672 Truck: 8 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|0] "km/h" ECU

CM_ SG_ 100 LittleUnsigned "wheel speed";
SG_MUL_VAL_ 106 Inner Outer 1-1;
SG_MUL_VAL_ 106 Deep Inner 3-3;
SG_MUL_VAL_ 106 Other Outer 0-0;
SIG_VALTYPE_ 104 Single : 1;
SIG_VALTYPE_ 104 Double : 2;
"""


@pytest.fixture
def dbc_path(tmp_path: Path) -> Path:
    path = tmp_path / "test.dbc"
    path.write_text(DBC, encoding="cp1252")
    return path


def oracle(message, payload: bytes) -> dict[str, float]:
    """One frame by cantools, each signal alone: a DBC whose signals overlap it cannot decode as a whole."""
    found: dict[str, float] = {}
    for signal in message.signals:
        if selects(message, signal, payload) and (value := alone(message, signal, payload)) is not None:
            found[signal.name] = value
    with contextlib.suppress(cantools.database.DecodeError):  # a multiplexer value that the DBC does not have
        whole = message.decode(payload, decode_choices=False, allow_truncated=True, allow_excess=True)
        np.testing.assert_equal(whole, found)
    return found


def selects(message, signal, payload: bytes) -> bool:
    if not signal.multiplexer_ids:
        return True
    switch = message.get_signal_by_name(signal.multiplexer_signal)
    return selects(message, switch, payload) and alone(message, switch, payload) in signal.multiplexer_ids


def alone(message, signal, payload: bytes) -> float | None:
    plain = cantools.database.can.Signal(
        signal.name, signal.start, signal.length, signal.byte_order, signal.is_signed, conversion=signal.conversion
    )
    single = cantools.database.can.Message(message.frame_id, "single", 64, [plain], is_extended_frame=True)
    return single.decode(payload, decode_choices=False, allow_truncated=True).get(signal.name)


def check_message(message, payloads: list[bytes]) -> None:
    width = max(map(len, payloads), default=0)
    data = np.array([list(p.ljust(width, b"\xaa")) for p in payloads], dtype=np.uint8)
    length = np.array([len(p) for p in payloads])
    expected = [oracle(message, p) for p in payloads]
    for signal in message.signals:
        carried, values = decode_signal(message, signal.name, data, length)
        assert carried.tolist() == [signal.name in e for e in expected], signal.name
        wanted = np.array([float(e[signal.name]) for e in expected if signal.name in e])
        np.testing.assert_array_equal(values, wanted, err_msg=signal.name)  # exact; NaN equals NaN


def random_payloads(size: int, n: int, seed: int = 0) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [rng.bytes(size) for _ in range(n)]


@pytest.mark.parametrize(
    "name", ["Plain", "Wide", "WideBig", "NineBytes", "Floats", "Muxed", "Nested", "Fast", "Truck"]
)
@pytest.mark.parametrize("kind", ["full", "short", "long"])
def test_decoding_equals_cantools_to_the_bit(dbc_path: Path, name: str, kind: str):
    message = next(m for m in load_dbc((dbc_path,)).messages.values() if m.name == name)
    payloads = random_payloads(message.length, 300)
    if kind == "short":
        payloads = [p[: i % (message.length + 1)] for i, p in enumerate(payloads)]
    if kind == "long":
        payloads = [p + b"\x55" * 4 for p in payloads]
    if name in ("Muxed", "Nested"):  # a random multiplexer value is rarely a known one
        payloads = [bytes([(p[0] & 0xC0) | (i % 3) | (0x30 if i % 2 else 0)]) + p[1:] if p else p
                    for i, p in enumerate(payloads)]  # fmt: skip
    check_message(message, payloads)


def test_known_values(dbc_path: Path):
    """Worked by hand, so that the oracle is not the only witness."""
    messages = {m.name: m for m in load_dbc((dbc_path,)).messages.values()}
    data = np.array([list(struct.pack("<Q", 1234 << 3))], dtype=np.uint8)
    _, values = decode_signal(messages["Plain"], "LittleUnsigned", data, np.array([8]))
    assert values.tolist() == [1234 * 0.1 - 5]
    data = np.array([[0, 0, 0, 0, 0xAB, 0xC0, 0, 0]], dtype=np.uint8)
    _, values = decode_signal(messages["Plain"], "BigUnsigned", data, np.array([8]))
    assert values.tolist() == [0xABC]


def test_multiplexed_signal_is_only_in_its_frames(dbc_path: Path):
    message = next(m for m in load_dbc((dbc_path,)).messages.values() if m.name == "Muxed")
    data = np.zeros((4, 8), dtype=np.uint8)
    data[:, 0] = [0, 1, 0, 7]
    data[:, 1] = [2, 255, 4, 9]
    carried, values = decode_signal(message, "InZero", data, np.full(4, 8))
    assert carried.tolist() == [True, False, True, False]
    assert values.tolist() == [1.0, 2.0]
    assert decode_signal(message, "InOne", data, np.full(4, 8))[1].tolist() == [-1.0]


def test_ids_of_both_lengths_are_kept_apart(dbc_path: Path):
    messages = load_dbc((dbc_path,)).messages
    assert messages[(0x18FEF100 & 0x1FFFFFFF, True)].name == "Truck"
    assert (100, True) not in messages
    assert messages[(100, False)].name == "Plain"


def test_second_dbc_does_not_override_the_first(tmp_path: Path, dbc_path: Path):
    other = tmp_path / "other.dbc"
    other.write_text(DBC.replace("Plain", "Copy"), encoding="cp1252")
    dbc = load_dbc((dbc_path, other))
    assert dbc.messages[(100, False)].name == "Plain"
    assert any("0x64 (Copy) is already Plain" in n for n in dbc.notes)


def test_missing_or_foreign_dbc_is_a_log_error(tmp_path: Path):
    with pytest.raises(LogError, match="cannot be opened"):
        load_dbc((tmp_path / "no.dbc",))
    bad = tmp_path / "bad.dbc"
    bad.write_text("t,v\n1,2\n")
    with pytest.raises(LogError, match="is not a DBC"):
        load_dbc((bad,))


def test_pgn():
    assert pgn(0x18FEF125) == 0xFEF1  # broadcast: the group extension counts
    assert pgn(0x18EA2501) == 0xEA00  # to one address: it does not


@pytest.mark.real
@pytest.mark.skipif(not REAL.exists(), reason=f"no measured drives at {REAL}")
@pytest.mark.parametrize("name", ["toyota_rav4/toyota_2017.dbc", "canedge/canmod-gps.dbc"])
def test_every_signal_of_a_real_dbc_equals_cantools(name: str):
    messages = load_dbc((REAL / name,)).messages.values()
    assert len(messages) >= 9
    for message in messages:
        check_message(message, random_payloads(message.length, 30, seed=message.frame_id))
