"""CSV: has no checksums; every sample that is told stands in a line of the file."""

from functools import cache

import numpy as np

from tests.fuzz.damaged_files import read

__all__ = ["one", "seeds"]


@cache
def seeds() -> tuple[bytes, ...]:
    """Small sound files in several dialects and encodings."""
    rows = [(f"{k * 0.01:.2f}", f"{50 + k * 0.25:.2f}", str(k)) for k in range(60)]
    point = "t [s],v_x [km/h],omega_fl [rad/s]\n" + "".join(",".join(r) + "\n" for r in rows)
    comma = "Zeit;Längs [m/s²];Rad\ns;m/s²;1/s\n" + "".join(";".join(r).replace(".", ",") + "\r\n" for r in rows)
    quoted = '"t","v_x"\n' + "".join(f'"{r[0]}","{r[1]}"\n' for r in rows)
    return point.encode(), comma.encode("cp1252"), comma.encode("utf-16"), quoted.encode()


def one(data: bytes) -> None:
    """Read a file with this content."""
    lines = max(data.count(b"\n"), data.count(b"\r")) + 1
    for c in read(data, "a.csv"):
        assert c.t_ns.size <= lines
        assert not np.isinf(c.values).any()
