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
    ([*header()[:-1], "Colour"], rows(), "column 'Colour' is not known; columns are Time, Packet number, Gyroscope X"),
    ([*header()[:-1], header()[1]], rows(), "column 'Gyroscope X' appears twice; delete one"),
    (header()[:9], [row[:9] for row in rows()], "no column 'Magnetometer Z'; add it"),
    (header()[1:], [row[1:] for row in rows()], "no column 'Time'; add it"),
    (header(Gyroscope="furlong"), rows(), "column 'Gyroscope X': unit 'furlong' is not known; units are deg/s, rad/s, "
                                          "in parentheses after the name"),
    ([name.split(" (")[0] for name in header()], rows(), "column 'Time': unit 'missing' is not known; time is in "
                                                         "seconds, (s)"),
    ([*header()[:3], "Gyroscope Z (rad/s)", *header()[4:]], rows(), "Gyroscope axes have units deg/s, deg/s, rad/s; "
                                                                    "use one for all"),
    (header(), replaced(2, 4, "nan"), "line 4, column 'Accelerometer X (g)': nan is not finite; correct or delete the "
                                      "line"),
    (header(), replaced(1, 1, "inf"), "line 3, column 'Gyroscope X (deg/s)': inf is not finite; correct or delete the "
                                      "line"),
    (header(), replaced(0, 9, ""), "line 2, column 'Magnetometer Z (uT)': '' is not a number; correct or delete the "
                                   "line"),
    (header(), replaced(0, 9, "1;2"), "line 2, column 'Magnetometer Z (uT)': '1;2' is not a number; correct or delete "
                                      "the line"),
    (header(), [*rows(), ["0.04", "1"]], "line 6 has 2 cells, the header 10; complete or delete it"),
    (header(), rows(1), "1 rows of numbers; at least 2 are needed"),
    ([""], [], "line 1 holds no column names"),
    (header(), replaced(3, 0, "0.05"), "line 5: gap of 0.03 s after 0.02 s, where steps are 0.01 s; fill it in or cut "
                                       "the recording there"),
    (header(), replaced(3, 0, "0.02"), "line 5: time goes from 0.02 s to 0.02 s; it must increase"),
    (header(Accelerometer="m/s^2"), rows(), "the median specific force is 0.102 g; is the unit of the accelerometer "
                                            "m/s^2?"),
    (header(), [[*row[:6], "9.8", *row[7:]] for row in rows()], "the median specific force is 9.8 g; is the unit of "
                                                                "the accelerometer g?"),
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


def test_other_suffixes_are_refused(tmp_path):
    (tmp_path / "flight.bin").touch()
    with pytest.raises(RecordingError, match=r"suffix '\.bin' is not known; recordings are \.csv or \.npz files$"):
        read_recording(tmp_path / "flight.bin")


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
    ({"accel": np.full((5, 3), np.nan)}, "array 'accel', index [0, 0]: nan is not finite; correct or cut it"),
    ({"fs": 50.0}, "array 'fs' says 50 Hz, array 't' 100 Hz; correct one"),
    ({"t": np.array([0, 1, 2, 3, 9]) / 100}, "array 't', index 4: gap of 0.06 s after 0.03 s"),
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
