"""Predictions out as MCAP: read by the packages of the format's and of ROS 2's makers, they are the numbers of the CSV."""

import csv
import math

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from conftest import ASSETS, fit, twincal
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

QUICK = """[library]
terms = ["sin(q2)"]
generic = false
friction = ["viscous"]
offset = false
motor_inertia = false
"""
TOPICS = {"measured": "tau_meas", "nominal": "tau_nom", "calibrated": "tau", "low95": "tau_low95", "high95": "tau_high95"}


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    """A folder with the same prediction as CSV and as MCAP."""
    folder = tmp_path_factory.mktemp("predicted")
    fit(folder, [ASSETS / "train1.parquet"], QUICK, expect=None)
    for name in ["predicted.csv", "predicted.mcap"]:
        twincal("predict", ASSETS / "heldout1.parquet", "--twin", folder / "out", "-o", folder / name, expect=None)
    return folder


def test_mcap_is_the_csv(predicted):
    with open(predicted / "predicted.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 100
    counts = dict.fromkeys([*TOPICS, "extrapolating"], 0)
    with open(predicted / "predicted.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic.removeprefix("/twincal/")
            row = rows[counts[topic]]
            counts[topic] += 1
            ns = round(float(row["t"]) * 1e9)
            assert message.log_time == ns
            if topic == "extrapolating":
                assert schema.name == "std_msgs/msg/Bool"
                assert decoded.data == (row["extrapolating"] == "true")
                continue
            assert schema.name == "sensor_msgs/msg/JointState"
            assert decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec == ns
            assert list(decoded.position) == list(decoded.velocity) == []
            assert len(decoded.name) == len(decoded.effort) == 2
            for joint, effort in zip(decoded.name, decoded.effort):
                cell = float(row[f"{joint}.{TOPICS[topic]}"])
                assert effort == cell or math.isnan(effort) and math.isnan(cell)
    assert set(counts.values()) == {len(rows)}, counts


def earlier(folder, name, seconds):
    """The held-out log with its clock set back."""
    table = pq.read_table(ASSETS / "heldout1.parquet")
    time = pc.subtract(table["t"], seconds)
    pq.write_table(table.set_column(table.column_names.index("t"), "t", time), folder / name)
    return folder / name


def test_time_that_mcap_cannot_hold_is_refused(predicted, tmp_path):
    def predict(log, out, expect):
        return twincal("predict", log, "--twin", predicted / "out", "-o", tmp_path / out, expect=expect)

    refused = predict(earlier(tmp_path, "early.parquet", 5.0), "out.mcap", 2)
    assert "cannot stand in an MCAP file" in refused.stderr and "write .parquet or .csv" in refused.stderr
    assert not (tmp_path / "out.mcap").exists()
    predict(tmp_path / "early.parquet", "out.csv", None)
    with open(tmp_path / "out.csv", newline="") as file:
        assert float(next(csv.DictReader(file))["t"]) < 0
    # Rows that filters take are not written: their times do not count.
    predict(earlier(tmp_path, "border.parquet", 0.05), "border.mcap", None)


PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<link name="tip"/><joint name="hand" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0.6 0 0"/></joint>
<joint name="turn" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>
"""


def swing(folder, name, seed, load):
    """The pendulum in motion with so many kg at its tip: its torque is (0.02 + 2 · 0.3² + load · 0.6²) q̈ − 9.81 (0.6 + 0.6 load) cos q + friction."""
    rng = np.random.default_rng(seed)
    t, (a, b) = np.arange(0.0, 20.0, 0.01), rng.uniform(1.0, 2.0, 2)
    q, qd = 0.9 * np.sin(a * t) + 0.4 * np.sin(3 * b * t), 0.9 * a * np.cos(a * t) + 1.2 * b * np.cos(3 * b * t)
    qdd = -0.9 * a * a * np.sin(a * t) - 3.6 * b * b * np.sin(3 * b * t)
    tau = (0.2 + 0.36 * load) * qdd - 9.81 * 0.6 * (1.0 + load) * np.cos(q) + 0.4 * qd + rng.normal(scale=0.05, size=t.size)
    table = {"t": t, "turn.q": q, "turn.qd": qd, "turn.qdd": qdd, "turn.tau": tau}
    pq.write_table(pa.table(table), folder / name)


def test_an_unknown_payload_acts_where_the_settings_say_so(tmp_path):
    """Half a kilogram carried in some logs: predicted and checked with it where `[[log]]` says `payload = "unknown"`, without it elsewhere."""
    (tmp_path / "pendulum.urdf").write_text(PENDULUM)
    logs = [tmp_path / name for name in ("bare.parquet", "loaded.parquet", "other.parquet")]
    for seed, (log, load) in enumerate(zip(logs, (0.0, 0.5, 0.5))):
        swing(tmp_path, log.name, seed, load)
    unknown = "".join(f'[[log]]\nfile = "{log.name}"\npayload = "unknown"\n' for log in logs[1:])
    (tmp_path / "twincal.toml").write_text('[library]\nfamilies = ["payload", "viscous"]\n' + unknown)
    settings = ("--config", tmp_path / "twincal.toml")
    twincal("fit", *logs[:2], "--model", tmp_path / "pendulum.urdf", *settings, "-o", tmp_path / "out", expect=None)
    errors = {}
    for name, given, code in (("with", settings, 0), ("without", (), 1)):
        out = tmp_path / f"{name}.csv"
        twincal("predict", logs[2], "--twin", tmp_path / "out", *given, "-o", out, expect=None)
        with open(out, newline="") as file:
            rows = [(float(row["turn.tau"]), float(row["turn.tau_meas"])) for row in csv.DictReader(file)]
        errors[name] = np.sqrt(np.mean(np.subtract(*zip(*rows)) ** 2))
        twincal("check", logs[2], "--twin", tmp_path / "out", *given, expect=code)
    assert errors["with"] < 0.1 and errors["without"] > 0.9, errors
