"""Definitions out of a log: what a recorder writes passes, what would keep a decoder busy or is no name does not."""

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from aqualog.io.messages.codecs import UndecodableError, codec_for
from aqualog.io.messages.ros_types import RefusedError, checked

RULER = "=" * 80 + "\n"
FLOAT = (Nodetype.BASE, ("float64", 0))


@pytest.mark.parametrize("store", list(Stores))
def test_all_common_types_pass_without_constants(store):
    types = get_typestore(store).fielddefs
    assert checked(types) == {name: ([], list(fields)) for name, (_, fields) in types.items()}


def nested(last):
    return "car/A0 a\ncar/A0 b\n" + "".join(
        f"{RULER}MSG: car/A{i}\ncar/A{i + 1} a\ncar/A{i + 1} b\n" for i in range(40)
    ) + f"{RULER}MSG: car/A40\n{last}"  # fmt: skip


@pytest.mark.parametrize(
    ("definition", "data", "says"),
    [
        (f"car/E[] x\n{RULER}MSG: car/E\n", b"\xff" * 4, "take no room"),
        (f"car/E[9] x\n{RULER}MSG: car/E\n", b"", "take no room"),
        (f"car/E[4000000000] x\n{RULER}MSG: car/E\nuint8 a\n", bytes(8), "4000000000 elements"),
        ("string[400000000] x\n", bytes(8), "400000000 elements"),
        ("float64[4000000000] x\n", bytes(8), "4000000000 elements"),
        (nested("uint8 a\n"), bytes(8), "parts"),
        (nested(""), bytes(8), "parts"),
        ("car/X a\nuint8 b\n", bytes(8), "holds itself"),
        ("car/X[] a\nuint8 b\n", bytes(8), "holds itself"),
        ("".join(f"uint8 x{i}\n" for i in range(5000)), bytes(5000), "5000 fields"),
        ("float64 x\n" + "#" * (1 << 18), bytes(8), "bytes"),
    ],
)
def test_hostile_definitions_are_refused_with_a_reason(definition, data, says):
    with pytest.raises(UndecodableError, match=says):
        codec_for("ros1", "ros1msg", "car/X", definition.encode()).decode(data)


@pytest.mark.parametrize(
    "types",
    [
        {"a/msg/B": ([], [("x:\n  import os\n  y", FLOAT)])},
        {"a/msg/B": ([], [("__class__", FLOAT)])},
        {"a/msg/B": ([], [("x\n", FLOAT)])},
        {"a/msg/B": ([], [(7, FLOAT)])},
        {"a/msg/B\n": ([], [("x", FLOAT)])},
        {'a/msg/B"); import os #': ([], [("x", FLOAT)])},
        {"a/msg/\u00c4": ([], [("x", FLOAT)])},
        {"a/msg/B": ([], [("x", (Nodetype.NAME, "c/msg/D"))])},
        {"a/msg/B": ([], [("x", (Nodetype.BASE, ("float64, import", 0)))])},
        {"a/msg/B": ([], [("x", (Nodetype.ARRAY, (FLOAT, 0)))])},
    ],
)
def test_what_is_no_name_reaches_no_code(types):
    with pytest.raises(RefusedError):
        checked(types)


def test_constants_reach_no_code():
    text = "string A=x'); import os #\nfloat64 x\n"
    codec = codec_for("ros1", "ros1msg", "car/C", text.encode())
    message = codec.decode(bytes(8))
    assert message.x == 0.0
    assert not hasattr(message, "A")
