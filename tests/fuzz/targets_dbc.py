"""Databases of CAN messages: an MF4 with raw frames is read with them."""

import tempfile
from functools import cache
from pathlib import Path

from tests.can_log import CanFrames, write_frames_mf4
from tests.fuzz.readers import outcome
from tests.fuzz.registry import Target, add

_DBC = b"""VERSION ""

NS_ :
BS_:
BU_: ESC DASH
VAL_TABLE_ gear 0 "P" 1 "R" 2 "D" ;
BO_ 256 Wheels: 8 ESC
 SG_ omega_fl : 0|16@1+ (0.01,0) [0|655] "rad/s" DASH
 SG_ omega_fr : 23|16@0- (0.01,-5) [0|655] "rad/s" DASH
 SG_ x : 32|32@1- (1,0) [0|0] "" DASH
BO_ 257 Mux: 8 ESC
 SG_ m M : 0|8@1+ (1,0) [0|3] "" DASH
 SG_ a m0 : 8|8@1- (0.5,0) [0|0] "m/s^2" DASH
 SG_ b m1 : 8|16@1+ (1,0) [0|0] "Nm" DASH
BO_ 2147484161 Extended: 4 ESC
 SG_ v : 0|12@1+ (0.1,0) [0|400] "km/h" DASH
CM_ SG_ 256 omega_fl "wheel, front left";
BA_DEF_ SG_ "SPN" INT 0 524287;
BA_DEF_DEF_ "SPN" 0;
VAL_ 257 m 0 "first" 1 "second" ;
SIG_VALTYPE_ 256 x : 1;
"""


@cache
def seeds() -> dict[str, bytes]:
    """One with most of what databases hold, and a bare one."""
    bare = b'VERSION ""\n\nBU_: E\n\nBO_ 256 M: 8 E\n SG_ S : 0|16@1+ (0.1,0) [0|0] "m/s" E\n'
    return {"full": _DBC, "bare": bare}


@cache
def frames() -> bytes:
    """A small log of raw frames of these messages."""
    n = 60
    ids = [(256, 257, 513)[k % 3] for k in range(n)]
    data = [bytes((k * 7 + j) % 256 if j or k % 3 != 1 else k % 2 for j in range(8)) for k in range(n)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "f.mf4")
        found = CanFrames([k * 10**7 for k in range(n)], ids, [i == 513 for i in ids], data, [1] * n)
        write_frames_mf4(path, found, 1_700_000_000 * 10**9, "")
        return path.read_bytes()


def one(data: bytes) -> None:
    """Read the log with a database of this content."""
    outcome(frames(), "a.mf4", dbc=data, named="a.")


add("dbc", Target("databases of CAN messages (DBC)", seeds, one, is_text=True))
