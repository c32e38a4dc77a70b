"""CSV: has no checksums; every sample that is told stands in a line of the file."""

from functools import cache

import numpy as np

from tests.fuzz.readers import outcome
from tests.fuzz.registry import Target, add


@cache
def seeds() -> dict[str, bytes]:
    """Small sound files in several dialects and encodings."""
    rows = [(f"{k * 0.01:.2f}", f"{50 + k * 0.25:.2f}", str(k)) for k in range(60)]
    point = "t [s],v_x [km/h],omega_fl [rad/s]\n" + "".join(",".join(r) + "\n" for r in rows)
    comma = "Zeit;Längs [m/s²];Rad\ns;m/s²;1/s\n" + "".join(";".join(r).replace(".", ",") + "\r\n" for r in rows)
    quoted = '"t","v_x"\n' + "".join(f'"{r[0]}","{r[1]}"\n' for r in rows)
    stamps = "time,v_x\n" + "".join(f"2026-05-01T10:00:{float(r[0]):05.2f}Z,{r[1]}\n" for r in rows)
    days = "Datum;Uhrzeit;v\n" + "".join(f"01.05.2026;10:00:{float(r[0]):05.2f};{r[1]}\n" for r in rows)
    thousands = "t;v\n" + "".join(f"{k},5;1.0{k:02d}.500,25\n" for k in range(60))
    bad = "t,v,w\n" + "".join(f"{r[0]},{'n/a' if k % 7 == 0 else r[1]},{'' if k % 5 == 0 else r[2]}\n" for k, r in enumerate(rows))  # fmt: skip
    return {
        "point": point.encode(), "comma": comma.encode("cp1252"), "utf16": comma.encode("utf-16"),
        "quoted": quoted.encode(), "stamps": stamps.encode(), "days": days.encode(), "thousands": thousands.encode(),
        "bad": bad.encode(),
    }  # fmt: skip


def one(data: bytes) -> None:
    """Read a file with this content."""
    lines = max(data.count(b"\n"), data.count(b"\r")) + 1
    for c in outcome(data, "a.csv").channels:
        assert c.t_ns.size <= lines, f"{c.t_ns.size} samples of {lines} lines"
        assert not np.isinf(c.values).any(), f"{c.info.path} is infinite"


add("csv", Target("CSV", seeds, one, is_text=True))
