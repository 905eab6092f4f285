"""Text files as programs and people write them: headers, encodings, dates, units that are missing; compressed files."""

import gzip
import re
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pytest

from strapdown_sim.recordings import RecordingError, read_recording
from strapdown_sim.recordings.dialects import rate_unit
from strapdown_sim.recordings.table import decoded
from strapdown_sim.recordings.turning import turning

COUNT = 40
RATE = np.array([10.0, -20.0, 30.0])
"""deg/s, axes of a Log"""
FORCE = np.array([0.5, -1.0, 9.7])
"""m/s^2"""
FIELD = np.array([20.0, 5.0, -40.0])
"""uT"""
FRD = np.array([1.0, -1.0, -1.0])
G = 9.80665


def cells(vector, number="{:.7f}"):
    return ",".join(number.format(value) for value in vector)


def values(k):
    """What rows are made of: time in several units and as dates, vectors in several units and axes."""
    moment = datetime(2021, 8, 25, 10, 45, 59) + timedelta(milliseconds=10 * k)
    field = FIELD + k % 7 * np.array([0.001, 0, 0])
    return {"k": k, "s": k / 100, "ms": 10 * k, "us": 10_000 * k + 7, "epoch": f"{1_700_000_000 + k / 100:.4f}",
            "secs": 1_700_000_000 + k // 100, "nsecs": k % 100 * 10_000_000 + 7,
            "date": moment.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3], "iso": moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            "clock": moment.strftime("%H:%M:%S.%f")[:-3],
            "dashes": f"{moment:%Y-%m-%d %H-%M-%S}:{moment.microsecond // 1000:03}",
            "ms_plain": f"{moment:%Y-%m-%d %H:%M:%S}:{moment.microsecond // 1000}",
            "english": moment.strftime("%d-%b-%Y %H:%M:%S.%f"),
            "dps": cells(RATE), "rps": cells(np.radians(RATE)), "g": cells(FORCE / G), "mss": cells(FORCE),
            "mg": cells(1000 * FORCE / G), "ut": cells(field), "gauss": cells(field / 100),
            "rps_frd": cells(np.radians(RATE) * FRD), "mss_frd": cells(FORCE * FRD), "g_ios": cells(-FORCE / G)}


def axes(pattern):
    """Cells of a header, one for each axis."""
    return ",".join(pattern.format(axis) for axis in "XYZ")


PROGRAMS = {  # header; a row; whether it has a field
    "WitMotion, text": (f"StartTime: 2021-08-25\nAddress,Time(s),{axes('a{}(g)').lower()},{axes('w{}(deg/s)').lower()},"
                        "T(°),hx,hy,hz", "0x50,{clock},{g},{dps},25.1,{ut}", True),
    "WitMotion, app": ("Time,Device name,Chip Time()," + axes("Acceleration {}(g)") + "," + axes(
        "Angular velocity {}(°/s)") + "," + axes("Angle {}(°)") + "," + axes("Magnetic field {}(µt)"),
        "{date},WT901(ec:1),{ms_plain},{g},{dps},1,2,3,{ut}", True),
    "AndroSensor": (";".join([*(f"{name} {axis} (m/s²)" for name in ("ACCELEROMETER", "GRAVITY", "LINEAR ACCELERATION")
                                for axis in "XYZ"), *(f"GYROSCOPE {axis} (rad/s)" for axis in "XYZ"),
                              *(f"MAGNETIC FIELD {axis} (μT)" for axis in "XYZ"), "ORIENTATION Z (azimuth °)",
                              "Satellites in range", "Time since start in ms ", "YYYY-MO-DD HH-MI-SS_SSS"]),
                    "{mss};0;0;9.8;.1;.1;.1;{rps};{ut};12;5 / 12;{ms};{dashes}", True),
    "Physics Toolbox": ("time,gFx,gFy,gFz,ax,ay,az,wx,wy,wz,p,Bx,By,Bz,Speed (m/s),",
                        "{s},{g},.1,.1,.1,{rps},1010,{ut},0,", True),
    "SensorLog": ("loggingTime(txt)," + axes("accelerometerAcceleration{}(G)") + "," + axes("gyroRotation{}(rad/s)")
                  + "," + axes("motionUserAcceleration{}(G)") + "," + axes("motionGravity{}(G)"),
                  "{date} +0200,{g_ios},{rps},.1,.1,.1,0,0,-1", False),
    "MATLAB": ("Timestamp," + axes("{}_Acceleration (m/s^2)") + "," + axes("{}_AngularVelocity (rad/s)"),
               "{english},{mss},{rps}", False),
    "ArduPilot": ("timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T", "{epoch},{us},0,{rps_frd},{mss_frd},40", False),
    "3-Space": ('# Data format: "%int(ChipTimeUS),' + axes("%float(RawGyro{})") + "," + axes("%float(RawCompass{})")
                + "," + axes("%float(RawAccel{})") + '"', "{us},{rps},{gauss},{g}", True),
    "MicroStrain": ("DATA_START\nGPS Week,GPS TOW," + axes("{} Accel [x8004]") + "," + axes("{} Gyro [x8005]"),
                    "2100,{s},{g},{rps}", False),
    "VectorNav": ("TimeStartup [ms]," + axes("AngularRate.{} [rad/s]") + "," + axes("Accel.{} [m/s^2]"),
                  "{ms},{rps},{mss}", False),
    "Shimmer": ('"sep=,"\nS_Timestamp_Unix_CAL,' + axes("S_Accel_LN_{}_CAL") + "," + axes("S_Gyro_{}_CAL") + "," + axes(
        "S_Mag_{}_CAL") + ",\nms,m/(s^2),m/(s^2),m/(s^2),deg/s,deg/s,deg/s,local_flux,local_flux,local_flux,",
        "{ms},{mss},{dps},{ut},", True),
    "bagpy": ("Time,header.stamp.secs,header.stamp.nsecs,angular_velocity.x,angular_velocity.y,angular_velocity.z,"
              "linear_acceleration.x,linear_acceleration.y,linear_acceleration.z",
              "{epoch},{secs},{nsecs},{rps},{mss}", False),
    "by its units": ("Zeit (s)," + axes("Drehrate {} (°/s)") + "," + axes("Beschleunigung {} (m/s²)"),
                     "{s},{dps},{mss}", False),
    "prefixes": ("timestamp_us," + axes("imu_gyro_{}_radps").lower() + "," + axes("imu_accel_{}_mps2").lower() + ","
                 + axes("imu_mag_{}_ut").lower(), "{us},{rps},{mss},{ut}", True),
    "millis": ("millis," + axes("Gyr_{}_dps") + "," + axes("Acc_{}_mg"), "{ms},{dps},{mg}", False),
    "unit behind a dash": ("Time - s," + axes("Gyro {} - deg/s") + "," + axes("Accel {} - g"), "{s},{dps},{g}", False),
    "d/s": ("Timestamp(ms)," + axes("Acc{}(g)") + "," + axes("Gyro{}(d/s)"), "{ms},{g},{dps}", False),
    "numbers from 1": ("time_s," + ",".join(f"{name}_{k} ({unit})" for name, unit in (
        ("omega", "rad/s"), ("f", "m/s^2")) for k in (1, 2, 3)), "{s},{rps},{mss}", False),
    "numbers from 0": ("t_s," + ",".join(f"{name}_{k}_{unit}" for name, unit in (
        ("gyro", "radps"), ("accel", "mps2")) for k in (0, 1, 2)), "{s},{rps},{mss}", False),
    "time of a week": ("GPS_Week,GPS_MS," + axes("Acc_{} (g)") + "," + axes("Gyro_{} (dps)"), "2100,{ms},{g},{dps}",
                       False),
    "a date by its form": ("UTC," + axes("Gyro{} (dps)") + "," + axes("Acc{} (g)"), "{date},{dps},{g}", False),
    "names without words": ("时间(s)," + axes("加速度{}(g)") + "," + axes("角速度{}(°/s)"), "{s},{g},{dps}", False),
    "time of ISO 8601": ("Timestamp," + axes("gyro{} (dps)") + "," + axes("acc{} (g)"), "{iso},{dps},{g}", False),
}


def write(path, head, row, encoding="utf-8", count=COUNT):
    path.parent.mkdir(parents=True, exist_ok=True)
    text = "\n".join([head, *(row.format(**values(k)) for k in range(count))]) + "\n"
    path.write_bytes(text.encode(encoding))
    return path


def check(recording, field=False):
    assert recording.sample_rate_hz == pytest.approx(100, rel=1e-3)
    assert len(recording.time_s) == COUNT
    assert recording.gyro_deg_s[5] == pytest.approx(RATE, abs=1e-4)
    assert recording.accel[5] == pytest.approx(FORCE, abs=1e-3)
    if field:
        assert recording.mag[0] == pytest.approx(FIELD, abs=1e-3)
    else:
        assert recording.mag is None
    assert recording.timing.faults == {}


@pytest.mark.parametrize("program", PROGRAMS)
def test_programs(tmp_path, program):
    head, row, field = PROGRAMS[program]
    if ";" in row:
        row = row.replace(",", ";")
        for name in "mss", "rps", "ut":
            row = row.replace(f"{{{name}}}", f"{{{name}[0]}};{{{name}[1]}};{{{name}[2]}}")
        path = tmp_path / "flight.csv"
        rows = [row.format(**{name: value.split(",") if name in ("mss", "rps", "ut") else value
                              for name, value in values(k).items()}) for k in range(COUNT)]
        path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    else:
        path = write(tmp_path / "flight.csv", head, row)
    check(read_recording(path), field)


def test_biases_are_no_rates(tmp_path):
    """The ground truth of EuRoC has biases of a gyro and an accelerometer."""
    head = "#timestamp [ns]," + axes("b_w_RS_S_{} [rad s^-1]").lower() + "," + axes("b_a_RS_S_{} [m s^-2]").lower()
    with pytest.raises(RecordingError, match="no column 'Gyroscope X'"):
        read_recording(write(tmp_path / "data.csv", head, "{us},{rps},{mss}"))


PLAIN = "Time (s)," + axes("Gyro {} (°/s)") + "," + axes("Acc {} (m/s²)"), "{s},{dps},{mss}"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le", "utf-16-be"])
def test_encodings(tmp_path, encoding):
    check(read_recording(write(tmp_path / "flight.csv", *PLAIN, encoding=encoding)))


def test_decoding_of_bytes_that_are_no_text():
    assert decoded(b"a\x81\xb0") == "a\N{REPLACEMENT CHARACTER}°"


def quoted(vector):
    return ",".join('"' + f"{value:.7f}".replace(".", ",") + '"' for value in vector)


def test_decimal_commas_in_quotes(tmp_path):
    row = f'"{{comma}}",{quoted(RATE)},{quoted(FORCE)}'
    rows = [row.format(comma=f"{k / 100}".replace(".", ",")) for k in range(COUNT)]
    path = tmp_path / "flight.csv"
    path.write_text("\n".join([PLAIN[0], *rows]) + "\n", encoding="utf-8")
    check(read_recording(path))


def test_a_thousands_separator_is_no_decimal_comma(tmp_path):
    rows = [f'"{1 + k},000",{cells(RATE)},{cells(FORCE)}' for k in range(COUNT)]
    (tmp_path / "flight.csv").write_text("\n".join([PLAIN[0], *rows]), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"line 2, column 'Time \(s\)': '1,000' is not a number; correct or"):
        read_recording(tmp_path / "flight.csv")


def test_columns_without_names_are_called_by_number(tmp_path):
    # Counts: 4.375 mdeg/s, and 0.061 mg.
    rows = [f"{10 * k} " + " ".join(f"{value:.0f}" for value in (*RATE / 0.004375, *FORCE / G / 0.000061))
            for k in range(COUNT)]
    path = tmp_path / "flight.txt"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"line 1 holds numbers, .* as in --columns time=1:ms --columns gyro_x=2:"):
        read_recording(path)
    columns = {"time": "1:ms"} | {f"{name}_{axis}": f"{first + k}:{unit}" for name, first, unit in (
        ("gyro", 2, "4.375mdeg/s"), ("accel", 5, "0.061mg")) for k, axis in enumerate("xyz")}
    recording = read_recording(path, columns=columns)
    # Half a count.
    assert recording.gyro_deg_s[5] == pytest.approx(RATE, abs=0.0022)
    assert recording.accel[5] == pytest.approx(FORCE, abs=0.0003)


def test_signs_of_axes_are_given_by_hand(tmp_path):
    head = "t (ms)," + axes("g{} (rad/s)").lower() + "," + axes("a{} (m/s^2)").lower()
    path = write(tmp_path / "flight.csv", head, "{ms},{rps_frd},{mss_frd}")
    check(read_recording(path, columns={"gyro_y": "gy (rad/s):-1rad/s", "gyro_z": "gz (rad/s):-1rad/s",
                                        "accel_y": "ay (m/s^2):-1m/s^2", "accel_z": "az (m/s^2):-1m/s^2"}))
    ios = write(tmp_path / "ios.csv", head.replace("m/s^2", "g"), "{ms},{rps},{g_ios}")
    check(read_recording(ios, columns={"accel": ":-1g"}))


@pytest.mark.parametrize(("sign", "used"), [(1, True), (-1, False)])
def test_an_attitude_that_turns_the_force_downwards_is_told(tmp_path, sign, used):
    head = "t (ms)," + axes("g{} (rad/s)").lower() + "," + axes("a{} (g)").lower() + ",q0,q1,q2,q3"
    path = write(tmp_path / "flight.csv", head, f"{{ms}},{{rps}},0,0,{sign},1,0,0,0")
    recording = read_recording(path)
    assert (recording.reference is not None) == used
    assert any(note.startswith("attitude q: not used, because it does not turn the specific force upwards")
               for note in recording.notes) == (not used)


def test_the_unit_of_all_axes_is_given_by_hand(tmp_path):
    head = "time," + axes("g{}").lower() + "," + axes("a{}").lower() + "," + axes("m{}").lower()
    path = write(tmp_path / "flight.csv", head, "{ms},{rps},{g},{ut}")
    with pytest.raises(RecordingError, match=r"column 'Gyroscope X' has no unit; .* --columns gyro=:deg/s$"):
        read_recording(path)
    recording = read_recording(path, columns={"gyro": ":rad/s"})
    check(recording, field=True)
    assert recording.notes[:3] == (
        "time: no unit in the header; its steps go with ms",
        "accelerometer: no unit in the header; g makes its median one g",
        "magnetometer: no unit in the header; its direction is used")
    with pytest.raises(RecordingError, match=r"is the unit of the accelerometer m/s\^2\?$"):
        read_recording(path, columns={"gyro": ":rad/s", "accel": ":m/s^2"})


@pytest.mark.parametrize(("time", "unit", "rate"), [
    ("{s}", "s", 100), ("{ms}", "ms", 100), ("{us}", "us", 100), ("{us}000", "ns", 100)])
def test_the_unit_of_time_shows_in_its_steps(tmp_path, time, unit, rate):
    path = write(tmp_path / "flight.csv", PLAIN[0].replace("Time (s)", "t"), time + ",{dps},{mss}")
    recording = read_recording(path)
    assert recording.sample_rate_hz == pytest.approx(rate)
    assert recording.notes == (f"time: no unit in the header; its steps go with {unit}",)


def turn(rates, vector, period_s=0.01):
    """A vector of the earth in axes of a sensor that turns with ``rates``, rad/s, by Rodrigues' formula."""
    vectors = [np.array(vector, float)]
    for rate in rates[:-1]:
        angle = np.linalg.norm(rate) * period_s
        axis = -rate / max(np.linalg.norm(rate), 1e-12)
        last = vectors[-1]
        vectors.append(last * np.cos(angle) + np.cross(axis, last) * np.sin(angle)
                       + axis * (axis @ last) * (1 - np.cos(angle)))
    return np.array(vectors)


def swing(count=400):
    time_s = np.arange(count) / 100
    return time_s, np.stack([np.sin(3 * time_s), np.cos(2 * time_s), 0.5 * np.sin(time_s + 1)], axis=-1)


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "rad/s"), (np.degrees(1.0), "deg/s"), (0.2, None), (-1.0, None)])
def test_the_unit_of_rates_shows_in_what_turns(scale, unit):
    time_s, rates = swing()
    field = turn(rates, FIELD)
    # In 0.2 s it turns by less than 0.3 rad; means and chords are wrong by the square of that over two.
    assert turning(time_s, rates, field).ratio == pytest.approx(1, abs=0.045)
    # 58 deg/s is below the largest number that can be rad/s.
    assert rate_unit(time_s, scale * rates, field) == unit


def test_a_rate_that_is_too_large_for_rad_s_is_in_deg_s():
    assert rate_unit(np.arange(3) / 100, np.full((3, 3), 90.0), np.ones((3, 3))) == "deg/s"
    assert rate_unit(np.arange(99) / 100, np.ones((99, 3)), np.tile(FIELD, (99, 1))) is None


@pytest.mark.parametrize(("scale", "note"), [
    (1.0, None), (np.degrees(1.0), "times as fast as the rates say: is the unit of the gyro rad/s?"),
    (-1.0, "turns against the rates: signs or axes of the two sensors contradict each other")])
def test_rates_that_contradict_the_field_are_told(tmp_path, scale, note):
    time_s, rates = swing()
    field, force = turn(rates, FIELD), turn(rates, [0, 0, G])
    head = "Time (s)," + axes("Gyro {} (rad/s)") + "," + axes("Acc {} (m/s^2)") + "," + axes("Mag {} (uT)")
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.column_stack([time_s, scale * rates, force, field])]
    (tmp_path / "flight.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    found = [line for line in read_recording(tmp_path / "flight.csv").notes if line.startswith("the field")]
    assert found == [] if note is None else found[0].endswith(note)


def test_rates_that_contradict_the_force_are_told(tmp_path):
    time_s, rates = swing()
    force = turn(rates, [0, 0, G])
    head = "Time (s)," + axes("Gyro {} (deg/s)") + "," + axes("Acc {} (m/s^2)")
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.column_stack([time_s, rates, force])]
    (tmp_path / "flight.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    note, = read_recording(tmp_path / "flight.csv").notes
    assert re.fullmatch(r"the specific force turns 5\d times as fast as the rates say: is the unit of the gyro deg/s\?",
                        note)


def test_rows_of_one_sensor_each(tmp_path):
    """As apps write that append a row for each event: cells of other sensors are empty."""
    head = "time (ms)," + axes("gyro{} (deg/s)") + "," + axes("acc{} (m/s^2)") + "," + axes("mag{} (uT)")
    rows, rise = [], np.array([0.01, 0, 0])
    for k in range(COUNT):
        rows += [f"{10 * k},{cells(RATE)},,,,,,", f"{10 * k + 3},,,,{cells(FORCE + k * rise)},,,"]
        if k % 5 == 0:
            rows.append(f"{10 * k + 4},,,,,,,{cells(FIELD)}")
    path = tmp_path / "flight.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    recording = read_recording(path)
    assert recording.sample_rate_hz == pytest.approx(100)
    # The force is that of 3 ms later, and rises by 0.01 m/s^2 in 10 ms.
    assert recording.accel[5] == pytest.approx(FORCE + 4.7 * rise)
    assert np.flatnonzero(recording.mag_new).tolist() == list(range(0, COUNT, 5))
    assert recording.timing.faults == {}
    path.write_text("\n".join([head, *rows, f"99000,{cells(RATE)},,,,,,"]) + "\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=rf"line {len(rows) + 2}: gap of 98\.6 s"):
        read_recording(path)


# Xsens ---------------------------------------------------------------------------------------------------------------

XSENS = "PacketCounter,SampleTimeFine,Year,Second," + axes("Acc_{}") + "," + axes("Gyr_{}")


@pytest.mark.parametrize("empty", ["", "NaN"])
def test_xsens_without_times(tmp_path, empty):
    row = f"{{k}},{empty},{empty},{empty},{{mss}},{{rps}}"
    known = write(tmp_path / "a.txt", "// Start Time: Unknown\n// Update Rate: 100.0Hz\n" + XSENS, row)
    check(read_recording(known))
    unknown = write(tmp_path / "b.txt", "// MT Manager version: 2022.2.0\n" + XSENS, row)
    with pytest.raises(RecordingError, match=r"give the rate of the rows with --rate HZ$"):
        read_recording(unknown)
    check(read_recording(unknown, sample_rate_hz=100))


# Folders and compressed files ----------------------------------------------------------------------------------------

def phone(folder, *, sign=1.0, platform="android", standard="false"):
    """A recording of Sensor Logger with gravity apart, and a watch."""
    head = "time,seconds_elapsed,z,y,x"

    def table(name, vector):
        start = 1_700_000_000 * 10**9
        rows = [f"{start + 10_000_000 * k},{k / 100}," + cells(np.array(vector)[::-1]) for k in range(COUNT)]
        (folder / f"{name}.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")

    folder.mkdir(parents=True)
    gravity = np.array([0, 0, 9.8])
    table("Gyroscope", np.radians(RATE))
    table("Accelerometer", sign * (FORCE - gravity))
    table("Gravity", sign * gravity)
    table("AccelerometerUncalibrated", sign * FORCE / G)
    table("GyroscopeUncalibrated", np.radians(RATE + 1))
    write(folder / "WristMotion.csv", "time," + axes("rotationRate{}") + "," + axes("gravity{}") + "," + axes(
        "acceleration{}"), "{epoch},9,9,9,0,0,-1,0,0,.1")
    (folder / "Metadata.csv").write_text(f"version,platform,standardisation\n3,{platform},{standard}\n",
                                         encoding="utf-8")
    return folder


@pytest.mark.parametrize(("sign", "platform", "standard"), [
    (1.0, "android", "false"), (-1.0, "ios", "false"), (1.0, "ios", "true")])
def test_signs_of_sensor_logger(tmp_path, sign, platform, standard):
    recording = read_recording(phone(tmp_path / "phone", sign=sign, platform=platform, standard=standard))
    check(recording)
    assert ("accelerometer: signs of iOS, turned" in recording.notes) == (sign < 0)


def test_metawear(tmp_path):
    """Names begin with Meta, as those of files about a recording do."""
    for name, unit, row in (("Gyroscope", "deg/s", "{dps}"), ("Accelerometer", "g", "{g}")):
        write(tmp_path / f"MetaWear_C9_{name}_100.000Hz.csv", "epoc (ms),timestamp (+0200),elapsed (s)," + axes(
            f"{{}}-axis ({unit})").lower(), "170000{ms:07},{iso},{s}," + row)
    check(read_recording(tmp_path))


def px4(folder):
    begin = "timestamp," + ",".join(f"gyro_rad[{k}]" for k in range(3))
    write(folder / "log_7_sensor_combined_0.csv", begin + ",accelerometer_timestamp_relative," + ",".join(
        f"accelerometer_m_s2[{k}]" for k in range(3)), "{us},{rps_frd},0,{mss_frd}")
    write(folder / "log_7_vehicle_local_position_0.csv", "timestamp,vx,vy,vz,ax,ay,az", "{us},1,2,3,4,5,6")
    write(folder / "log_7_vehicle_attitude_0.csv", "timestamp,q[0],q[1],q[2],q[3]", "{us},.5,.5,-.5,.5")
    write(folder / "other_sensor_combined_0.csv", begin, "{us},0,0,0")
    return folder


def test_topics_of_px4_as_csv(tmp_path):
    for path in px4(tmp_path / "csv"), tmp_path / "csv" / "log_7_sensor_combined_0.csv":
        recording = read_recording(path)
        check(recording)
        assert recording.reference.quaternion[0] == pytest.approx([0.5, 0.5, 0.5, -0.5])
        assert recording.velocity.values[0] == pytest.approx([2, 1, -3])
    (tmp_path / "csv" / "log_7_sensor_combined_0.csv").write_text("timestamp,gyro_rad[0]\n", encoding="utf-8")
    with pytest.raises(RecordingError, match="no table of sensor_combined, vehicle_imu, sensor_gyro can be read; write "
                                             "them with ulog2csv"):
        read_recording(tmp_path / "csv" / "log_7_sensor_combined_0.csv")


def test_x_imu_rate_of_the_registers(tmp_path):
    names = "Packet number," + axes("Gyroscope {} (deg/s)") + "," + axes("Accelerometer {} (g)")
    path = write(tmp_path / "1_CalInertialAndMag.csv", names, "{k},{dps},{g}")
    assert read_recording(path).sample_rate_hz == 256
    (tmp_path / "1_Registers.csv").write_text("Packet number,Address,Value,Fixed-point value,Name\n"
                                              "70,69,7,NaN,InertialAndMagneticDataRate\n", encoding="utf-8")
    assert read_recording(path).sample_rate_hz == 64
    assert read_recording(path, sample_rate_hz=128).sample_rate_hz == 128


def test_a_folder_of_several_recordings_is_refused(tmp_path):
    for name in "one", "two":
        write(tmp_path / f"{name}.csv", *PLAIN)
    with pytest.raises(RecordingError) as error:
        read_recording(tmp_path)
    assert str(error.value) == f"{tmp_path}: 2 recordings are in it (one.csv, two.csv); name one of them"
    (tmp_path / "one.csv").unlink()
    check(read_recording(tmp_path))


def test_a_folder_in_a_folder(tmp_path):
    px4(tmp_path / "day" / "flight")
    (tmp_path / ".hidden").touch()
    check(read_recording(tmp_path))


def test_a_folder_called_data_is_not_one_of_kitti(tmp_path):
    write(tmp_path / "data" / "flight.txt", *PLAIN)
    check(read_recording(tmp_path / "data"))


def test_folders_without_a_recording_are_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"the folder is empty$"):
        read_recording(tmp_path)
    (tmp_path / "a.pdf").write_bytes(b"%PDF")
    with pytest.raises(RecordingError, match=r"no log of one recording is in the folder \(a\.pdf\); name one of its"):
        read_recording(tmp_path)


@pytest.mark.parametrize("form", ["gz", "zip", "zip of folders"])
def test_compressed_files(tmp_path, form):
    plain = write(tmp_path / "flight.csv", *PLAIN)
    path = tmp_path / "packed"
    if form == "gz":
        path.write_bytes(gzip.compress(plain.read_bytes()))
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.write(plain, "2021/day/flight.csv" if "folders" in form else "flight.csv")
            archive.writestr("__MACOSX/flight.csv", "rubbish")
    recording = read_recording(path)
    check(recording)
    assert recording.name == "packed"
    plain.write_bytes(plain.read_bytes().replace(b"Acc X", b"Foo X").replace("m/s²".encode(), b"m"))
    if form == "gz":
        path.write_bytes(gzip.compress(plain.read_bytes()))
        with pytest.raises(RecordingError) as error:
            read_recording(path)
        assert str(error.value).startswith(f"{path}: no column")


def test_damaged_archives_are_refused(tmp_path):
    packed = gzip.compress(b"Time (s)\n" * 1000)
    for name, data in ("a.gz", packed[:20]), ("b.gz", packed[:10] + b"\xff" * 30), ("c.zip", b"PK\3\4" + bytes(50)):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(RecordingError, match=r"the archive is damaged, or has a password; unpack it$"):
            read_recording(tmp_path / name)


@pytest.mark.parametrize(("data", "message"), [
    (b"\xd0\xcf\x11\xe0" + bytes(9), "an Excel workbook; save its sheet as CSV, or export CSV (phyphox"),
    (b'[{"sensor":"Gyroscope"}]', "JSON; export CSV (Sensor Logger: Zipped CSV)"),
    (b'\xef\xbb\xbf {"a": 1}', "JSON; export CSV"),
    (b"MATLAB 5.0 MAT-file" + bytes(9), "a MATLAB file; write the signals as a table of text (writetable)"),
    (b"\x89HDF\r\n", "an HDF5 or MATLAB file; write the signals as a table of text"),
    (b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS in place of the file; fetch it"),
    (b"<!DOCTYPE html>", "a page of the web or XML, not a log; download the file itself"),
    (b"PAR1", "a Parquet file; write it as CSV"), (b"7z\xbc\xaf", "a 7z archive; unpack it"),
    (b"Rar!", "a RAR archive; unpack it"), (b"#ROSBAG V1.2", "a bag of ROS before 2010; convert it with rosbag fix"),
    (b"\xfa\xff\x10", "a binary log of Xsens; export it as text with MT Manager"),
])
def test_files_of_other_programs_are_refused_with_a_remedy(tmp_path, data, message):
    path = tmp_path / "flight"
    path.write_bytes(data)
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    assert str(error.value).startswith(f"{path}: this is {message}")


def test_a_workbook_is_refused_with_a_remedy(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<a/>")
    with pytest.raises(RecordingError, match="this is an Excel workbook; save its sheet as CSV"):
        read_recording(tmp_path / "a.xlsx")
