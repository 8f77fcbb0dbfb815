"""Files of responses as others write them: tables, structures of MATLAB, Universal Files, and what they refuse."""

import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError
from robid.logs.formats.load import load_responses
from robid.logs.responses.columns import column_table
from robid.logs.responses.datasets import universal_tables
from robid.logs.responses.importing import frf_of
from robid.logs.responses.structures import find_object, object_table
from robid.logs.responses.table import ResponseTable
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.response_options import ElementColumns, FrequencyColumn, ResponseOptions

FREQUENCY = np.geomspace(1, 90, 60)


def plant(frequency_hz, gain=1.0):
    """An inertia of 0.02 kg m^2 with a resonance at 20 Hz, acceleration per torque."""
    s, w = 2j * np.pi * frequency_hz, 2 * np.pi * 20
    return gain * 50 * (1 + s * 0.01 + s**2 / (0.7 * w) ** 2) / (1 + 0.04 * s / w + s**2 / w**2)


def options(outputs=("a",), inputs=("a",), unit="rad/s^2", **more):
    return ResponseOptions(
        inputs=tuple(InputChannel(name=name, variable=name, unit="N m") for name in inputs),
        outputs=tuple(OutputChannel(name=name, variable=name, unit=unit) for name in outputs),
        **more,
    )


def table_of(path, header, columns, delimiter=","):
    path.write_text(
        "\n".join([delimiter.join(header), *(delimiter.join(map(repr, row)) for row in np.transpose(columns).tolist())])
    )
    return path


def read(path, chosen):
    return column_table({None: load_responses(path, chosen.format, chosen.dialect)}, chosen)


@pytest.mark.parametrize(
    ("header", "columns", "more"),
    [
        (("f [Hz]", "re", "im"), lambda f, g: (f, g.real, g.imag), {}),
        (("Frequency (rad/s)", "Real", "Imag"), lambda f, g: (2 * np.pi * f, g.real, g.imag), {}),
        (("freq", "mag [dB]", "phase [deg]"), lambda f, g: (f, 20 * np.log10(abs(g)), np.rad2deg(np.angle(g))), {}),
        (
            ("freq", "magnitude", "phase"),
            lambda f, g: (f, abs(g), np.unwrap(np.angle(g))),
            {"phase": "rad"},
        ),
        (
            ("w", "x1", "x2"),
            lambda f, g: (2 * np.pi * f, g.real, g.imag),
            {
                "frequency": FrequencyColumn(variable="w", unit="rad/s"),
                "elements": (ElementColumns(output="a", input="a", real="x1", imaginary="x2"),),
            },
        ),
    ],
)
def test_tables_of_one_element_are_read(tmp_path, header, columns, more):
    response = plant(FREQUENCY)
    path = table_of(tmp_path / "frf.csv", header, columns(FREQUENCY, response))
    found = read(path, options(**more))
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=1e-12)
    np.testing.assert_allclose(found.response[:, 0, 0], response, rtol=1e-9)


def test_elements_may_have_files_of_their_own(tmp_path):
    for name, gain in (("x", 1.0), ("y", 2.0)):
        g = plant(FREQUENCY, gain)
        table_of(tmp_path / f"{name}.csv", ("f", "re", "im", "coh"), (FREQUENCY, g.real, g.imag, np.full(60, 0.9)))
    elements = tuple(
        ElementColumns(output="a", input=name, file=f"{name}.csv", real="re", imaginary="im", coherence="coh")
        for name in "xy"
    )
    chosen = options(inputs=("x", "y"), elements=elements, averages=16, excited="alone")
    files = {f"{name}.csv": load_responses(tmp_path / f"{name}.csv") for name in "xy"}
    found = column_table(files, chosen)
    np.testing.assert_allclose(
        found.response[:, 0], np.transpose([plant(FREQUENCY), plant(FREQUENCY, 2.0)]), rtol=1e-12
    )
    frf, kind = frf_of(found, chosen, np.zeros(1), None, "here")
    assert kind == "coherence"
    expected = np.abs(frf.response[0]) ** 2 * (0.1 / 0.9) / 15
    np.testing.assert_allclose(frf.element_variance()[0], expected, rtol=1e-9)


def test_units_signs_and_motions_become_accelerations_in_si():
    """Degrees per kN m of a channel that counts the other way: position to acceleration is -w^2."""
    chosen = ResponseOptions(
        inputs=(InputChannel(name="a", variable="a", unit="kN m"),),
        outputs=(OutputChannel(name="a", variable="a", unit="deg", sign=-1),),
    )
    wanted = plant(FREQUENCY)
    told = -wanted / -((2 * np.pi * FREQUENCY) ** 2) * np.rad2deg(1) * 1e3
    frf, _ = frf_of(ResponseTable(FREQUENCY, told[:, None, None]), chosen, np.zeros(1), None, "here")
    np.testing.assert_allclose(frf.response[0, :, 0, 0], wanted, rtol=1e-12)
    assert frf.output_channels[0].unit == "rad/s^2"
    assert frf.measured_channels[0].quantity == "angle"
    assert frf.hold_period_s is None


@pytest.mark.parametrize("unit", ["Hz", "rad/TimeUnit"])
def test_idfrd_structures_are_read_with_their_covariance_and_delays(tmp_path, unit):
    response = np.array([[plant(FREQUENCY), plant(FREQUENCY, 0.3j)]])
    covariance = np.zeros((1, 2, 60, 2, 2))
    covariance[..., 0, 0], covariance[..., 1, 1] = 0.01, 0.03
    cells = np.array(["u", "v"], object)[:, None]
    fields = {
        "ResponseData": response,
        "Frequency": FREQUENCY[:, None] * (1 if unit == "Hz" else 2 * np.pi),
        "FrequencyUnit": unit,
        "Ts": 0.002,
        "TimeUnit": "seconds",
        "InputDelay": np.array([[0.0], [3.0]]),
        "InputName": cells,
        "OutputName": np.array(["y"], object)[:, None],
        "CovarianceData": covariance,
    }
    savemat(tmp_path / "g.mat", {"G": fields})
    variables = load_responses(tmp_path / "g.mat")
    assert find_object(variables) == "G"
    found = object_table(variables, "G", options(outputs=("y",), inputs=("v", "u")))
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=1e-12)
    late = np.exp(-2j * np.pi * FREQUENCY * 3 * 0.002)
    np.testing.assert_allclose(found.response[:, 0, 0], response[0, 1] * late, rtol=1e-12)
    np.testing.assert_allclose(found.response[:, 0, 1], response[0, 0], rtol=1e-12)
    np.testing.assert_allclose(found.variance, 0.04)
    assert found.sampling_period_s == 0.002


def test_universal_files_are_read_with_coherence(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    axes = {
        f"{axis}_{part}": value
        for axis in ("ordinate", "orddenom")
        for part, value in (("spec_data_type", 0), ("len_unit_exp", 0), ("force_unit_exp", 0), ("axis_lab", "NONE"))
    }
    axes |= {f"{axis}_axis_units_lab": "NONE" for axis in ("ordinate", "orddenom", "abscissa")}
    about = {
        **axes,
        **{"type": 58, "binary": 0, "ver_num": 1, "load_case_id": 0, "z_axis_spec_data_type": 0},
        **{"id1": "x", "id2": "NONE", "id3": "NONE", "id4": "NONE", "id5": "NONE"},
        **{"rsp_ent_name": "NONE", "rsp_node": 12, "rsp_dir": 3, "ref_ent_name": "NONE", "ref_node": 4, "ref_dir": -2},
        **{"abscissa_spacing": 0, "abscissa_spec_data_type": 18, "abscissa_axis_lab": "Frequency"},
    }
    data = {4: plant(FREQUENCY), 6: np.full(60, 0.8)}
    sets = [{**about, "func_type": kind, "x": FREQUENCY, "data": values} for kind, values in data.items()]
    pyuff.UFF(str(tmp_path / "g.uff")).write_sets(sets, "overwrite")
    found = universal_tables(load_responses(tmp_path / "g.uff"), options(outputs=("12:3",), inputs=("4:-2",)))
    (table,) = found
    np.testing.assert_allclose(table.response[:, 0, 0], plant(FREQUENCY), rtol=1e-5)
    np.testing.assert_allclose(table.coherence[:, 0, 0], 0.8, rtol=1e-5)


REPEATED = np.repeat(FREQUENCY[:30], 2)


@pytest.mark.parametrize(
    ("code", "header", "columns", "more"),
    [
        ("D608", ("f", "re", "im"), lambda f, g: (f[::-1], g.real, g.imag), {}),
        ("D608", ("f", "re", "im"), lambda _f, g: (REPEATED, g.real, g.imag), {}),
        ("D606", ("f", "re", "im"), lambda f, g: (f - 1, g.real, g.imag), {}),
        ("D609", ("f", "mag", "phase"), lambda f, g: (f, 20 * np.log10(abs(g) / 100), np.rad2deg(np.angle(g))), {}),
        ("D610", ("f", "mag", "phase"), lambda f, g: (f, abs(g), np.angle(-g * np.exp(-0.3j * f))), {}),
        (
            "D610",
            ("f", "mag", "phase"),
            lambda f, g: (f, abs(g), np.rad2deg(np.angle(-g * np.exp(-0.3j * f)))),
            {"phase": "rad"},
        ),
        ("D615", ("f", "re", "im"), lambda f, g: (f, g.real, g.imag), {"outputs": ("a", "b")}),
        ("D617", ("x", "re", "im"), lambda f, g: (f, g.real, g.imag), {}),
        ("D627", ("f", "re", "im"), lambda f, g: (f, g.real, g.imag), {"covariance": "coherence"}),
        ("D625", ("f", "re", "im"), lambda f, g: (f, g.real, g.imag), {"covariance": "stated"}),
        ("D628", ("f", "re", "im", "coh"), lambda f, g: (f, g.real, g.imag, 90 + 0 * f), {"averages": 8}),
        (
            "D629",
            ("f", "re", "im", "coh"),
            lambda f, g: (f, g.real, g.imag, 0.9 + 0 * f),
            {"averages": 8, "loop": "closed"},
        ),
        ("D623", ("f", "re", "im"), lambda f, g: (f, g.real, g.imag), {"sampling_period_s": 0.01}),
    ],
)
def test_what_contradicts_itself_is_named(tmp_path, code, header, columns, more):
    path = table_of(tmp_path / "frf.csv", header, columns(FREQUENCY, plant(FREQUENCY)))
    chosen = options(**more)
    with pytest.raises(DataError) as found:
        frf_of(read(path, chosen), chosen, np.zeros(1), None, str(path))
    assert code in str(found.value)
    assert found.value.remedy


def test_sound_phases_are_not_accused(tmp_path):
    """Small phases in degrees, wrapped ones, and unwrapped ones far beyond a turn."""
    for deg in (True, False):
        for phase in (np.linspace(-3, 3, 60), -20 * FREQUENCY, np.angle(np.exp(-0.5j * FREQUENCY), deg=deg)):
            path = table_of(tmp_path / "frf.csv", ("f", "mag", "phase"), (FREQUENCY, np.ones(60), phase))
            found = read(path, options(phase="deg" if deg else "rad"))
            np.testing.assert_allclose(found.response[:, 0, 0], np.exp(1j * (np.deg2rad(phase) if deg else phase)))


def test_variances_of_all_elements_are_kept_as_they_are():
    generator = np.random.default_rng(1)
    variance = np.exp(generator.normal(size=(60, 2, 3)))
    chosen = options(outputs=("a", "b"), inputs=("u", "v", "w"))
    table = ResponseTable(FREQUENCY, generator.normal(size=(60, 2, 3)) + 0j, variance)
    frf, kind = frf_of(table, chosen, np.zeros(1), None, "here")
    assert kind == "stated"
    np.testing.assert_allclose(frf.element_variance()[0], variance, rtol=1e-12)
    whole = frf.full_covariance(0)
    by_columns = variance.transpose(0, 2, 1).reshape(60, 6)
    np.testing.assert_allclose(whole, by_columns[:, :, None] * np.eye(6), rtol=1e-12, atol=1e-15)


def test_h2_is_brought_to_h1():
    chosen = options(averages=10, estimator="h2")
    table = ResponseTable(FREQUENCY, 2 * np.ones((60, 1, 1), complex), coherence=np.full((60, 1, 1), 0.5))
    frf, _ = frf_of(table, chosen, np.zeros(1), None, "here")
    np.testing.assert_allclose(frf.response, 1.0)
    np.testing.assert_allclose(frf.element_variance(), 1 / 9)
