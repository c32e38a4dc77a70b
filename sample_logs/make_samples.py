"""Make the sample logs again: `python sample_logs/make_samples.py [FOLDER]`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from aqualog.config.scenario import load_scenario
from aqualog.config.vehicle import load_vehicle
from aqualog.core.notation import SYMBOLS, WHEELS
from aqualog.io.write_table import TableColumn, write_csv, write_parquet
from aqualog.model.effects import EFFECTS
from aqualog.model.log import START_NS, table_of, write_simulation
from aqualog.model.sensors import Channel
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term

HERE = Path(__file__).resolve().parent
ROS_TYPES = {
    "/imu/data": "sensor_msgs/msg/Imu",
    "/wheels": "sensor_msgs/msg/JointState",
    "/reference/velocity": "geometry_msgs/msg/TwistStamped",
    "/brake": "sensor_msgs/msg/FluidPressure",
    "/steering": "std_msgs/msg/Float64",
}


# two drives of the car with four people more in it than its vehicle file says
LOAD_KG = 290.0
LOADED = {  # seed, and speed over time [s, m/s]
    "loaded_monday": (11, (
        (0.0, 16.0), (10.0, 16.0), (30.0, 30.0), (55.0, 31.0), (75.0, 22.0), (95.0, 33.0), (125.0, 33.0),
        (150.0, 24.0),
    )),
    "loaded_friday": (12, (
        (0.0, 25.0), (20.0, 25.0), (35.0, 34.0), (60.0, 33.0), (90.0, 19.0), (105.0, 28.0), (140.0, 28.0),
        (150.0, 31.0),
    )),
}  # fmt: skip


def loaded_drive(name):
    """A dry drive with the load, 20 Hz: t [s], name -> samples."""
    seed, speed = LOADED[name]
    own = load_scenario(HERE / "scenario.toml")
    scenario = replace(
        own, lanes=(), duration_s=150.0, rate_hz=20.0, seed=seed, speed=speed, sensors=calibrated(own.sensors)
    )
    load = Model((Term(EFFECTS["payload_mass"], {"delta_mass": LOAD_KG}),))
    return columns_of(simulate(scenario, load))


def calibrated(sensors):
    """The sensors with their noise and resolution, without what calibration and time stamps take out."""
    for name, channel in sensors.channels.items():
        own = Channel(noise=channel.noise, resolution=channel.resolution)
        sensors = sensors.with_channel(name, own)
    return sensors


def sample_drive():
    """The drive over the lane on one time base, without the simulated truth: t [s], name -> samples."""
    return columns_of(simulate(load_scenario(HERE / "scenario.toml")))


def columns_of(simulation):
    """Measured signals of a simulation: t [s], name -> samples."""
    columns = {n: x for g in table_of(simulation) for n, (_, _, x) in g.columns.items()}
    rate = simulation.setup.scenario.rate_hz
    t = np.arange(next(iter(columns.values())).size) / rate
    return t, {n: x for n, x in columns.items() if not n.startswith("true_")}


def write_ros2(path, t, s):
    """Write ROS 2 messages into an MCAP file."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="aqualog")
        channels = {}
        for topic, name in ROS_TYPES.items():
            text, _ = store.generate_msgdef(name, ros_version=2)
            schema = writer.register_schema(name, "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for k, seconds in enumerate(t):
            t_ns = START_NS + round(seconds * 1e9)
            for topic, message in _messages(types, t_ns, {n: float(x[k]) for n, x in s.items()}).items():
                data = store.serialize_cdr(message, ROS_TYPES[topic])
                writer.add_message(channels[topic], t_ns, bytes(data), t_ns)
        writer.finish()


def _messages(types, t_ns, s):
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](t_ns // 10**9, t_ns % 10**9), "car")
    vector = types["geometry_msgs/msg/Vector3"]
    nothing = np.zeros(9)
    return {
        "/imu/data": types["sensor_msgs/msg/Imu"](
            header, types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), nothing,
            vector(0.0, 0.0, s["yaw_rate"]), nothing, vector(s["a_x"], s["a_y"], 9.81), nothing,
        ),
        "/wheels": types["sensor_msgs/msg/JointState"](
            header, list(WHEELS), np.zeros(4), np.array([s[f"omega_{w}"] for w in WHEELS]),
            np.array([s[f"torque_{w}"] for w in WHEELS]),
        ),
        "/reference/velocity": types["geometry_msgs/msg/TwistStamped"](
            header, types["geometry_msgs/msg/Twist"](vector(s["v_x"], 0.0, 0.0), vector(0.0, 0.0, 0.0))
        ),
        "/brake": types["sensor_msgs/msg/FluidPressure"](header, s["brake_pressure"], 0.0),
        "/steering": types["std_msgs/msg/Float64"](s["steer_angle"]),
    }  # fmt: skip


def csv_columns(t, s, ratio):
    """The drive as a German logger would name it."""
    rpm = {"fl": "VL", "fr": "VR", "rl": "HL", "rr": "HR"}
    return [
        TableColumn("Zeit", "s", np.round(t, 4)),
        TableColumn("v_Referenz", "km/h", np.round(s["v_x"] * 3.6, 5)),
        TableColumn("Laengsbeschleunigung", "g", np.round(s["a_x"] / 9.80665, 8)),
        TableColumn("Querbeschleunigung", "g", np.round(s["a_y"] / 9.80665, 8)),
        TableColumn("Gierrate", "deg/s", np.round(np.degrees(s["yaw_rate"]), 6)),
        TableColumn("Lenkradwinkel", "deg", np.round(np.degrees(s["steer_angle"]) * ratio, 6)),
        *(
            TableColumn(f"Raddrehzahl_{n}", "U/min", np.round(s[f"omega_{w}"] * 30.0 / np.pi, 6))
            for w, n in rpm.items()
        ),
        TableColumn("Achsmoment_VA", "Nm", np.round(s["torque_fl"] + s["torque_fr"], 4)),
        TableColumn("Achsmoment_HA", "Nm", np.round(s["torque_rl"] + s["torque_rr"], 4)),
        TableColumn("Bremsdruck", "bar", np.round(s["brake_pressure"] * 1e-5, 4)),
    ]


def main(folder):
    """Write all logs."""
    folder.mkdir(parents=True, exist_ok=True)
    t, s = sample_drive()
    simulation = simulate(load_scenario(HERE / "scenario.toml"))
    write_simulation(
        folder / "lane_drive.mf4", simulation, suffix=".mf4", comment="simulated drive over a watered lane"
    )
    write_ros2(folder / "lane_drive.mcap", t, s)
    write_csv(folder / "lane_drive.csv", csv_columns(t, s, load_vehicle(HERE / "vehicle.toml").steering_ratio),
              decimal_comma=True)  # fmt: skip
    columns = [TableColumn("t", "s", t), *(TableColumn(n, SYMBOLS[n].unit, x) for n, x in s.items())]
    write_parquet(folder / "lane_drive.parquet", columns, start_ns=START_NS)
    for name in LOADED:
        t, s = loaded_drive(name)
        columns = [TableColumn("t", "s", t), *(TableColumn(n, SYMBOLS[n].unit, x) for n, x in s.items())]
        write_parquet(folder / f"{name}.parquet", columns, start_ns=START_NS)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
