"""Read and check a campaign file with all files that it names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aqualog.align.mapping import SignalMap
from aqualog.campaign.definition import Campaign, Run
from aqualog.campaign.jobs import Configured
from aqualog.config.campaign import load_campaign
from aqualog.config.labels import load_labels
from aqualog.config.reader import tried
from aqualog.config.signal_map import check_files, load_signal_map
from aqualog.config.thresholds import load_settings
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.detect.stream import Settings

__all__ = ["configure", "configure_logs", "files_of"]


def configure(
    path: Path, *, map_file: Path | None = None, dbc: Sequence[Path] = (), thresholds: Path | None = None
) -> Configured:
    """Read a campaign file, its table of runs, vehicle files, signal map, labels and a thresholds file.

    Parameters
    ----------
    path : Path
        Campaign file.
    map_file : Path, optional
        In place of the campaign's.

    Raises
    ------
    ConfigError
        With all faults of all files in one message.
    """
    faults: list[str] = []
    campaign = tried(load_campaign, path, faults)
    return _configured(campaign, map_file, dbc, thresholds, faults)


def _configured(
    campaign: Campaign | None, map_file: Path | None, dbc: Sequence[Path], thresholds: Path | None, faults: list[str]
) -> Configured:
    runs = campaign.runs if campaign else ()
    vehicles = {p: tried(load_vehicle, p, faults) for p in dict.fromkeys(r.vehicle for r in runs)}
    labels = {p: tried(load_labels, p, faults) for p in dict.fromkeys(r.labels for r in runs if r.labels)}
    map_path = map_file or (campaign.signals if campaign else None)
    signal_map = tried(load_signal_map, map_path, faults) if map_path else SignalMap()
    settings = tried(load_settings, thresholds, faults) if thresholds else Settings()
    if signal_map is not None and runs:
        try:
            check_files(signal_map, [p for r in runs for p in r.logs])
        except ConfigError as error:
            faults.append(error.line())
    faults += [f"{p}: {'is no file' if p.exists() else 'there is no such file'}" for p in dbc if not p.is_file()]
    if faults or campaign is None or signal_map is None or settings is None:
        raise ConfigError("; ".join(dict.fromkeys(faults)))
    return Configured(
        campaign,
        {p: v for p, v in vehicles.items() if v is not None},
        {p: x for p, x in labels.items() if x is not None},
        signal_map,
        tuple(dbc),
        settings,
        tuple(p for p in (map_file, thresholds) if p),
    )


def files_of(configured: Configured) -> tuple[Path, ...]:
    """List all files that a campaign reads, which no result may overwrite."""
    campaign = configured.campaign
    maps = (p for p in (campaign.table, campaign.signals) if p)
    logs = (p for r in campaign.runs for p in r.logs)
    given = (*configured.labels, *configured.dbc, *configured.beside)
    return tuple(dict.fromkeys([campaign.path, *maps, *configured.vehicles, *given, *logs]))


def configure_logs(
    logs: Sequence[Path],
    vehicle: Path,
    *,
    map_file: Path | None = None,
    dbc: Sequence[Path] = (),
    thresholds: Path | None = None,
    lists: Sequence[Path] = (),
) -> Configured:
    """Build a campaign from logs without a campaign file: each log is a run without further data.

    Raises
    ------
    ConfigError
        With all faults of all files in one message.
    """
    name = logs[0].parent.name or "logs" if logs else "logs"
    runs = tuple(Run((p,), vehicle, None, None, {}) for p in logs)
    campaign = Campaign(name, Path(name), map_file, runs, lists[0] if lists else None)
    return _configured(campaign, map_file, dbc, thresholds, [])
