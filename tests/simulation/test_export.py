"""Exported runs: each format is read back to the bit, by its own reader; hostile names and numbers included."""

from __future__ import annotations

import csv
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import Outcome, Reason, RunFileError
from robot_dyn.simulation.results.formats import tables

NAMES = ('a, "b"', "c\nd/ü [rad]")
NUMBERS = [-0.0, np.nan, np.inf, -np.inf, 5e-324, 1 / 3, np.pi * 1e300, 0.1 + 0.2]
PACKAGES = {"parquet": "pyarrow", "nc": "xarray", "mcap": "mcap_ros2"}


@pytest.fixture(scope="module")
def tame() -> rd.Trajectory:
    goal = rd.control.quintic([0.1, 0.3], [0.4, -0.2], 0.5)
    plant = rd.Plant(rd.load("cart_pole"), [rd.effects.ViscousFriction([0.4, 0.05])])
    return rd.simulate(
        plant, [0.11, 0.32], [0.2, -0.4], duration_s=0.1, controller=rd.control.PD(goal, kp=90.0, kd=9.0)
    )


@pytest.fixture(scope="module")
def hostile(tame) -> rd.Trajectory:
    """As of a run that diverged, with names that formats could take for their own signs."""
    rng, shape = np.random.default_rng(3), tame.q.shape
    q, v, u = (np.where(rng.random(shape) < 0.3, rng.choice(NUMBERS, shape), rng.normal(size=shape)) for _ in range(3))
    power = {"control": u[:, 0], 'a "b", c\n/d': v[:, 0], "a b c d": q[:, 0]}
    end = Outcome(Reason.STATE_OVERFLOWS, float(tame.t[-1]))
    return replace(tame, joint_names=NAMES, q=q, v=v, u=u, power=power, outcome=end)


@pytest.fixture(scope="module")
def batch() -> rd.Rollouts:
    setup = rd.Setup(rd.Plant(rd.load("cart_pole")), [0.1, 0.3], [0.2, -0.4], 0.05, method="RK4")
    swept = {"gravity": [[0.0, 0.0, -9.81], [0.1, 1 / 3, -1.6]]}
    return replace(rd.rollouts(setup, vary=swept, record=("q", "v", "energy")), joint_names=NAMES)


@pytest.fixture(params=["tame", "hostile"])
def run(request) -> rd.Trajectory:
    return request.getfixturevalue(request.param)


def same(after, before) -> None:
    """To the bit, but for the bits of nan."""
    after, before = np.asarray(after), np.asarray(before)
    np.testing.assert_array_equal(after, before)
    if before.dtype == float:
        some = ~np.isnan(before)
        np.testing.assert_array_equal(np.signbit(after)[some], np.signbit(before)[some])


@pytest.mark.parametrize("of", ["tame", "hostile", "batch"])
def test_csv_is_the_table(of: str, request, tmp_path: Path) -> None:
    of = request.getfixturevalue(of)
    with of.save(tmp_path / "x.csv").open(encoding="utf-8", newline="") as stream:
        heading, *rows = csv.reader(stream)
    table = of.table()
    assert heading == list(table)
    for values, column in zip(table.values(), zip(*rows, strict=True), strict=True):
        same([values.dtype.type(x) for x in column], values)


@pytest.mark.parametrize("of", ["tame", "hostile", "batch"])
def test_parquet_is_the_table_with_units(of: str, request, tmp_path: Path) -> None:
    parquet, of = pytest.importorskip("pyarrow.parquet"), request.getfixturevalue(of)
    back, table = parquet.read_table(of.save(tmp_path / "x.parquet")), of.table()
    assert back.column_names == list(table)
    for heading, values in table.items():
        same(back[heading].to_numpy(), values)
    for field in back.schema:
        quantity, of_what, unit = (field.metadata[key].decode() for key in (b"quantity", b"of", b"unit"))
        assert field.name == " ".join(filter(None, (quantity, of_what, unit and f"[{unit}]")))
    about = {key.decode(): text.decode() for key, text in back.schema.metadata.items()}
    assert about["robot"] == "cart_pole" and about.get("settings") == of.metadata.get("settings")
    assert about["summary"].splitlines()[0] == of.summary.splitlines()[0]


@pytest.mark.parametrize("of", ["tame", "hostile", "batch"])
def test_netcdf_is_the_dataset(of: str, request, tmp_path: Path) -> None:
    """Integers are of 32 bits there, and come back equal."""
    xarray, of = pytest.importorskip("xarray"), request.getfixturevalue(of)
    with xarray.open_dataset(of.save(tmp_path / "x.nc"), engine="scipy") as back:
        data = of.to_xarray()
        assert set(back.variables) == set(data.variables) and back.attrs == data.attrs
        for name, x in data.variables.items():
            same(back[name].values, x.values)
            assert back[name].dims == x.dims and back[name].attrs == x.attrs


def test_mcap_holds_the_messages_by_its_own_reader(run, tmp_path: Path) -> None:
    """Numbers to the bit, times to 1 ns, in the order of time; joint names in each message."""
    reader, decoder = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")
    with run.save(tmp_path / "x.mcap").open("rb") as stream:
        log = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        told = [(c.topic, s.name, m.log_time, x) for s, c, m, x in log.iter_decoded_messages()]
        (record,) = log.iter_metadata()
    of = {topic: [x for name, _, _, x in told if name == topic] for topic, *_ in told}
    assert {kind for topic, kind, _, _ in told if "joint_states" in topic} == {"sensor_msgs/msg/JointState"}
    assert [ns for *_, ns, _ in told] == sorted(ns for *_, ns, _ in told)
    states = of.pop("/joint_states")
    for x, t in zip(states, run.t, strict=True):
        assert abs(x.header.stamp.sec + x.header.stamp.nanosec * 1e-9 - t) <= 0.51e-9
        assert tuple(x.name) == run.joint_names
    for field, key in (("position", "q"), ("velocity", "v"), ("effort", "u")):
        same([getattr(x, field) for x in states], getattr(run, key))
    desired = of.pop("/desired/joint_states")
    same([x.position for x in desired], run.desired)
    assert not any(x.velocity or x.effort for x in desired)
    for name in [each for each in of if each.startswith("/causes/")]:
        assert not any(x.position or x.velocity for x in of.pop(name))
    same([x.data for x in of.pop("/energy")], run.ledger.energy)
    same([x.data for x in of.pop("/residual")], run.ledger.residual)
    for x, power in zip(of.values(), run.power.values(), strict=True):  # a topic for each, whatever its name
        same([each.data for each in x], power)
    assert record.name == "robot_dyn" and record.metadata["robot"] == "cart_pole"
    assert f"u {run.joint_names[1]} [{record.metadata[f'unit of u {run.joint_names[1]}']}]" in run.table()


def test_causes_in_a_log_add_up_to_the_effort(tame, tmp_path: Path) -> None:
    """The torques of the run's causes to the bit; their sum is u to rounding. A run without them says so."""
    reader, decoder = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")

    def of(run: rd.Trajectory) -> tuple[dict[str, np.ndarray], dict[str, str]]:
        with run.save(tmp_path / "x.mcap").open("rb") as stream:
            log = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
            found: dict[str, list] = {}
            for _, channel, _, x in log.iter_decoded_messages():
                if channel.topic.startswith("/causes/"):
                    assert tuple(x.name) == run.joint_names
                    found.setdefault(channel.topic.removeprefix("/causes/"), []).append(x.effort)
            return {name: np.array(each) for name, each in found.items()}, next(log.iter_metadata()).metadata

    efforts, about = of(tame)
    torques = tame.causes().torques
    assert efforts.keys() == torques.keys() == {"inertia", "Coriolis", "gravity", "viscous_friction"}
    for name, torque in torques.items():
        same(efforts[name], torque)
    np.testing.assert_allclose(sum(efforts.values()), tame.u, atol=1e-12)
    assert "causes" not in about
    none, about = of(replace(tame, effect_torques=None))
    assert none == {} and "contains no torques of its effects" in about["causes"]


def test_mcap_is_read_by_rerun(tame, tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    rerun = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not of the development environment")
    log = rerun.McapReader(tame.save(tmp_path / "x.mcap"), timeline_type="duration_ns")
    chunks = [
        each.to_record_batch() for each in log.stream().to_chunks() if each.entity_path == "/joint_states/position"
    ]
    rows = [row for batch in chunks if "Scalars:scalars" in batch.schema.names for row in batch.to_pylist()]
    rows.sort(key=lambda row: row["message_log_time"])
    same([row["Scalars:scalars"] for row in rows], tame.q)


@pytest.mark.parametrize(
    ("of", "suffix", "message"),
    [
        ("batch", "mcap", r"a log contains one run, .*runs\[0\]"),
        ("late", "mcap", "stamps of ROS 2 end"),
        ("tame", "nc", "more than the 2 GiB of netCDF-3; write"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(of: str, suffix: str, message: str, tame, batch, tmp_path, monkeypatch):
    pytest.importorskip(PACKAGES[suffix])
    monkeypatch.setattr(tables, "_LARGEST", tame.q.nbytes - 1)
    runs = {"batch": batch, "late": replace(tame, t=tame.t + 2.0**31), "tame": tame}
    with pytest.raises(RunFileError, match=message):
        runs[of].save(tmp_path / f"x.{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_many_samples_are_written_in_blocks(tame, tmp_path: Path) -> None:
    """A table as Python's numbers and text would take ten times its arrays; a block of rows takes some megabytes."""
    m = 60_000
    t, x = np.linspace(0, 1, m), np.random.default_rng(2).normal(size=(m, 2))
    ledger = replace(tame.ledger, kinetic=t, potential=t, work={})
    long = replace(tame, t=t, q=x, v=x, a=x, u=x, desired=x, power={}, ledger=ledger)
    tracemalloc.start()
    long.save(tmp_path / "x.csv")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2 * sum(each.nbytes for each in long.table().values())


@pytest.mark.parametrize("suffix", PACKAGES)
def test_its_own_kind_is_replaced_and_no_other(tame, tmp_path: Path, suffix: str) -> None:
    pytest.importorskip(PACKAGES[suffix])
    path = tame.save(tmp_path / f"x.{suffix}")
    assert tame.save(path) == path
    path.write_text("robot = 'pendulum'")
    with pytest.raises(RunFileError, match="so it is not replaced"):
        tame.save(path)


BLOCKED = """
import sys
sys.modules.update(dict.fromkeys(("pandas", "xarray", "pyarrow", "mcap", "mcap_ros2", "h5netcdf", "rerun")))
import robot_dyn as rd
run = rd.simulate(rd.Plant(rd.load("pendulum")), [0.1], duration_s=0.01)
runs = rd.rollouts(rd.Plant(rd.load("pendulum")), [0.1], duration_s=0.01, method="RK4")
calls = [of.to_pandas for of in (run, runs)] + [of.to_xarray for of in (run, runs)]
for call in calls + [lambda to=to: run.save(f"{sys.argv[1]}/x.{to}") for to in ("parquet", "nc", "mcap")]:
    try:
        call()
    except rd.RobotDynError as error:
        print(error)
print(run.save(f"{sys.argv[1]}/x.csv").name, len(run.table()) > 4, len(runs.table()) > 4)
"""


def test_without_extras_each_call_says_which_it_needs_and_tables_need_none(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", BLOCKED, tmp_path], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    missing = ["pandas", "pandas", "xarray", "xarray", "pyarrow", "xarray", "mcap"]
    install = "is not installed: pip install 'robot-dyn[data]'"
    assert done.stdout.splitlines() == [*(f"{each} {install}" for each in missing), "x.csv True True"]
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
