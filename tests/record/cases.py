"""The command lines of the record, in the order in which they run: later ones read what earlier ones wrote.

Every case runs in one folder that holds `sample_logs`, `real_logs` (where the measured drives are there), `given` (the
maps and vehicle files beside this module), `cars` (those of `tests/real`) and `damaged` (see `tests/damaged`). `{o}` is the case's own folder `out/NAME`.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from tests.damaged.damage import DAMAGED_EACH
from tests.damaged.logs import FORMATS, folder_of

S = "sample_logs"
CAR = f"--vehicle {S}/vehicle.toml"
RAV4 = "real_logs/toyota_rav4"
RAV4_LOG = f"{RAV4}/can_bus.mf4 --dbc {RAV4}/toyota_2017.dbc"
RAV4_CAR = "--vehicle cars/toyota.toml --signals cars/toyota_map.toml"
PORSCHE = "real_logs/porsche_981"
PORSCHE_CAR = "--vehicle cars/porsche.toml --signals cars/porsche_map.toml"
BMW = "real_logs/bmw_i3"
BMW_CAR = "--vehicle cars/bmw_i3.toml --signals cars/bmw_i3_map.toml"
BMW_RAW = "--vehicle cars/diagnose_bmw_i3.toml --signals cars/diagnose_bmw_i3_map.toml"
CANEDGE = "real_logs/canedge"
CANEDGE_LOG = f"{CANEDGE}/00000001-60FE3F04.MF4 --dbc {CANEDGE}/canmod-gps.dbc"
THESIS = "given/few.toml"
TRIPS = "given/trips.toml"
DAMAGED = "damaged/"
MONDAY = f"{S}/loaded_monday.parquet {CAR}"
LOADED = f"{S}/loaded_monday.parquet {S}/loaded_friday.parquet"


@dataclass(frozen=True, slots=True)
class Case:
    """One command line, arguments of `aqualog`, and what is kept of it in the record's file `name`.

    `keep`: glob of the written files whose values are kept; `only`: keys of the JSON document that are kept, empty: all;
    `is_long`: left out unless asked for; `is_digest`: the document is kept as one digest of its results, without its
    sentences.
    """

    name: str
    line: str
    keep: str = "**/*"
    only: tuple[str, ...] = ()
    is_long: bool = False
    is_digest: bool = False

    @property
    def needs_drives(self) -> bool:
        """Whether it reads the measured drives."""
        return "real_logs" in self.line or TRIPS in self.line

    @property
    def needs_damaged(self) -> bool:
        """Whether it reads a damaged log."""
        return DAMAGED in self.line


ONE_DRIVE = (
    Case("inspect_mf4", f"inspect {S}/lane_drive.mf4 --json --write-map {{o}}/map.toml"),
    Case("inspect_mcap", f"inspect {S}/lane_drive.mcap --json --write-map {{o}}/map.toml"),
    Case("inspect_csv", f"inspect {S}/lane_drive.csv --json --write-map {{o}}/map.toml"),
    Case("inspect_parquet", f"inspect {S}/lane_drive.parquet --json"),
    Case("inspect_text", f"inspect {S}/lane_drive.csv --signals {S}/map_csv.toml"),
    Case("inspect_rav4", f"inspect {RAV4_LOG} --json --write-map {{o}}/map.toml"),
    Case("inspect_porsche", f"inspect {PORSCHE} --json --write-map {{o}}/map.toml"),
    Case("inspect_canedge", f"inspect {CANEDGE_LOG} --json"),
    Case("init_csv", f"init {S}/lane_drive.csv -o {{o}}/work --json"),
    Case("init_porsche", f"init {PORSCHE} -o {{o}}/work"),
    Case("doctor_mf4", f"doctor {S}/lane_drive.mf4 {CAR} --json"),
    Case("doctor_mcap", f"doctor {S}/lane_drive.mcap {CAR} --signals {S}/map_mcap.toml --json"),
    Case("doctor_csv", f"doctor {S}/lane_drive.csv {CAR} --signals {S}/map_csv.toml --json"),
    Case("doctor_text", f"doctor {S}/lane_drive.parquet"),
    Case("doctor_rav4", f"doctor {RAV4_LOG} {RAV4_CAR} --json"),
    Case("doctor_porsche", f"doctor {PORSCHE} {PORSCHE_CAR} --json"),
    Case("doctor_canedge", f"doctor {CANEDGE_LOG} --json"),
    Case("detect_mf4", f"detect {S}/lane_drive.mf4 {CAR} --json -o {{o}}/out --write {{o}}/drive.mf4"),
    Case("detect_mcap", f"detect {S}/lane_drive.mcap {CAR} --signals {S}/map_mcap.toml --json --write {{o}}/d.mcap"),
    Case("detect_csv", f"detect {S}/lane_drive.csv {CAR} --signals {S}/map_csv.toml --json --write {{o}}/drive.csv"),
    Case("detect_parquet", f"detect {S}/lane_drive.parquet {CAR} --json --write {{o}}/drive.parquet"),
    Case("detect_text", f"detect {S}/lane_drive.mf4 {CAR} --verbose"),
    Case("detect_no_vehicle", f"detect {S}/lane_drive.mf4 --json --rate 50"),
    Case("detect_fail_on_event", f"detect {S}/lane_drive.parquet {CAR} --json --fail-on-event"),
    Case("detect_thresholds", f"detect {S}/lane_drive.mf4 {CAR} --thresholds given/thresholds.toml --json"),
    Case("detect_model", f"detect {S}/loaded_friday.parquet {CAR} --model given/model.toml --json"),
    Case("detect_history", f"detect {MONDAY} --history {{o}}/history.json --configuration four --json"),
    Case("detect_cache", f"detect {S}/lane_drive.mf4 {CAR} --cache --json"),
    Case("cache", "cache --json", only=("drives",)),
    Case("cache_clean", "cache --clean --json", only=("drives",)),
    Case("detect_no_such_log", f"detect {S}/no_such_log.mf4 {CAR} --json"),
    Case("detect_rav4", f"detect {RAV4_LOG} {RAV4_CAR} --json -o {{o}}/out"),
    Case("detect_porsche", f"detect {PORSCHE} {PORSCHE_CAR} --json -o {{o}}/out"),
    Case("detect_bmw", f"detect {BMW}/TripA11.csv {BMW_CAR} --json -o {{o}}/out"),
    Case("detect_canedge", f"detect {CANEDGE_LOG} --json"),
    Case("convert_mf4", f"convert {S}/lane_drive.csv --signals {S}/map_csv.toml {CAR} -o {{o}}/drive.mf4"),
    Case("convert_mcap", f"convert {S}/lane_drive.parquet {CAR} -o {{o}}/drive.mcap"),
    Case("convert_csv", f"convert {S}/lane_drive.mf4 {CAR} -o {{o}}/drive.csv --decimal-comma --rate 50"),
    Case("convert_parquet", f"convert {S}/lane_drive.mcap --signals {S}/map_mcap.toml {CAR} -o {{o}}/drive.parquet"),
    Case("convert_rav4", f"convert {RAV4_LOG} {RAV4_CAR} -o {{o}}/drive.parquet"),
    Case("align_rav4", f"align {RAV4}/speed.csv {RAV4}/gnss.csv --json --write-map {{o}}/map.toml"),
    Case(
        "align_porsche",
        f"align {PORSCHE}/gps_10Hz.csv {PORSCHE}/wheels_10Hz.csv --signals cars/porsche_map.toml --json "
        "--write-map {o}/map.toml",
    ),
    Case("align_text", f"align {RAV4}/speed.csv {RAV4}/gnss.csv"),
    Case("slip_slope", f"slip-slope {MONDAY} --json -o {{o}}/out"),
    Case("slip_slope_text", f"slip-slope {S}/loaded_friday.parquet {CAR} --method velocity --delay 0.0"),
    Case("slip_slope_wet", f"slip-slope {S}/lane_drive.mf4 {CAR} --json"),
    Case(
        "slip_slope_porsche",
        f"slip-slope {PORSCHE} --vehicle cars/porsche.toml --signals cars/porsche_slope_map.toml "
        "--traction accelerometer --mu-max 0.5 --json -o {o}/out",
    ),
    Case("calibrate", f"calibrate {LOADED} {CAR} --json -o {{o}}/car.toml"),
    Case("calibrate_text", f"calibrate {LOADED} {CAR} --fix mass=1890 --page {{o}}/page.html"),
    Case(
        "calibrate_bmw",
        f"calibrate {BMW}/TripA05.csv {BMW}/TripA10.csv {BMW}/TripA11.csv {BMW}/TripB26.csv {BMW_RAW} --json "
        "-o {o}/car.toml",
    ),
    Case(
        "diagnose",
        f"diagnose {MONDAY} --holdout {S}/loaded_friday.parquet --surrogates 9 --json -o {{o}}/model.toml --page {{o}}/page.html",
    ),
    Case("validate", f"validate {S}/lane_drive.mf4 {CAR} --no-why --json"),
    Case("validate_text", f"validate {LOADED} {CAR} --no-why --method 18571"),
    Case("watch", f"watch {S} --campaign {THESIS} --once --json", keep="none/*"),
    Case("diagnose_text", f"diagnose {S}/loaded_friday.parquet {CAR} --no-bootstrap"),
    Case("diagnose_model", f"diagnose {MONDAY} --model given/model.toml --no-bootstrap --json"),
    Case("diagnose_wet", f"diagnose {S}/lane_drive.mf4 {CAR} --no-bootstrap --json"),
    Case(
        "diagnose_rav4",
        f"diagnose {RAV4_LOG} --vehicle cars/toyota.toml --signals cars/diagnose_toyota_wrong_map.toml "
        "--no-bootstrap --json",
    ),
    Case(
        "diagnose_porsche",
        f"diagnose {PORSCHE} --vehicle cars/porsche.toml --signals cars/diagnose_porsche_map.toml --no-bootstrap --json",
        is_long=True,
    ),
    Case(
        "diagnose_bmw", f"diagnose {BMW}/TripB24.csv {BMW_CAR} --no-bootstrap --json -o {{o}}/model.toml", is_long=True
    ),
    Case("evaluate_drive", f"evaluate {S}/lane_drive.mf4 {CAR} --labels given/labels.csv --json"),
    Case("simulate_mf4", f"simulate {S}/scenario.toml -o {{o}}/drive.mf4 --json"),
    Case("simulate_csv", f"simulate {S}/scenario.toml --seed 3 --model given/model.toml -o {{o}}/drive.csv"),
    Case("simulate_mcap", f"simulate {S}/scenario.toml -o {{o}}/drive.mcap"),
    Case("simulate_parquet", f"simulate {S}/scenario.toml -o {{o}}/drive.parquet"),
)

PROGRAMMES = (
    Case("simulate_situations", "simulate campaign situations -o situations --jobs 2"),
    Case("simulate_thesis", "simulate campaign thesis -o thesis --jobs 2"),
    Case("simulate_braking", "simulate campaign braking-test -o braking --jobs 2"),
)

CAMPAIGNS = (
    Case("inspect_campaign", f"inspect {THESIS} --json"),
    Case("inspect_campaign_text", f"inspect {THESIS}"),
    Case("plan", f"plan {THESIS} --json --sample 2", only=("logs", "measured", "formats", "in_store", "to_measure")),
    Case("batch", f"batch {THESIS} -o {{o}}/store --json", keep="store/**/*"),
    Case("batch_shard", f"batch {THESIS} -o {{o}}/store --shard 1/3 --json", keep="store/*.parquet"),
    Case("batch_logs", f"batch {S}/lane_drive.mf4 {MONDAY} -o {{o}}/store --json"),
    Case("bin_slipslope", f"bin-slipslope {THESIS} --json -o {{o}}/rows.csv"),
    Case("bin_slipslope_by", f"bin-slipslope {THESIS} --by tyre,pressure,water-depth --robust --json"),
    Case("bin_slipslope_dry", f"bin-slipslope {THESIS} --by tyre --road both --bin-width 20"),
    Case("bin_resistance", f"bin-resistance {THESIS} --json -o {{o}}/rows.parquet"),
    Case("bin_resistance_text", f"bin-resistance {THESIS} --by tyre --as-measured --robust"),
    Case("report", f"report {THESIS} -o {{o}}/report"),
    Case("evaluate", f"evaluate {THESIS} --by tyre --rivals --roc --json -o {{o}}/page.html"),
    Case("evaluate_tune", f"evaluate {THESIS} --tune {{o}}/thresholds.toml --json"),
    Case("evaluate_text", f"evaluate {THESIS}"),
    Case("evaluate_situations", "evaluate situations/campaign.toml --json"),
    Case("test_straight_drive", f"test straight {S}/lane_drive.mf4 {CAR} --json"),
    Case("test_braking", "test braking braking/campaign.toml --control worn_summer --json -o {o}/out"),
    Case("diagnose_campaign", f"diagnose {THESIS} --surrogates 9 --json --page {{o}}/page.html"),
    Case("figures_campaign", f"figures 2 --campaign {THESIS} -o {{o}} --format csv --json"),
    Case("figures_2", "figures 2 -o {o} --format csv --json"),
    Case("figures_3", "figures 3 -o {o} --format csv --json"),
    Case("campaign_init", "campaign init thesis/logs -o {o}/campaign.toml --json"),
    Case("campaign_init_samples", f"campaign init {S} -o {{o}}/campaign.toml --json"),
    Case("campaign_init_bmw", f"campaign init {BMW} -o {{o}}/campaign.toml --json"),
    Case("inspect_trips", f"inspect {TRIPS} --json"),
    Case("batch_trips", f"batch {TRIPS} -o {{o}}/store --json"),
    Case("bin_resistance_trips", f"bin-resistance {TRIPS} --road dry --by load --json"),
    Case("evaluate_trips", f"evaluate {TRIPS} --json"),
    Case("reproduce", "reproduce -o {o} --jobs 2 --json", keep="*.json", is_long=True),
)


def _damaged() -> tuple[Case, ...]:
    """A hundred of the damaged logs, drawn over all formats: every other one is inspected, the others go through `detect`."""
    lots = Random(11)
    by_format = {name: lots.sample(range(DAMAGED_EACH), k=DAMAGED_EACH) for name in FORMATS}
    drawn = [(name, numbers[k]) for k in range(DAMAGED_EACH) for name, numbers in by_format.items()][:100]
    return tuple(
        Case(
            f"damaged_{folder_of(name)}_{number}",
            f"{'detect' if number % 2 else 'inspect'} {DAMAGED}{folder_of(name)}/{number} --json",
            is_digest=True,
        )
        for name, number in sorted(drawn)
    )


CASES = (*ONE_DRIVE, *PROGRAMMES, *CAMPAIGNS, *_damaged())
