"""Files that can be read, and the error line for every kind of bad file."""

import numpy as np
import pytest

from strapdown_sim.recordings import RecordingError, read_recording

SENSORS = {"Gyroscope": "deg/s", "Accelerometer": "g", "Magnetometer": "uT"}


def header(time="Time (s)", **units):
    units = SENSORS | units
    return [time, *(f"{sensor} {axis} ({unit})" for sensor, unit in units.items() for axis in "XYZ")]


def rows(count=4):
    return [[f"{k / 100}", "1", "2", "3", "0", "0", "1", "20", "0", "-40"] for k in range(count)]


def write(path, head, body):
    path.write_text("\n".join(",".join(map(str, row)) for row in (head, *body)) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def file(tmp_path):
    return tmp_path / "flight.csv"


def npz(path, **changes):
    arrays = {"t": np.arange(5) / 100, "gyro": np.full((5, 3), 0.1), "accel": np.tile([0, 0, 9.8], (5, 1)),
              "mag": np.full((5, 3), 20.0), "fs": 100.0} | changes
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_csv(file):
    recording = read_recording(write(file, header(), rows()))
    assert recording.name == "flight"
    assert recording.sample_rate_hz == pytest.approx(100)
    assert recording.gyro_deg_s.tolist() == [[1, 2, 3]] * 4
    assert recording.accel.tolist() == [[0, 0, 9.80665]] * 4
    assert recording.mag.tolist() == [[20, 0, -40]] * 4
    assert recording.reference is None


def test_units_are_converted(file):
    head = header(Gyroscope="rad/s", Accelerometer="m/s^2", Magnetometer="G")
    body = [[k / 100, np.pi, 0, 0, 0, 0, 9.8, 0.2, 0, -0.4] for k in range(3)]
    recording = read_recording(write(file, head, body))
    assert recording.gyro_deg_s[0] == pytest.approx([180, 0, 0])
    assert recording.accel[0] == pytest.approx([0, 0, 9.8])
    assert recording.mag[0] == pytest.approx([20, 0, -40])


def test_columns_in_any_order_and_case_without_magnetometer(file):
    head = [name.upper() if "(" not in name else name.replace("Gyroscope", "gyroscope") for name in header()[:7]]
    recording = read_recording(write(file, head[::-1], [row[:7][::-1] for row in rows()]))
    assert recording.mag is None
    assert recording.gyro_deg_s[0].tolist() == [1, 2, 3]


def replaced(line, column, value):
    body = rows()
    body[line][column] = value
    return body


@pytest.mark.parametrize(("head", "body", "message"), [
    ([*header()[:-1], "Colour"], rows(), "no column 'Magnetometer Z'; add it, or name it with --columns mag_z=NAME"),
    ([*header()[:-1], header()[1]], rows(), "column 'Gyroscope X' appears twice; delete one"),
    (header()[:9], [row[:9] for row in rows()], "no column 'Magnetometer Z'; add it, or name it with --columns "
                                                "mag_z=NAME"),
    (header()[1:], [row[1:] for row in rows()], "no column 'Time'; add it, name it with --columns time=NAME:UNIT, or "
                                                "give the rate of the rows with --rate HZ"),
    (["Time (s)", "Roll", "Pitch"], [[k / 100, 1, 2] for k in range(4)],
     "no column 'Gyroscope X'; the columns are Time (s), Roll, Pitch: name it with --columns gyro_x=NAME:UNIT"),
    (header(Gyroscope="furlong"), rows(),
     "column 'Gyroscope X': unit 'furlong' is not known; units are deg/s, rad/s, mdeg/s, mrad/s, in parentheses after "
     "the name, or for all axes in --columns gyro=:deg/s"),
    (header("Time (h)"), rows(), "column 'Time (h)': unit 'h' is not known; units are s, ms, us, ns, min, in "
                                 "parentheses after the name, or in --columns time=:ms"),
    ([name.split(" (")[0] for name in header()], rows(),
     "column 'Gyroscope X' has no unit; units are deg/s, rad/s, mdeg/s, mrad/s, in parentheses after the name, or for "
     "all axes in --columns gyro=:deg/s"),
    ([*header()[:3], "Gyroscope Z (rad/s)", *header()[4:]], rows(), "Gyroscope axes have units deg/s, deg/s, rad/s; "
                                                                    "use one for all"),
    (header(), replaced(0, 9, "1;2"), "line 2, column 'Magnetometer Z (uT)': '1;2' is not a number; correct or delete "
                                      "the line"),
    (header(), [*rows(), ["0.04", "1"], *rows()], "line 6 has 2 cells, the header 10; complete or delete it"),
    (header(), rows(1), "1 rows of numbers; at least 2 are needed, below a line with their names"),
    (header(), [], "0 rows of numbers; at least 2 are needed, below a line with their names"),
    (rows()[0], rows(), "line 1 holds numbers, and no line before it names 10 columns: name them by their numbers, as "
                        "in --columns time=1:ms --columns gyro_x=2:deg/s"),
    (header(), [["0.5", *row[1:]] for row in rows()], "line 3: time does not increase"),
    (header(), [[k * 10, *row[1:]] for k, row in enumerate(rows())],
     "samples are 10 s apart; if that is ms or us, name the unit in the header, as in Time (ms), or with --columns "
     "time=NAME:ms"),
    (header(Accelerometer="m/s^2"), rows(), "the median specific force is 0.102 g; is the unit of the accelerometer "
                                            "m/s^2?"),
    (header(), [[*row[:6], "9.8", *row[7:]] for row in rows()], "the median specific force is 9.8 g; is the unit of "
                                                                "the accelerometer g?"),
    (header(), [[*row[:6], "0.02", *row[7:]] for row in rows()],
     "the median specific force is 0.02 g: gravity was removed from it (linear acceleration); use the accelerometer "
     "with gravity (TotalAcceleration.csv of Sensor Logger, Accelerometer.csv of phyphox)"),
    (header(), [[*row[:6], "0", *row[7:]] for row in rows()], "the accelerometer has no samples"),
    (header("Packet number"), [[k * 9, *row[1:]] for k, row in enumerate(rows())],
     "line 3: packet number goes from 0 to 9: rows out of order or missing; sort them or cut the file there"),
    ([*header(), "Packet number"], [[*row, k] for k, row in enumerate(rows())],
     "columns 'Time' and 'Packet number' exclude each other; delete one"),
])
def test_csv_that_is_refused(file, head, body, message):
    with pytest.raises(RecordingError) as error:
        read_recording(write(file, head, body))
    assert str(error.value).startswith(f"{file}: {message}")
    assert "\n" not in str(error.value)


def test_rate_of_a_file_with_time_is_refused(file):
    with pytest.raises(RecordingError, match=r"the file contains its time; leave out the sample rate$"):
        read_recording(write(file, header(), rows()), sample_rate_hz=100)


def test_a_separate_reference_of_a_file_with_time_is_refused(file):
    with pytest.raises(RecordingError, match=r"only x-IMU exports have a separate reference; leave it out$"):
        read_recording(write(file, header(), rows()), reference="device.csv")


@pytest.mark.parametrize(("packets", "message"), [
    ((100, 102), "packet numbers do not overlap those of flight.csv; take both files from one export"),
    ((1, 3, 5, 11), "line 5: 3 samples since the previous quaternion instead of 1: packets are missing; "
                    "cut both files there"),
])
def test_a_reference_that_does_not_go_with_an_export_is_refused(file, tmp_path, packets, message):
    names = [name for name in header() if not name.startswith("Time")]
    samples = [[2 * index, *row[1:]] for index, row in enumerate(rows(10))]
    device = tmp_path / "device.csv"
    write(device, ["Packet number", *(f"Element {k}" for k in range(1, 5))], [[n, 1, 0, 0, 0] for n in packets])
    with pytest.raises(RecordingError) as error:
        read_recording(write(file, ["Packet number", *names], samples), reference=device)
    assert str(error.value) == f"{device}: {message}"


@pytest.mark.parametrize(("data", "message"), [
    (b"\x7fELF\0\0\1", "not a log of a known format; known are NumPy archive, "),
    (b"", "the file is empty"),
])
def test_a_file_of_another_kind_is_refused(tmp_path, data, message):
    path = tmp_path / "flight.bin"
    path.write_bytes(data)
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    assert str(error.value).startswith(f"{path}: {message}")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"No such file or directory$"):
        read_recording(tmp_path / "flight.csv")


def test_npz(tmp_path):
    reference = np.tile([1.0, 0, 0, 0], (5, 1))
    reference[3] = np.nan
    recording = read_recording(npz(tmp_path / "r.npz", quat_ref=reference, valid=np.array([1, 1, 0, 1, 1], bool)))
    assert recording.gyro_deg_s[0] == pytest.approx(np.degrees([0.1] * 3))
    assert recording.reference.frame == "ENU"
    assert recording.reference.valid.tolist() == [True, True, False, False, True]


@pytest.mark.parametrize(("changes", "message"), [
    ({"gyro": None}, "no array 'gyro'; add it"),
    ({"gyro": np.full((5, 2), 0.1)}, r"array 'gyro' must hold numbers in shape (5, 3), not float64 in (5, 2)"),
    ({"gyro": np.full((1, 3), 0.1)}, "1 samples; at least 2 are needed"),
    ({"accel": np.full((5, 3), np.nan)}, "the accelerometer has no samples"),
    ({"fs": 50.0}, "array 'fs' says 50 Hz, array 't' 100 Hz; correct one"),
    ({"t": np.array([0, 1, 2, 3, 1103]) / 100}, "array 't', index 4: gap of 11 s after 0.03 s"),
])
def test_npz_that_is_refused(tmp_path, changes, message):
    path = npz(tmp_path / "r.npz", **changes)
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    assert str(error.value).startswith(f"{path}: {message}")


def test_npz_that_is_none(tmp_path):
    path = tmp_path / "r.npz"
    path.write_text("no archive", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"not a NumPy archive of plain arrays; write it with numpy\.savez$"):
        read_recording(path)


def test_x_imu_export(x_imu_recording):
    recording = read_recording(x_imu_recording)
    assert recording.sample_rate_hz == 256
    assert len(recording.time_s) == 12_626
    assert recording.reference.frame == "NWU"
    assert not recording.reference.heading_known
    # The device sends a quaternion for every second sample.
    assert len(recording.reference.time_s) == 6313
    assert np.diff(recording.reference.time_s) == pytest.approx(2 / 256)
    assert read_recording(x_imu_recording, sample_rate_hz=128).sample_rate_hz == 128


def test_shared_recordings(shared_recordings):
    files = sorted(shared_recordings.glob("*.npz"))
    assert files
    for path in files:
        recording = read_recording(path)
        assert recording.sample_rate_hz > 90
        assert (recording.mag is None) == path.name.startswith("ins_")


def table(path, rows, names=None, delimiter=","):
    """A file of rows of text."""
    head = names or [*header()[:7]]
    path.write_text("\n".join(delimiter.join(row) for row in (head, *rows)) + "\n", encoding="utf-8")
    return path


def still(time, gyro="0,0,0", accel="0,0,1"):
    return [time, *gyro.split(","), *accel.split(",")]


def test_each_sample_has_its_own_period(file):
    times = ["0", "0.01", "0.02", "0.03", "0.035", "0.04", "0.045"]
    recording = read_recording(table(file, [still(time, "0,0,90") for time in times]))
    assert recording.period_s == pytest.approx([0.01, 0.01, 0.01, 0.005, 0.005, 0.005, 0.005])
    assert recording.timing.faults == {}
    # At 90 deg/s one period of 7.5 ms in place of 10 ms is behind by 90 · 3 · 2.5 ms after three samples, and in place
    # of 5 ms ahead by 90 · 1 · 2.5 ms after four more.
    assert recording.timing.one_rate_error_deg == pytest.approx(0.9)


def test_a_lost_sample_is_filled_in_on_a_line(file):
    rows = [still(f"{k / 100}", f"{k},0,0", f"0,{k / 100},1") for k in range(30) if k != 12]
    recording = read_recording(table(file, rows))
    assert recording.timing.faults == {"gaps, bridged": 1, "samples lost, filled in on a line": 1}
    assert recording.timing.bridged == ((0.11, 0.13),)
    assert recording.timing.longest_gap_s == pytest.approx(0.02)
    # The mean rate of five samples changes by 6 deg/s across 20 ms: at most 3 deg/s of it are wrong.
    assert recording.timing.bridge_error_deg == pytest.approx(0.06)
    assert len(recording.time_s) == 30
    assert recording.gyro_deg_s[12] == pytest.approx([12, 0, 0])
    assert recording.accel[12, 1] == pytest.approx(0.12 * 9.80665)
    assert recording.period_s == pytest.approx([0.01] * 30)


def test_a_gap_in_motion_that_is_too_long_is_refused_and_the_remedy_works(file):
    times = np.concatenate([np.arange(100), 500 + np.arange(300)]) / 100
    path = table(file, [still(f"{t}", f"{10 * t},0,0") for t in times])
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    assert str(error.value) == (f"{file}: line 102: gap of 4.01 s after 0.99 s, across which the angles can be off by "
                                "81°; replay a part without it: --from 5 is the longest")
    assert len(read_recording(path, start_s=5).time_s) == 300
    assert len(read_recording(path, stop_s=0.99).time_s) == 100


def test_a_gap_at_rest_is_bridged(file):
    times = np.concatenate([np.arange(100), 500 + np.arange(300)]) / 100
    recording = read_recording(table(file, [still(f"{t}") for t in times]))
    assert recording.timing.longest_gap_s == pytest.approx(4.01)
    assert len(recording.time_s) == 800


def test_two_recordings_in_one_file_are_refused_and_the_remedy_works(file):
    times = np.concatenate([np.arange(100), np.arange(80)]) / 100
    path = table(file, [still(f"{t}") for t in times])
    with pytest.raises(RecordingError, match=r"line 102: time starts again, after 0\.99 s: two recordings in one file; "
                                             r"take the first with --to 0\.99, or split it there$"):
        read_recording(path)
    assert len(read_recording(path, stop_s=0.99).time_s) == 100


def test_a_part_without_samples_is_refused(file):
    with pytest.raises(RecordingError, match=r"0 samples between --from and --to; the log goes from 0 to 0\.03 s$"):
        read_recording(write(file, header(), rows()), start_s=9)


def test_gyro_cells_without_a_number_are_bridged(file):
    body = [still(f"{k / 100}", f"{k},0,0") for k in range(20)]
    body[5][1], body[9][2] = "nan", ""
    recording = read_recording(table(file, body))
    assert recording.timing.faults["gyro samples that are not numbers, bridged"] == 2
    assert recording.gyro_deg_s[:, 0] == pytest.approx(np.arange(20))


def with_field(count, field):
    """Rows with a field; ``field(k)`` gives its three cells."""
    return [[*still(f"{k / 100}"), *field(k)] for k in range(count)]


@pytest.mark.parametrize("empty", [["", "", ""], ["nan", "nan", "nan"], ["0", "0", "0"]])
def test_rows_without_a_field(file, empty):
    field = ["20", "0", "-40"]
    recording = read_recording(table(file, with_field(9, lambda k: empty if k % 3 else field), header()))
    assert recording.mag_new.tolist() == [k % 3 == 0 for k in range(9)]
    assert recording.mag[0].tolist() == [20, 0, -40]
    assert recording.mag[1].tolist() == [0, 0, 0]


def test_a_field_that_rows_repeat_is_new_once(file):
    # 20 Hz in rows of 100 Hz; from row 50 on at rest, where the value is new all the same.
    recording = read_recording(table(file, with_field(100, lambda k: [str(min(k, 50) // 5), "0", "-40"]), header()))
    assert np.flatnonzero(recording.mag_new).tolist() == list(range(0, 100, 5))
    assert (recording.mag[~recording.mag_new] == 0).all()
    assert recording.notes == ("magnetometer: 20 samples, 20 Hz; each is used once",)


def test_a_field_that_some_rows_repeat_stays_for_cores_without_flags(file):
    recording = read_recording(table(file, with_field(90, lambda k: [str(2 * k // 3), "1", "-40"]), header()))
    assert recording.mag_new.sum() == 60
    assert (recording.mag[:, 1] == 1).all()


def test_a_coarse_field_at_rest_is_new_in_every_row(file):
    noise = np.random.default_rng(1).integers(0, 2, 200)
    recording = read_recording(table(file, with_field(200, lambda k: [str(20 + noise[k]), "0", "-40"]), header()))
    assert recording.mag_new.all()


def test_a_force_that_rows_repeat_is_interpolated(file):
    recording = read_recording(table(file, [still(f"{k / 100}", accel=f"0,{k // 4 * 4 / 1000},1") for k in range(40)]))
    assert recording.accel[:37, 1] == pytest.approx(np.arange(37) / 1000 * 9.80665)


def test_columns_that_are_not_known_are_left_out(file):
    recording = read_recording(table(file, [[*still(f"{k / 100}"), "1000", "red"] for k in range(4)],
                                     [*header()[:7], "Barometer (hPa)", "Colour"]))
    assert recording.notes == ("columns not used: Colour, Barometer (hPa)",)


@pytest.mark.parametrize(("time", "cells"), [
    ("Timestamp (us)", ["0", "10000", "20000"]), ("t [ms]", ["5", "15", "25"]), ("time (ns)", ["0", "1e7", "2e7"]),
    ("timestamp", ["1700000000.00", "1700000000.01", "1700000000.02"]),
    ("timestamp", ["1700000000000", "1700000000010", "1700000000020"]),
    ("time_us", ["7", "10007", "20007"]),
])
def test_units_of_time(file, time, cells):
    recording = read_recording(table(file, [still(cell) for cell in cells], [time, *header()[1:7]]))
    assert recording.sample_rate_hz == pytest.approx(100, rel=1e-4)


@pytest.mark.parametrize(("unit", "kind", "number", "value"), [
    ("°/s", "Gyroscope", "2", 2), ("dps", "Gyroscope", "2", 2), ("rad s^-1", "Gyroscope", "1", np.degrees(1)),
    ("mdps", "Gyroscope", "2000", 2), ("m/s²", "Accelerometer", "9.8", 9.8), ("mg", "Accelerometer", "1000", 9.80665),
    ("m s^-2", "Accelerometer", "9.8", 9.8), ("µT", "Magnetometer", "40", 40), ("gauss", "Magnetometer", "0.4", 40),
    ("T", "Magnetometer", "4e-5", 40), ("mG", "Magnetometer", "400", 40),
])
def test_spellings_of_units(file, unit, kind, number, value):
    body = [[f"{k / 100}", *(number if kind in name else "1" for name in header()[1:])] for k in range(3)]
    if kind != "Accelerometer":
        body = [[*row[:4], "0", "0", "1", *row[7:]] for row in body]
    else:
        body = [[*row[:4], "0", "0", number, *row[7:]] for row in body]
    recording = read_recording(table(file, body, header(**{kind: unit})))
    values = {"Gyroscope": recording.gyro_deg_s, "Accelerometer": recording.accel, "Magnetometer": recording.mag}[kind]
    assert values[0, 2] == pytest.approx(value)


@pytest.mark.parametrize(("text", "rate"), [
    ("Time (s);gx (dps);gy (dps);gz (dps);ax (g);ay (g);az (g)\n0,00;1,5;0;0;0;0;1\n0,01;1,5;0;0;0;0;1\n", 100),
    ("\ufeff# made by hand\n# rate 100\nTime (s)\tgx (dps)\tgy (dps)\tgz (dps)\tax (g)\tay (g)\taz (g)\n"
     "0\t1.5\t0\t0\t0\t0\t1\n0.01\t1.5\t0\t0\t0\t0\t1\t\n", 100),
    ("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
     "a_RS_S_z [m s^-2]\n1403636579758555392,0.0261799388,0,0,9.8,0,0\n"
     "1403636579763555584,0.0261799388,0,0,9.8,0,0\n", 200),
    ("time,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z\n"
     "s,deg/s,deg/s,deg/s,g,g,g\n0,1.5,0,0,0,0,1\n0.01,1.5,0,0,0,0,1\n", 100),
    ("time_ms gyro_x_dps gyro_y_dps gyro_z_dps accel_x_g accel_y_g accel_z_g\n"
     "0 1.5 0 0 0 0 1\n10 1.5 0 0 0 0 1\n", 100),
    ("gyro_z_dps,time_ms,gyro_x_dps,gyro_y_dps,accel_x_g,accel_y_g,accel_z_g\n"
     "0,0,1.5,0,0,0,1\n0,10,1.5,0,0,0,1\n", 100),
])
def test_kinds_of_tables(file, text, rate):
    file.write_text(text, encoding="utf-8")
    recording = read_recording(file)
    assert recording.sample_rate_hz == pytest.approx(rate, rel=1e-4)
    assert recording.gyro_deg_s[0] == pytest.approx([1.5, 0, 0])
    assert np.linalg.norm(recording.accel[0]) == pytest.approx(9.8, abs=0.01)


def test_a_last_line_that_was_cut_off_is_left_out(file):
    assert len(read_recording(write(file, header(), [*rows(), ["0.04", "1"]])).time_s) == 4


def test_a_few_damaged_lines_are_left_out(file):
    body = [still(f"{k / 100}", f"{k},0,0") for k in range(300)]
    body[100], body[200], body[250][3] = ["1.0", "10"], ["2.0", *"123456789"], "1;2"
    recording = read_recording(table(file, body))
    assert recording.notes == ("damaged lines, left out: 2; the first is line 102 has 2 cells, the header 7",)
    assert recording.timing.faults == {"gyro samples that are not numbers, bridged": 1, "gaps, bridged": 3,
                                       "samples lost, filled in on a line": 3}
    assert recording.gyro_deg_s[:, 0] == pytest.approx(np.arange(300))
    body[20:30] = [["0"]] * 10
    with pytest.raises(RecordingError, match=r"line 22 has 1 cells, the header 7; complete or delete it$"):
        read_recording(table(file, body))


@pytest.mark.parametrize(("before", "unit", "one_g"), [
    ('"Product","Blackbox flight data recorder by Nicholas Sherlock"\n"minthrottle",1070\n"acc_1G",500\n', "", 500),
    ("", " (us)", 512)])
def test_blackbox_logs_that_were_decoded(file, before, unit, one_g):
    names = ["loopIteration", f"time{unit}", "axisP[0]", *(f"gyroADC[{k}]" for k in range(3)),
             *(f"accSmooth[{k}]" for k in range(3)), *(f"gyroUnfilt[{k}]" for k in range(3)), "flightModeFlags (flags)"]
    rows = [[16 * k, 2000 * k + 5000, 7, 1, 2, 3, 0, 0, one_g, 9, 9, 9, "ARM|ANGLE"] for k in range(20)]
    file.write_text(before + "\n".join(", ".join(map(str, row)) for row in (names, *rows)) + "\n", encoding="utf-8")
    recording = read_recording(file)
    assert recording.sample_rate_hz == pytest.approx(500)
    assert recording.gyro_deg_s[0].tolist() == [1, 2, 3]
    assert recording.accel[0] == pytest.approx([0, 0, 9.80665])
    assert ("accelerometer: 512 units are taken as one g" in recording.notes) == (not before)


OTHERS = {  # header; a row with {t} s, {n} ns since 1970, {u} us, its number {k}; rates in deg/s
    "phyphox": ('"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)","Acceleration x (m/s^2)",'
                '"Acceleration y (m/s^2)","Acceleration z (m/s^2)","Absolute acceleration (m/s^2)"',
                "{t},.1,.2,.3,0,0,9.8,9.8", np.degrees([0.1, 0.2, 0.3])),
    "fields of ROS": ("%time,field.header.seq,field.angular_velocity.x,field.angular_velocity.y,"
                      "field.angular_velocity.z,"
                      "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
                      "{n},{k},.1,.2,.3,0,0,9.8", np.degrees([0.1, 0.2, 0.3])),
    "SensorLog": ("loggingTime(txt),accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),"
                  "accelerometerAccelerationY(G),accelerometerAccelerationZ(G),gyroRotationX(rad/s),gyroRotationY(rad/s),"
                  "gyroRotationZ(rad/s)", "2020-01-01 00:00:00.000,{t},0,0,-1,.1,.2,.3", np.degrees([0.1, 0.2, 0.3])),
    "Xsens DOT": ("DeviceTag:,DOT\nFirmwareVersion:,2.0\nPacketCounter,SampleTimeFine,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,"
                  "Acc_X,"
                  "Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z", "{k},{u},0,0,0,0,0,9.8,1,2,3", [1, 2, 3]),
    "WitMotion": ("Time(s)\tAccX(g)\tAccY(g)\tAccZ(g)\tAsX(°/s)\tAsY(°/s)\tAsZ(°/s)\tHX(uT)\tHY(uT)\tHZ(uT)",
                  "{t}\t0\t0\t1\t1\t2\t3\t20\t0\t-40", [1, 2, 3]),
    "Shimmer": ("sep=\t\nShimmer_Timestamp_CAL\tShimmer_Accel_X_CAL\tShimmer_Accel_Y_CAL\tShimmer_Accel_Z_CAL\t"
                "Shimmer_Gyro_X_CAL\tShimmer_Gyro_Y_CAL\tShimmer_Gyro_Z_CAL\n"
                "us\tm/(s^2)\tm/(s^2)\tm/(s^2)\tdeg/s\tdeg/s\tdeg/s", "{u}\t0\t0\t9.8\t1\t2\t3", [1, 2, 3]),
    "underscores": ("timestamp_ns,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2",
                    "{n},.1,.2,.3,0,0,9.8", np.degrees([0.1, 0.2, 0.3])),
}


@pytest.mark.parametrize("program", OTHERS)
def test_tables_of_other_programs(file, program):
    head, row, rates = OTHERS[program]
    rows = [row.format(t=k / 100, n=17 * 10**17 + k * 10**7, u=k * 10_000, k=k) for k in range(40)]
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    recording = read_recording(file)
    assert recording.sample_rate_hz == pytest.approx(100, rel=1e-4)
    assert recording.gyro_deg_s[3] == pytest.approx(rates)
    assert recording.accel[3] == pytest.approx([0, 0, 9.8], abs=0.01)


def test_columns_are_named_by_hand(file):
    table(file, [[f"{k}", "1", "2", "3", "0", "0", "1000"] for k in range(0, 40, 10)],
          ["T", "p1", "p2", "p3", "A1", "A2", "A3"])
    columns = {"time": "T:ms"} | {f"gyro_{axis}": f"p{k}:dps" for k, axis in enumerate("xyz", 1)}
    columns |= {f"accel_{axis}": f"A{k}:mg" for k, axis in enumerate("xyz", 1)}
    recording = read_recording(file, columns=columns)
    assert recording.gyro_deg_s[0].tolist() == [1, 2, 3]
    assert recording.accel[0] == pytest.approx([0, 0, 9.80665])
    with pytest.raises(RecordingError, match=r"--columns gyro_x=p9: no column is called so; they are T, p1"):
        read_recording(file, columns={"gyro_x": "p9"})
    with pytest.raises(RecordingError, match=r"--columns: 'gyro_q' is no quantity; they are time, gyro_x"):
        read_recording(file, columns={"gyro_q": "p1"})


def test_time_in_another_unit_is_named_by_hand(file):
    path = write(file, header(), [[k * 10, *row[1:]] for k, row in enumerate(rows())])
    assert read_recording(path, columns={"time": "Time (s):ms"}).sample_rate_hz == pytest.approx(100)


def test_rows_without_time_take_a_rate(file):
    recording = read_recording(table(file, [still("0")[1:]] * 5, header()[1:7]), sample_rate_hz=50)
    assert recording.time_s == pytest.approx(np.arange(5) / 50)
    assert recording.period_s is None


def test_rates_that_no_gyro_measures_are_told(file):
    recording = read_recording(table(file, [still(f"{k / 100}", "0,0,5000") for k in range(4)]))
    assert recording.notes == ("rates up to 5,000 deg/s are more than any gyro of this kind measures: is the unit "
                               "deg/s?",)


def test_options_of_other_formats_are_refused(tmp_path):
    path = npz(tmp_path / "r.npz")
    with pytest.raises(RecordingError, match=r"only text files have columns to name; leave out --columns$"):
        read_recording(path, columns={"time": "t"})
    with pytest.raises(RecordingError, match=r"the file has one log; leave out --log$"):
        read_recording(path, log="1")
    with pytest.raises(RecordingError, match=r"--imu 3 is not in the log; it has 0 \(gyro\)$"):
        read_recording(path, imu="3")
