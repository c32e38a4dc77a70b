"""What a campaign is made of: its file with all files that it names, or logs; and where its results go."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import expand, file_of, list_files, names_of, no_vehicle, number_of, refuse_existing
from aqualog.face.result import PathLike

if TYPE_CHECKING:
    import polars as pl

    from aqualog.campaign.jobs import Configured
    from aqualog.campaign.place import Address

__all__ = ["CampaignInputs", "is_campaign", "split"]


class CampaignInputs:
    """A campaign file or logs, read and checked completely."""

    def __init__(
        self,
        inputs: PathLike | Sequence[PathLike],
        *,
        vehicle: PathLike | None = None,
        map: PathLike | None = None,
        dbc: PathLike | Sequence[PathLike] = (),
        thresholds: PathLike | None = None,
        store: PathLike | None = None,
    ) -> None:
        from aqualog.config.configured import configure, configure_logs

        names = names_of(inputs)
        if not names:
            raise ConfigError("no log is named", expected="a campaign file, or at least one log")
        databases = [file_of(p, "dbc") for p in names_of(dbc, "dbc")]
        map_file = None if map is None else file_of(map, "map")
        limits = None if thresholds is None else file_of(thresholds, "thresholds")
        if is_campaign(names):
            if vehicle is not None:
                raise ConfigError("vehicle beside a campaign", where=names[0], expected="it in the campaign's runs")
            found = configure(file_of(names[0], "inputs"), map_file=map_file, dbc=databases, thresholds=limits)
        elif vehicle is None:
            raise no_vehicle("a campaign file that names one")
        else:
            found = configure_logs(
                expand(names), file_of(vehicle, "vehicle"), map_file=map_file, dbc=databases, thresholds=limits,
                lists=tuple(list_files(names)),
            )  # fmt: skip
        self.inputs = tuple(names)
        self.configured: Configured = found
        self._store = None if store is None else names_of(store, "store")[0]

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.configured.campaign.name

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys by which the runs can be grouped."""
        return self.configured.campaign.keys

    @property
    def store(self) -> Address:
        """Folder or URL of the results: the one given, else a folder beside the campaign file.

        Raises
        ------
        ConfigError
            For logs without a campaign file, which have no place of their own.
        """
        if self._store is not None:
            from aqualog.campaign.place import address_of

            return address_of(self._store)
        path = self.configured.campaign.path
        if path.suffix.lower() != ".toml":
            raise ConfigError(
                "logs without a campaign file have no place for results", expected="a folder or URL as store"
            )
        return path.with_suffix(".store")

    @property
    def sources(self) -> tuple[Path, ...]:
        """All files that the campaign reads, which no result may overwrite."""
        from aqualog.config.configured import files_of

        return files_of(self.configured)

    @property
    def runs(self) -> pl.DataFrame:
        """A row for each run: log and what the campaign says of it."""
        import polars as pl

        runs = self.configured.campaign.runs
        rows = [{"log": "; ".join(map(str, r.logs)), "vehicle": str(r.vehicle), **r.values} for r in runs]
        return pl.DataFrame(rows, infer_schema_length=None)

    def check_bins(self, by: str | Sequence[str] = (), *, bin_width: float = 10.0, road: str = "wet") -> Any:
        """Check keys and bins before any work, and return the plan that they make."""
        from aqualog.campaign.bins import check_plan

        bin_width = number_of(bin_width, "bin_width", 1.0, 100.0, "km/h")
        return check_plan(self.configured.campaign, split(by), width_kmh=bin_width, road=road)

    def check_targets(self, targets: Sequence[Path], *, force: bool) -> None:
        """Refuse results that are in the way of something, that the campaign reads, or that lie in a store."""
        places = [self.store] if self._store is not None else []
        if self.configured.campaign.path.suffix.lower() == ".toml":
            places.append(self.configured.campaign.path.with_suffix(".store"))
        from aqualog.campaign.store import Store

        for target in targets:
            above = [p for p in Path(os.path.realpath(target)).parents if Store(p).exists]
            own = [p for p in places if isinstance(p, Path)]
            inside = next((p for p in [*above, *own] if Store(p).holds(target)), None)
            if inside is not None:
                raise ConfigError("lies in a store of results", where=str(target), expected=f"a place outside {inside}")
        refuse_existing(targets, force=force, sources=self.sources)

    def check_report(self, folder: Path, *, force: bool) -> None:
        """Refuse a folder for the report that holds other files, or files that the campaign reads."""
        from aqualog.campaign.jobs import name_of
        from aqualog.report.campaign.folder import check_folder, targets_of

        check_folder(folder, force=force)
        campaign = self.configured.campaign
        self.check_targets(targets_of(folder, [name_of(campaign, r.logs) for r in campaign.runs]), force=True)

    def __repr__(self) -> str:
        return f"campaign {self.name}: {len(self.configured.campaign.runs)} runs, keys {', '.join(self.keys) or 'none'}"


def is_campaign(inputs: Sequence[str]) -> bool:
    """Return whether a campaign file is named; one among other inputs is a ConfigError."""
    named = [i for i in inputs if i.lower().endswith(".toml")]
    if named and len(inputs) > 1:
        raise ConfigError(
            "stands among other inputs",
            where=named[0],
            expected="one campaign file, or logs only; a vehicle file comes behind --vehicle",
        )
    return bool(named)


def split(by: str | Sequence[str]) -> list[str]:
    """Return keys that stand in one text, with commas, or in several."""
    names = by.split(",") if isinstance(by, str) else names_of(by, "by")
    return [n.strip() for n in names if n.strip()]
