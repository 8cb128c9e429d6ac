"""Tables of runs: columns named by quantity, joint and unit, and the same numbers as DataFrame and Dataset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError

CART = rd.load("cart_pole")  # a joint that slides, and one that turns
GOAL = rd.control.quintic([0.1, 0.3], [0.4, -0.2], 0.5)
PLANT = rd.Plant(CART, [rd.effects.ViscousFriction([0.4, 0.05])])
SETUP = rd.Setup(PLANT, [0.11, 0.32], [0.2, -0.4], 0.3, rd.control.PD(GOAL, kp=90.0, kd=9.0))


@pytest.fixture(scope="module")
def run() -> rd.Trajectory:
    return rd.simulate(SETUP)


@pytest.fixture(scope="module")
def batch() -> rd.Rollouts:
    """Three runs, one of which diverges."""
    setup = replace(SETUP, method="RK4", step_s=5e-3, record_every_s=5e-3)
    runs = rd.rollouts(setup, vary={"kp": [90.0, 45.0, 1e8]}, record=("q", "v", "u", "energy", "work"))
    assert runs.diverged.tolist() == [False, False, True]
    return runs


def test_a_table_holds_the_samples_by_quantity_joint_and_unit(run) -> None:
    table = run.table()
    expected = {
        "t [s]": run.t,
        "q slide [m]": run.q[:, 0],
        "v hinge [rad/s]": run.v[:, 1],
        "a slide [m/s²]": run.a[:, 0],
        "u slide [N]": run.u[:, 0],
        "desired hinge [rad]": run.desired[:, 1],
        "power control [W]": run.power["control"],
        "power viscous_friction [W]": run.power["viscous_friction"],
        "energy [J]": run.ledger.energy,
        "residual [J]": run.ledger.residual,
    }
    assert len(table) == 1 + 5 * 2 + 4
    for heading, values in expected.items():
        np.testing.assert_array_equal(table[heading], values)


def test_a_frame_has_its_tracking_error_by_axis() -> None:
    arm = rd.load("planar_2r")
    q = np.array([0.4, 0.9])
    at = arm.placement(q, "tip")[:3, 3]
    line = rd.control.line(at, np.add(at, [0.1, 0, 0.1]), 0.2)
    controller = rd.control.OperationalSpace(arm, "tip", line, kp=50.0, kd=10.0, rows=(0, 2))
    run = rd.simulate(rd.Plant(arm), q, controller=controller, duration_s=0.02, estimate_error=False)
    assert run.desired is None
    np.testing.assert_array_equal(run.table()["tracking error y [m]"], run.tracking_error[:, 1])
    assert np.abs(run.tracking_error).max() > 0
    assert "desired" not in " ".join(run.table())


def test_a_row_of_a_batch_has_rms_and_extremes_up_to_the_end_of_its_run(batch) -> None:
    """√(mean v²) over the samples before a run diverges; extremes over the steps enclose those of the samples."""
    table, of_mean = batch.table(), 1e-14  # some units of rounding of a mean of 61 squares
    for key, unit in (("v", "m/s"), ("u", "N")):
        samples = getattr(batch, key)[:, :, 0]
        known = [x[~np.isnan(x)] for x in samples]
        assert len(known[2]) < len(known[0])
        with np.errstate(over="ignore"):
            expected = [float(np.sqrt(np.mean((x / np.abs(x).max()) ** 2)) * np.abs(x).max()) for x in known]
        np.testing.assert_allclose(table[f"rms {key} slide [{unit}]"], expected, rtol=of_mean)
        assert (table[f"least {key} slide [{unit}]"][:2] <= np.array([x.min() for x in known])[:2]).all()
        assert (table[f"largest {key} slide [{unit}]"][:2] >= np.array([x.max() for x in known])[:2]).all()
    assert table["outcome"].tolist() == ["finished", "finished", "diverged"]
    assert table["kp slide [N/m]"].tolist() == table["kp hinge [N m/rad]"].tolist() == [90.0, 45.0, 1e8]
    counts = [sum(run in each.runs for each in batch.remarks) for run in range(3)]
    assert table["number of remarks"].tolist() == counts


def test_what_was_swept_has_its_unit() -> None:
    """By joint where it is of joints, else numbered if it has several numbers; to the bit."""
    params = {
        "payload_mass:tip": [0.1, 0.2],
        "viscous_friction.viscous": [[0.4, 1 / 3], [0.5, 0.06]],
        "mass_scale": [1.0, 1.1],
        "gravity": [[0.0, 0.0, -9.81], [0.0, 0.0, -1.6]],
    }
    arm = rd.load("planar_2r").with_(payload=rd.Payload("tip", 0.1))
    plant = rd.Plant(arm, [rd.effects.ViscousFriction([0.4, 0.05])])
    table = rd.rollouts(plant, [0.3, 0.2], vary=params, duration_s=0.01).table()
    damping = [f"viscous_friction.viscous {name} [N m s/rad]" for name in arm.joint_names]
    gravity = [f"gravity {k} [m/s²]" for k in (1, 2, 3)]
    assert list(table)[1:8] == ["payload_mass:tip [kg]", *damping, "mass_scale", *gravity]
    np.testing.assert_array_equal(np.stack([table[name] for name in damping], 1), params["viscous_friction.viscous"])
    np.testing.assert_array_equal(np.stack([table[name] for name in gravity], 1), params["gravity"])


def test_a_run_that_recorded_nothing_has_no_rms() -> None:
    runs = rd.rollouts(replace(SETUP, method="RK4"), record=("q",), vary={"kp": [90.0, 45.0]})
    assert not [heading for heading in runs.table() if heading.startswith(("rms v", "rms u"))]


@pytest.mark.parametrize("of", ["run", "batch"])
def test_a_data_frame_is_the_table(of, request) -> None:
    pytest.importorskip("pandas")
    of = request.getfixturevalue(of)
    frame, table = of.to_pandas(), of.table()
    assert list(frame.columns) == list(table) and frame.attrs["robot"] == "cart_pole"
    for heading, values in table.items():
        np.testing.assert_array_equal(frame[heading].to_numpy(dtype=values.dtype), values)


def test_a_dataset_has_quantities_over_time_and_joint(run) -> None:
    pytest.importorskip("xarray")
    data = run.to_xarray()
    assert data.joint.values.tolist() == ["slide", "hinge"] and data.source.values.tolist() == [*run.power]
    for key in ("q", "v", "a", "u", "desired"):
        assert data[key].dims == ("t", "joint")
        np.testing.assert_array_equal(data[key], getattr(run, key))
    np.testing.assert_array_equal(data.power.sel(source="control"), run.power["control"])
    np.testing.assert_array_equal(data.sel(joint="hinge").q, run.q[:, 1])
    assert (data.q.units, data.u.units, data.t.units) == ("m or rad", "N or N m", "s")


def test_a_dataset_of_a_batch_has_table_and_samples(batch) -> None:
    pytest.importorskip("xarray")
    data = batch.to_xarray()
    for key in ("q", "v", "u", "kinetic"):
        np.testing.assert_array_equal(data[key], getattr(batch, key))
    np.testing.assert_array_equal(data.work_control, batch.work["control"])
    np.testing.assert_array_equal(data.largest_q.sel(joint="slide"), batch.table()["largest q slide [m]"])
    assert data.kp.dims[0] == "run" and data.outcome.dims == ("run",)


@pytest.mark.parametrize("call", ["table", "to_pandas", "to_xarray"])
def test_no_column_hides_another(run, call: str) -> None:
    """States of a controller, and of an effect of that name."""
    z = np.arange(float(len(run.t)))[:, None]
    both = replace(run, controller_states=z, effect_states={"controller": z + 1.0})
    if call != "table":
        pytest.importorskip(call.removeprefix("to_"))
    with pytest.raises(QueryError, match=r"would be named 'controller[ _]state"):
        getattr(both, call)()


def test_quantities_that_one_run_and_many_record_have_one_unit_and_title(run, batch) -> None:
    """The Datasets of a run and of a batch name position, velocity and actuation alike."""
    pytest.importorskip("xarray")
    one, many = run.to_xarray(), batch.to_xarray()
    for name in ("t", "q", "v", "u"):
        assert one[name].attrs == many[name].attrs, name
    assert many.q.dims == ("run", *one.q.dims) and many.kinetic.dims == ("run", "t")
