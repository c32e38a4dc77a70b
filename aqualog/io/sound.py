"""Read what is sound of a file in which a group of records is damaged beyond reading."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo
from aqualog.io.base import Reader

__all__ = ["read_sound"]

_NAMED = 3  # channels of a lost group that are named


def read_sound(reader: Reader, wanted: Sequence[ChannelInfo]) -> tuple[list[Channel], list[str]]:
    """Decode channels of one file; of an MDF, group by group, with a note on each group that cannot be decoded.

    Returns
    -------
    list of Channel
        In the order of `wanted`, without those that are lost.
    list of str
        A sentence for each group that is lost.

    Raises
    ------
    LogError
        If nothing of it can be decoded.
    """
    groups = _groups(reader, wanted)
    if len(groups) < 2:
        return reader.read(wanted), []
    found: dict[str, Channel] = {}
    errors: list[LogError] = []
    lost: list[str] = []
    for infos in groups:
        try:
            found |= {c.info.path: c for c in reader.read(infos)}
        except LogError as error:
            errors.append(error)
            lost.append(_told(infos, error))
    if errors and not found:
        raise errors[0]
    return [found[w.path] for w in wanted if w.path in found], lost


def _groups(reader: Reader, wanted: Sequence[ChannelInfo]) -> list[list[ChannelInfo]]:
    """Channels that stand in the same records; only in MDF a file is more than one such group."""
    piecewise = getattr(reader, "parts", None)
    if reader.format != "mdf" or piecewise is None:
        return [list(wanted)]
    return [[w for w in wanted if (w.file, w.path) in part.channels] for part in piecewise(wanted)]


def _told(infos: Sequence[ChannelInfo], error: LogError) -> str:
    names = ", ".join(i.path for i in infos[:_NAMED])
    more = f" and {len(infos) - _NAMED} more" if len(infos) > _NAMED else ""
    return f"{names}{more}: {error.what}"
