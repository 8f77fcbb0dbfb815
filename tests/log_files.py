"""Writes logs of every format, columns by name; what a format needs and is not installed skips the test."""

import json
import sqlite3

import h5py
import numpy as np
import pytest
from scipy.io import savemat

JOINTS = ("base", "elbow")


def write_csv(path, columns, text="{:.17g}"):
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(text.format(x) for x in row) for row in rows)]) + "\n")
    return path, dict(zip(columns, columns, strict=True))


def write_twincat(path, columns):
    """An export of TwinCAT 3 Scope: a time in ms before each channel, decimal commas."""
    step_ms, names = 1.0, list(columns)
    head = [
        ["Name", "Scope"],
        ["File", "C:\\scope.csv"],
        ["Starttime of export", "132959733843760000", "Montag, 2. Mai 2022"],
    ]
    told = {"Name": names, "SampleTime[ms]": ["1"] * len(names), "Unit": ["(None)"] * len(names)}
    rows = [[cell for one in cells for cell in (key, one)] for key, cells in told.items()]
    lines = [*head, [], [], *rows, []]
    for index, values in enumerate(zip(*columns.values(), strict=True)):
        lines.append([cell for x in values for cell in (f"{index * step_ms:g}", f"{x:.17g}".replace(".", ","))])
    path.write_text("\n".join("\t".join(line) for line in [*lines, ["EOF"]]) + "\n")
    return path, dict(zip(columns, columns, strict=True))


def write_lvm(path, columns, units=None):
    """A LabVIEW measurement file of two segments, each with a head, without columns of time."""
    names, length = list(columns), len(next(iter(columns.values())))
    lines = ["LabVIEW Measurement\t", "Separator\tTab", "Decimal_Separator\t,", "Multi_Headings\tYes", "X_Columns\tNo"]
    lines += ["Date\t2022/05/02", "Time\t15:56:24,376", "***End_of_Header***\t", "\t"]
    for first, stop in ((0, length // 2), (length // 2, length)):
        told = {
            "Samples": stop - first,
            "Date": "2022/05/02",
            "Time": f"15:56:{24.376 + first * 1e-3:.9f}".replace(".", ","),
        }
        told |= {"X_Dimension": "Time", "X0": "0,0000E+0", "Delta_X": "0,001000"}
        lines += [
            f"Channels\t{len(names)}\t",
            *("\t".join([key, *[str(one)] * len(names), ""]) for key, one in told.items()),
        ]
        lines.append("\t".join(["Y_Unit_Label", *((units or {}).get(name, "V") for name in names), ""]))
        lines += ["***End_of_Header***" + "\t" * len(names), "\t".join(["X_Value", *names, "Comment"])]
        rows = zip(*(x[first:stop] for x in columns.values()), strict=True)
        lines += ["\t".join(["", *(f"{x:.17g}".replace(".", ",") for x in row)]) for row in rows]
        lines.append("")
    path.write_text("\r\n".join(lines))
    return path, dict(zip(columns, columns, strict=True))


def write_mat(path, columns):
    savemat(path, {"log": {name: x[:, None] for name, x in columns.items()}}, do_compression=True)
    return path, {name: f"log.{name}" for name in columns}


def write_mat_hdf5(path, columns):
    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, x in columns.items():
            log.create_dataset(name, data=x[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    header = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(header + path.read_bytes()[128:])
    return path, {name: f"log.{name}" for name in columns}


def write_hdf5(path, columns, units=None):
    with h5py.File(path, "w") as file:
        for name, x in columns.items():
            file.create_dataset(f"drive/{name}", data=x, compression="gzip").attrs["units"] = (units or {}).get(
                name, "V"
            )
    return path, {name: f"drive/{name}" for name in columns}


def write_parquet(path, columns):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    pq.write_table(pa.table(columns), path, row_group_size=300)
    return path, dict(zip(columns, columns, strict=True))


def write_arrow(path, columns):
    pa = pytest.importorskip("pyarrow")
    table = pa.table(columns)
    options = pa.ipc.IpcWriteOptions(compression="lz4")
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=300)
    return path, dict(zip(columns, columns, strict=True))


def write_npz(path, columns):
    np.savez_compressed(path, robot="arm", **columns)
    return path, dict(zip(columns, columns, strict=True))


def write_npy(path, columns):
    table = np.rec.fromarrays(list(columns.values()), names=list(columns))
    np.save(path, table)
    return path, dict(zip(columns, columns, strict=True))


def write_json(path, columns):
    path.write_text(json.dumps({"robot": "arm", "log": {name: x.tolist() for name, x in columns.items()}}, indent=1))
    return path, {name: f"log.{name}" for name in columns}


def write_json_lines(path, columns):
    rows = zip(*(x.tolist() for x in columns.values()), strict=True)
    made = (json.dumps({"state": "run", "drive": dict(zip(columns, row, strict=True))}) for row in rows)
    path.write_text("\n".join(made) + "\n")
    return path, {name: f"drive.{name}" for name in columns}


def write_tdms(path, columns, units=None):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        told = {name: {"wf_increment": 1e-3, "unit_string": (units or {}).get(name, "V")} for name in columns}
        writer.write_segment([nptdms.ChannelObject("drive", name, x, told[name]) for name, x in columns.items()])
    return path, {name: f"drive/{name}" for name in columns}


def write_mdf(path, columns):
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(len(next(iter(columns.values())))) * 1e-3
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(samples=x, timestamps=time, name=name, unit="V") for name, x in columns.items()])
        file.save(path)
    return path, dict(zip(columns, columns, strict=True))


def _messages(columns):
    """JointState messages, two columns a message, stamped every millisecond; and what each column is called."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = store.types
    state, header, stamp = (
        kinds[f"{kind}"]
        for kind in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    names = {"time": "/joint_states.header.stamp"}
    fields = ("position", "velocity", "effort")
    names |= {name: f"/joint_states.{fields[i // 2]}[{JOINTS[i % 2]}]" for i, name in enumerate(columns)}
    table = np.stack([*columns.values(), *[np.zeros(len(next(iter(columns.values()))))] * (6 - len(columns))], axis=1)
    for index, row in enumerate(table):
        time = 1_700_000_000 * 10**9 + index * 10**6
        told = header(stamp=stamp(sec=time // 10**9, nanosec=time % 10**9), frame_id="")
        message = state(header=told, name=list(JOINTS), **{f: row[2 * i : 2 * i + 2] for i, f in enumerate(fields)})
        yield store, time, bytes(store.serialize_cdr(message, "sensor_msgs/msg/JointState")), names


def write_mcap(path, columns):
    writer_module = pytest.importorskip("mcap.writer")
    with path.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start(profile="ros2", library="")
        channel = other = None
        for store, time, raw, names in _messages(columns):  # noqa: B007
            if channel is None:
                text, _ = store.generate_msgdef("sensor_msgs/msg/JointState", ros_version=2)
                schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", text.encode())
                channel = writer.register_channel("/joint_states", "cdr", schema)
                plain = writer.register_schema("state", "jsonschema", b"{}")
                other = writer.register_channel("/plc", "json", plain)
                secret = writer.register_channel("/secret", "protobuf", plain)
            writer.add_message(channel, time, raw, time)
            writer.add_message(other, time, json.dumps({"drive": {"current": time % 7}}).encode(), time)
        writer.add_message(secret, time, b"?", time)
        writer.finish()
    return path, names


def write_rosbag(path, columns):
    with sqlite3.connect(path) as file:
        file.execute("create table topics(id integer primary key, name text, type text, serialization_format text)")
        file.execute("create table messages(id integer primary key, topic_id integer, timestamp integer, data blob)")
        file.execute("insert into topics values (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')")
        file.execute("insert into topics values (2, '/own', 'my_msgs/msg/Own', 'cdr')")
        for _, time, raw, names in _messages(columns):  # noqa: B007
            file.execute("insert into messages(topic_id, timestamp, data) values (1, ?, ?)", (time, raw))
    file.close()
    return path, names


WRITERS = {
    "csv": (write_csv, "log.csv"),
    "csv TwinCAT": (write_twincat, "log.csv"),
    "csv LabVIEW": (write_lvm, "log.lvm"),
    "mat": (write_mat, "log.mat"),
    "mat 7.3": (write_mat_hdf5, "log.mat"),
    "hdf5": (write_hdf5, "log.h5"),
    "npz": (write_npz, "log.npz"),
    "npz NPY": (write_npy, "log.npy"),
    "parquet": (write_parquet, "log.parquet"),
    "arrow": (write_arrow, "log.feather"),
    "json": (write_json, "log.json"),
    "json lines": (write_json_lines, "log.jsonl"),
    "tdms": (write_tdms, "log.tdms"),
    "mdf": (write_mdf, "log.mf4"),
    "mcap": (write_mcap, "log.mcap"),
    "rosbag": (write_rosbag, "log.db3"),
}
"""By the format's name: a function of path and columns, which returns the path and each column's name; a file name."""


def make_columns(n_sample=700):
    time = np.arange(n_sample) * 1e-3
    rng = np.random.default_rng(3)
    return {"q": 2 + time**2, "tau": rng.normal(size=n_sample), "speed": 2 * time, "told": np.sin(9 * time)}
