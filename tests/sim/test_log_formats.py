"""Readers of log formats: files made here byte by byte from the formats' descriptions, and real ones where they are."""

import dataclasses
import struct
import sys
import zipfile

import numpy as np
import pytest

from strapdown_sim.errors import multiply
from strapdown_sim.recordings import RecordingError, read_log, read_recording

COUNT = 50
RATE = np.array([10.0, -20.0, 30.0])
"""deg/s, forward, left, up"""
FORCE = np.array([0.5, -1.0, 9.7])
"""m/s^2, the same axes"""
FIELD = np.array([20.0, 5.0, -40.0])
"""uT, the same axes"""
FRD = np.array([1.0, -1.0, -1.0])


def check(recording, *, rate_hz=100.0, field=FIELD, atol=0.02):
    assert recording.sample_rate_hz == pytest.approx(rate_hz, rel=1e-3)
    assert recording.gyro_deg_s[5] == pytest.approx(RATE, abs=atol)
    assert recording.accel[5] == pytest.approx(FORCE, abs=atol)
    if field is None:
        assert recording.mag is None
    else:
        assert recording.mag[recording.mag_new][0] == pytest.approx(field, abs=atol)


def stream(log, kind):
    return next(stream for stream in log.streams if stream.kind == kind)


# ULog ----------------------------------------------------------------------------------------------------------------

ULOG_FORMATS = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;int32_t accelerometer_timestamp_relative;"
                       "float[3] accelerometer_m_s2;",
    "vehicle_magnetometer": "uint64_t timestamp;uint64_t timestamp_sample;float[3] magnetometer_ga;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
}


def ulog(path, topics, formats=ULOG_FORMATS):
    """A ULog file; ``topics`` maps topics to their messages as bytes."""
    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000) + message("B", bytes(40))
    out += b"".join(message("F", f"{name}:{fields}".encode()) for name, fields in formats.items() if name in topics)
    for number, name in enumerate(topics):
        out += message("A", struct.pack("<BH", 0, number) + name.encode())
    for number, messages in enumerate(topics.values()):
        out += b"".join(message("D", struct.pack("<H", number) + body) for body in messages)
    path.write_bytes(out)
    return path


def px4():
    gyro, accel, field = np.radians(RATE * FRD), FORCE * FRD, FIELD * FRD / 100
    start = 1_700_000_000_000_000
    return {
        "sensor_combined": [struct.pack("<Q3fi3f", start + 10_000 * k, *gyro, 0, *accel) for k in range(COUNT)],
        "vehicle_magnetometer": [struct.pack("<QQ3f", start + 40_000 * k + 7, start + 40_000 * k, *(field + k / 1e6))
                                 for k in range(COUNT // 4)],
        "vehicle_attitude": [struct.pack("<Q4f", start + 20_000 * k, 0.5, 0.5, -0.5, 0.5) for k in range(COUNT // 2)]}


def test_ulog(tmp_path):
    log = read_log(ulog(tmp_path / "flight", px4()))
    recording = read_recording(tmp_path / "flight")
    check(recording)
    assert recording.mag_new.tolist() == [k % 4 == 0 and k < 48 for k in range(COUNT)]
    # A body turned from NED by (0.5, 0.5, -0.5, 0.5): forward is (0, 0, 1) down by the matrix of that quaternion.
    assert stream(log, "attitude").values[0] == pytest.approx([0.5, 0.5, 0.5, -0.5])
    assert recording.reference.meaning == "the autopilot's own estimate, not truth"
    assert len(recording.reference.time_s) == COUNT // 2


def test_ulog_with_an_accelerometer_on_its_own_time(tmp_path):
    # The force rises by 1 m/s^2 in each sample, which is 4 ms before that of the gyro.
    body = [struct.pack("<Q3fi3f", 10_000 * k + 10_000, 0, 0, 0, -4000, 0, 0, -9.8 - 0.01 * k) for k in range(COUNT)]
    recording = read_recording(ulog(tmp_path / "flight", {"sensor_combined": body}))
    assert recording.accel[10, 2] == pytest.approx(9.8 + 0.1 + 0.004)


def test_ulog_with_integrated_samples(tmp_path):
    formats = {"vehicle_imu": "uint64_t timestamp;uint64_t timestamp_sample;float[3] delta_angle;float[3] "
                              "delta_velocity;"
                              "uint32_t delta_angle_dt;uint32_t delta_velocity_dt;"}
    body = [struct.pack("<QQ6fII", 10_000 * k + 90, 10_000 * k + 10_000, *(np.radians(RATE * FRD) * 0.008),
                        *(FORCE * FRD * 0.008), 8000, 8000) for k in range(COUNT)]
    check(read_recording(ulog(tmp_path / "flight", {"vehicle_imu": body}, formats)), field=None)


def test_ulog_of_2016(tmp_path):
    """Each field has three IMUs."""
    formats = {"sensor_combined": "uint64_t timestamp;float[9] gyro_rad_s;float[9] accelerometer_m_s2;"}
    body = [struct.pack("<Q18f", 10_000 * k + 1, *np.radians(RATE * FRD), *[9] * 6, *FORCE * FRD, *[9] * 6)
            for k in range(COUNT)]
    check(read_recording(ulog(tmp_path / "flight", {"sensor_combined": body}, formats)), field=None)


def test_a_damaged_ulog_prints_nothing(tmp_path, capsys):
    data = ulog(tmp_path / "flight", px4()).read_bytes()
    (tmp_path / "flight").write_bytes(data[:70])
    with pytest.raises(RecordingError):
        read_recording(tmp_path / "flight")
    assert capsys.readouterr() == ("", "")


def test_ulog_without_a_gyro_is_refused(tmp_path):
    topics = {"vehicle_attitude": px4()["vehicle_attitude"]}
    with pytest.raises(RecordingError, match=r"none of the topics sensor_combined, .*; set SDLOG_PROFILE .* cut off$"):
        read_recording(ulog(tmp_path / "flight", topics))
    (tmp_path / "bad.ulg").write_bytes(b"ULog\x01\x12\x35\x01")
    with pytest.raises(RecordingError, match="not a ULog file that can be read"):
        read_recording(tmp_path / "bad.ulg")


@pytest.mark.parametrize(("module", "head", "form"), [("pyulog", b"ULog\x01\x12\x35\x01", "ULog"),
                                                      ("rosbags", b"#ROSBAG V2.0\n", "ROS")])
def test_without_its_extra_one_line_names_the_command(tmp_path, monkeypatch, module, head, form):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "flight").write_bytes(head)
    with pytest.raises(RecordingError) as error:
        read_recording(tmp_path / "flight")
    assert str(error.value) == (f"{tmp_path / 'flight'}: to read {form} files, install their reader: "
                                "pip install 'strapdown[logs]'")


# DataFlash -----------------------------------------------------------------------------------------------------------

DATAFLASH = {  # name: number, letters, labels
    "IMU": (100, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "MAG": (101, "QhhhB", "TimeUS,MagX,MagY,MagZ,Health"),
    "ATT": (102, "QccC", "TimeUS,Roll,Pitch,Yaw"),
    "MSG": (103, "QZ", "TimeUS,Message"),
}
SIZES = {"Q": 8, "B": 1, "f": 4, "h": 2, "c": 2, "C": 2, "Z": 64}


def dataflash(path, messages, *, between=b""):
    out = struct.pack("<2sBBB4s16s64s", b"\xa3\x95", 128, 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    for name, (number, letters, labels) in DATAFLASH.items():
        length = 3 + sum(SIZES[letter] for letter in letters)
        out += struct.pack("<2sBBB4s16s64s", b"\xa3\x95", 128, number, length, name.encode(), letters.encode(),
                           labels.encode())
    codes = {"c": "h", "C": "H", "Z": "64s"}
    for name, *values in messages:
        number, letters, _ = DATAFLASH[name]
        layout = "<2sB" + "".join(codes.get(letter, letter) for letter in letters)
        out += struct.pack(layout, b"\xa3\x95", number, *values)
        out += between
    path.write_bytes(out)
    return path


def ardupilot():
    for k in range(COUNT):
        for instance in 0, 1:
            yield ("IMU", 80_000_000 + 10_000 * k, instance, *(np.radians(RATE * FRD) * (1 + instance)), *(FORCE * FRD))
        if k % 5 == 0:
            yield ("MAG", 80_000_000 + 10_000 * k, *map(int, FIELD * FRD * 10 + [k % 2, 0, 0]), 1)
            yield ("ATT", 80_000_000 + 10_000 * k, 3000, 1000, 9000)
    yield "MSG", 81_000_000, b"ArduPlane"


def test_dataflash(tmp_path):
    path = dataflash(tmp_path / "log", ardupilot())
    recording = read_recording(path)
    check(recording, atol=0.12)
    # The second IMU turns twice as fast.
    assert read_recording(path, imu="IMU 1").gyro_deg_s[5] == pytest.approx(2 * RATE, abs=1e-4)
    assert read_recording(path, imu="1").gyro_deg_s[5] == pytest.approx(2 * RATE, abs=1e-4)
    # Roll 30, pitch 10 up and yaw 90 to the east: forward is east and up, in NWU y = -cos(10), z = sin(10).
    q = recording.reference.quaternion[0]
    forward = multiply(multiply(q, [0, 1, 0, 0]), q * [1, -1, -1, -1])[1:]
    assert forward == pytest.approx([0, -np.cos(np.radians(10)), np.sin(np.radians(10))], abs=1e-9)
    left = multiply(multiply(q, [0, 0, 1, 0]), q * [1, -1, -1, -1])[1:]
    # Right side down by 30 degrees: left is up.
    assert left[2] == pytest.approx(np.cos(np.radians(10)) * np.sin(np.radians(30)))


def test_dataflash_with_bytes_that_are_no_message(tmp_path):
    recording = read_recording(dataflash(tmp_path / "log", ardupilot(), between=b"\xa3\x00"))
    check(recording, atol=0.12)
    assert recording.notes[0].endswith("bytes that are no message, left out")


def test_dataflash_as_text(tmp_path):
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    lines += [f"FMT, {number}, 9, {name}, {letters}, {labels}" for name, (number, letters, labels) in DATAFLASH.items()]
    scales = {"ATT": 0.01}
    lines += [", ".join([name, str(time), *(str(value * scales.get(name, 1)) for value in values)])
              for name, time, *values in ardupilot() if name != "MSG"]
    (tmp_path / "flight.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
    check(read_recording(tmp_path / "flight.log"), atol=0.12)


def test_dataflash_at_the_rate_of_the_sensor(tmp_path, monkeypatch):
    """GYR and ACC at SampleUS go before a decimated IMU."""
    monkeypatch.setitem(DATAFLASH, "GYR", (104, "QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"))
    monkeypatch.setitem(DATAFLASH, "ACC", (105, "QBQfff", "TimeUS,I,SampleUS,AccX,AccY,AccZ"))
    messages = []
    for k in range(500):
        messages += [("GYR", 1000 * k + 500, 0, 1000 * k + 100, *np.radians(RATE * FRD)),
                     ("ACC", 1000 * k + 600, 0, 1000 * k + 200, *(FORCE * FRD))]
        if k % 40 == 0:
            messages.append(("IMU", 1000 * k + 500, 0, *np.zeros(3), *(FORCE * FRD)))
    check(read_recording(dataflash(tmp_path / "log", messages)), rate_hz=1000, field=None)


@pytest.mark.parametrize("message", ["ATT", "EKF1", "AHR2"])
def test_estimates_of_dataflash(tmp_path, monkeypatch, message):
    """Each version has its own messages; roll and pitch of all are in hundredths of a degree."""
    monkeypatch.setitem(DATAFLASH, message, (106, "QccC", "TimeUS,Roll,Pitch,Yaw"))
    messages = [each for each in ardupilot() if each[0] == "IMU"] + [(message, 80_000_000, 3000, 0, 0)]
    reference = read_recording(dataflash(tmp_path / "log", messages)).reference
    # Right side down by 30 degrees, about forward, which is also north.
    assert reference.quaternion[0] == pytest.approx([np.cos(np.radians(15)), np.sin(np.radians(15)), 0, 0])


def test_dataflash_with_other_fields(tmp_path, monkeypatch):
    """A message of another version, which lacks a field, is left out."""
    monkeypatch.setitem(DATAFLASH, "ATT", (102, "Qcc", "TimeUS,Roll,Pitch"))
    messages = [each if each[0] != "ATT" else each[:-1] for each in ardupilot()]
    assert read_recording(dataflash(tmp_path / "log", messages)).reference is None


def test_ulog_with_other_fields(tmp_path):
    formats = ULOG_FORMATS | {"vehicle_attitude": "uint64_t timestamp;float[4] quaternion;"}
    assert read_recording(ulog(tmp_path / "flight", px4(), formats)).reference is None


def test_dataflash_without_time_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(DATAFLASH, "IMU", (100, "ffffff", "GyrX,GyrY,GyrZ,AccX,AccY,AccZ"))
    with pytest.raises(RecordingError, match="no IMU messages with a time"):
        read_recording(dataflash(tmp_path / "log", [("IMU", *RATE, *FORCE)] * 5))


def test_dataflash_without_imu_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"no IMU messages with a time; set .* LOG_BITMASK, unless the file "
                                              "is cut off$"):
        read_recording(dataflash(tmp_path / "log", [("MSG", 1, b"hello")]))


# Blackbox ------------------------------------------------------------------------------------------------------------

FIELDS = ["loopIteration", "time", *(f"{name}[{axis}]" for name in ("accSmooth", "gyroADC") for axis in range(3)),
          "motor[0]", "motor[1]", "motor[2]", "rcCommand[3]"]
BLACKBOX_HEAD = "\n".join([
    "H Product:Blackbox flight data recorder by Nicholas Sherlock", "H Data version:2",
    f"H Field I name:{','.join(FIELDS)}", "H Field I predictor:0,0,0,0,0,0,0,0,11,5,5,4",
    "H Field I encoding:1,1,0,0,0,0,0,0,1,0,0,3", "H Field P predictor:6,2,1,1,1,3,3,3,1,1,1,1",
    "H Field P encoding:9,0,7,7,7,6,6,6,8,8,8,8", "H Field S name:flightModeFlags", "H Field S predictor:0",
    "H Field S encoding:1", "H Firmware type:Cleanflight", "H gyro_scale:0x3f800000", "H acc_1G:2048",
    "H minthrottle:1070", "H motorOutput:158,2047", ""]).encode()


def unsigned(value):
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def signed(value):
    return unsigned(2 * value if value >= 0 else -2 * value - 1)


def full_frame(iteration, time, accel, gyro):
    motors = unsigned(10) + signed(3) + signed(-4)
    # Encoding 3 negates a number of fourteen bits.
    return b"I" + unsigned(iteration) + unsigned(time) + b"".join(map(signed, [*accel, *gyro])) + motors + unsigned(5)


def change_frame(time2, accel, gyro):
    """A frame of changes: of time from a straight line, accel below 32, gyro from the mean of the last two."""
    three = bytes([0x80 | accel[0] & 63, accel[1] & 63, accel[2] & 63])
    tag = bytes([sum(bool(value) << bit for bit, value in enumerate(gyro))])
    # Four values: zero, a nibble, a byte and 16 bits, with nibbles one after the other.
    four = bytes([0b11_10_01_00, 0x71, 0x20, 0x10, 0x30 & 0xF0])
    return b"P" + signed(time2) + three + tag + b"".join(signed(value) for value in gyro if value) + four


def blackbox(frames, *, start=1_000_000):
    """Bytes of a log, and the values of its gyro and accelerometer."""
    accel, gyro = np.array([100, -200, 2000]), np.array([10, -20, 30])
    out, values = BLACKBOX_HEAD + full_frame(256, start, accel, gyro), [(accel, gyro)]
    before = before2 = gyro
    for k in range(frames):
        step, turn = np.array([k % 5 - 2, 1, -1]), np.array([k % 3, 0, -2])
        # The first change follows a frame without speed.
        out += change_frame(2000 if k == 0 else 0, step, turn)
        accel = accel + step
        mean = np.trunc((before + before2) / 2).astype(int)
        before, before2 = mean + turn, before
        values.append((accel, before))
    return out, np.array(values)


def test_blackbox(tmp_path):
    data, values = blackbox(40)
    event = b"E" + bytes([30]) + unsigned(300) + unsigned(2) + b"S" + unsigned(7)
    (tmp_path / "log.bin").write_bytes(data + event + full_frame(300, 1_082_000, [1, 2, 2048], [4, 5, 6])
                                       + b"E\xffEnd of log\0")
    recording = read_recording(tmp_path / "log.bin")
    assert len(recording.time_s) == 42
    assert recording.period_s == pytest.approx([0.002] * 42)
    assert recording.gyro_deg_s[:41] == pytest.approx(values[:, 1].astype(float))
    assert recording.accel[:41] == pytest.approx(values[:, 0] / 2048 * 9.80665)
    assert recording.gyro_deg_s[41].tolist() == [4, 5, 6]
    assert recording.mag is None


def test_blackbox_of_several_logs(tmp_path):
    (short, _), (long, values) = blackbox(3), blackbox(30)
    (tmp_path / "log.bbl").write_bytes(short + b"E\xffEnd of log\0" + long)
    recording = read_recording(tmp_path / "log.bbl")
    assert len(recording.time_s) == len(values)
    assert recording.notes[0].startswith("log 2 of 2 is taken, the longest; the others are 1 (")
    assert len(read_recording(tmp_path / "log.bbl", log="1").time_s) == 4
    with pytest.raises(RecordingError, match=r"--log 3 is not in the file; it has logs 1 to 2$"):
        read_recording(tmp_path / "log.bbl", log="3")


def test_blackbox_with_damage(tmp_path):
    (first, values), (_, _) = blackbox(10), blackbox(0)
    again = full_frame(512, 1_022_000, [0, 0, 2048], [7, 8, 9])
    after = full_frame(513, 1_024_000, [0, 0, 2048], [7, 8, 9])
    (tmp_path / "log.bbl").write_bytes(first + b"\x00\x99garbage" + again + after)
    recording = read_recording(tmp_path / "log.bbl")
    # The last frame before the damage is left out with it, and filled in.
    assert recording.timing.faults["samples lost, filled in on a line"] == 1
    assert len(recording.time_s) == len(values) + 2
    assert recording.gyro_deg_s[-1].tolist() == [7, 8, 9]
    assert any(note.startswith("damaged frames: 1") for note in recording.notes)


def test_blackbox_time_wraps(tmp_path):
    data, values = blackbox(40, start=2**32 - 20_000)
    (tmp_path / "log.bbl").write_bytes(data)
    assert read_recording(tmp_path / "log.bbl").period_s == pytest.approx([0.002] * len(values))


def test_blackbox_without_the_unit_of_its_accelerometer(tmp_path):
    data, values = blackbox(40)
    (tmp_path / "log.bbl").write_bytes(data.replace(b"H acc_1G:2048\n", b""))
    recording = read_recording(tmp_path / "log.bbl")
    assert recording.accel == pytest.approx(values[:, 0] / 2048 * 9.80665)
    assert recording.notes == ("accelerometer: 2048 units are taken as one g",)


def test_blackbox_of_full_frames(tmp_path):
    """Without fields of changes, as at rates below that of full frames."""
    head = b"\n".join(line for line in BLACKBOX_HEAD.split(b"\n") if b"Field P" not in line)
    frames = b"".join(full_frame(32 * k, 32_000 * k, [0, 0, 2048], [k, 2, 3]) for k in range(20))
    (tmp_path / "log.bbl").write_bytes(head + frames)
    assert read_recording(tmp_path / "log.bbl").gyro_deg_s[:, 0].tolist() == list(range(20))


def test_blackbox_with_damaged_headers_is_refused(tmp_path):
    (tmp_path / "log.bbl").write_bytes(BLACKBOX_HEAD[:BLACKBOX_HEAD.index(b"H Field I encoding") + 22])
    with pytest.raises(RecordingError, match=r"the headers of log 1 are damaged, or the file is cut off$"):
        read_recording(tmp_path / "log.bbl")
    (tmp_path / "log.bbl").write_bytes(blackbox(9)[0].replace(b"0x3f8", b"0y3f8"))
    with pytest.raises(RecordingError, match=r"the headers of log 1 are damaged, or the file is cut off$"):
        read_recording(tmp_path / "log.bbl")


def test_blackbox_without_accelerometer_is_refused(tmp_path):
    (tmp_path / "log.bbl").write_bytes(BLACKBOX_HEAD.replace(b"accSmooth", b"other") + b"E\xffEnd of log\0")
    with pytest.raises(RecordingError, match=r"log 1 has no gyro and accelerometer; set blackbox_disable_acc = OFF$"):
        read_recording(tmp_path / "log.bbl")


# ROS -----------------------------------------------------------------------------------------------------------------

def imu_messages(types, stamps, *, orientation=True):
    """Messages of both topics of an IMU, with their topic, type and time."""
    names = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"
    imu, field, header, time, vector, quaternion = (types[name] for name in (
        *names, "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Vector3",
        "geometry_msgs/msg/Quaternion"))
    extra = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}
    none = np.zeros(9)
    for k, stamp in enumerate(stamps):
        head = header(stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="imu", **extra)
        absent = np.array([-1.0, *[0] * 8])
        yield "/imu/data", names[0], stamp, imu(
            header=head, orientation=quaternion(x=0.0, y=0.0, z=0.6, w=0.8 + k * 0.0),
            orientation_covariance=none if orientation else absent, angular_velocity=vector(*np.radians(RATE)),
            angular_velocity_covariance=none, linear_acceleration=vector(*FORCE), linear_acceleration_covariance=none)
        yield "/imu/mag", names[1], stamp, field(
            header=head, magnetic_field=vector(*(FIELD * 1e-6 if k % 2 == 0 else [np.nan] * 3)),
            magnetic_field_covariance=none)


def write_messages(bag, store, serialize, messages):
    """Write messages into a bag of ROS 1 or ROS 2. They arrive 3 ms after their stamps."""
    connections = {}
    for topic, kind, stamp, message in messages:
        if topic not in connections:
            connections[topic] = bag.add_connection(topic, kind, typestore=store)
        bag.write(connections[topic], stamp + 3_000_000, serialize(message, kind))


STAMPS = [1_700_000_000 * 10**9 + 10**7 * k for k in range(COUNT)]


def ros_check(path, orientation=True):
    recording = read_recording(path)
    check(recording)
    assert recording.mag_new.tolist() == [k % 2 == 0 for k in range(COUNT)]
    if orientation:
        assert recording.reference.frame == "ENU"
        assert recording.reference.quaternion[3] == pytest.approx([0.8, 0, 0, 0.6])
    else:
        assert recording.reference is None


@pytest.mark.parametrize("orientation", [True, False])
def test_ros1_bag(tmp_path, orientation):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "one.bag") as bag:
        write_messages(bag, store, store.serialize_ros1, imu_messages(store.types, STAMPS, orientation=orientation))
    ros_check((tmp_path / "one.bag").rename(tmp_path / "without_suffix"), orientation)


def ros1_bag(path, compression=None):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    bag = Writer(path)
    if compression:
        bag.set_compression(Writer.CompressionFormat[compression])
    with bag:
        write_messages(bag, store, store.serialize_ros1, imu_messages(store.types, STAMPS))
    return path.read_bytes()


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_ros1_bag_without_its_index(tmp_path, compression):
    data = ros1_bag(tmp_path / "one.bag", compression)
    # The index is behind the chunk, whose length stands behind its header.
    (tmp_path / "cut").write_bytes(data[:data.index(b"op=\x04")])
    ros_check(tmp_path / "cut")


def test_ros1_bag_that_was_cut_off(tmp_path):
    data = ros1_bag(tmp_path / "one.bag")
    (tmp_path / "cut").write_bytes(data[:data.index(b"op=\x05") + 15_000])
    recording = read_recording(tmp_path / "cut")
    assert 20 < len(recording.time_s) < COUNT
    check(recording)


def test_ros1_bag_with_a_damaged_chunk(tmp_path):
    data = ros1_bag(tmp_path / "one.bag", "BZ2")
    at = data.index(b"BZh")
    (tmp_path / "bad").write_bytes(data[:at] + bytes(50) + data[at + 50:])
    with pytest.raises(RecordingError, match="no messages of type sensor_msgs/Imu"):
        read_recording(tmp_path / "bad")


def test_ros1_bag_with_an_old_magnetometer(tmp_path):
    """Before sensor_msgs/MagneticField drivers sent geometry_msgs/Vector3Stamped."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    vector = "geometry_msgs/msg/Vector3Stamped"
    with Writer(tmp_path / "one.bag") as bag:
        write_messages(bag, store, store.serialize_ros1, (
            each if each[0] != "/imu/mag" else (each[0], vector, each[2], store.types[vector](
                header=each[3].header, vector=each[3].magnetic_field)) for each in imu_messages(store.types, STAMPS)))
    check(read_recording(tmp_path / "one.bag"), field=FIELD * 1e-6, atol=1e-4)


def test_ros1_bag_in_g(tmp_path):
    """Some drivers send the specific force in g."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    vector = store.types["geometry_msgs/msg/Vector3"](*FORCE / 9.80665)
    with Writer(tmp_path / "one.bag") as bag:
        write_messages(bag, store, store.serialize_ros1, (
            (*each[:3], dataclasses.replace(each[3], linear_acceleration=vector))
            for each in imu_messages(store.types, STAMPS) if each[0] == "/imu/data"))
    recording = read_recording(tmp_path / "one.bag")
    check(recording, field=None)
    assert recording.notes == ("/imu/data: the specific force is not in m/s^2, as it should be; g makes its median one "
                               "g",)


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_compressed_ros2_bag(tmp_path, storage, mode):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    bag = Writer(tmp_path / "two", version=9, storage_plugin=StoragePlugin[storage])
    bag.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with bag:
        write_messages(bag, store, store.serialize_cdr, imu_messages(store.types, STAMPS))
    ros_check(tmp_path / "two")
    alone = next(file for file in (tmp_path / "two").iterdir() if file.suffix != ".yaml")
    ros_check(alone)
    if mode == "FILE":
        (tmp_path / "cut").write_bytes(alone.read_bytes()[:-100])
        with pytest.raises(RecordingError, match="the archive is damaged"):
            read_recording(tmp_path / "cut")


def test_damaged_sqlite_is_refused_with_a_remedy(tmp_path):
    (tmp_path / "a.db3").write_bytes(b"SQLite format 3\0" + bytes(200))
    with pytest.raises(RecordingError, match=r"recover it: sqlite3 a\.db3 \.recover \| sqlite3 NEW\.db3$"):
        read_recording(tmp_path / "a.db3")


@pytest.mark.parametrize(("encoding", "schema"), [("json", "jsonschema"), ("protobuf", "protobuf")])
def test_mcap_in_another_encoding_is_refused(tmp_path, encoding, schema):
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", encoding, writer.register_schema("foxglove.Imu", schema, b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(RecordingError, match=rf"its topics: /imu \(foxglove.Imu, {encoding}\)$"):
        read_recording(tmp_path / "a.mcap")


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_ros2_bag(tmp_path, storage, alone):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "two", version=9, storage_plugin=StoragePlugin[storage]) as bag:
        write_messages(bag, store, store.serialize_cdr, imu_messages(store.types, STAMPS))
    path = tmp_path / "two"
    if alone:
        path = next(file for file in path.iterdir() if file.suffix in (".db3", ".mcap"))
    ros_check(path)


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_mcap_of_ros1(tmp_path, compression):
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with (tmp_path / "one.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType[compression], chunk_size=4000)
        writer.start()
        channels = {}
        for topic, kind, stamp, message in imu_messages(store.types, STAMPS):
            if topic not in channels:
                schema = writer.register_schema(kind.replace("/msg", ""), "ros1msg", b"")
                channels[topic] = writer.register_channel(topic, "ros1", schema)
            writer.add_message(channels[topic], stamp, bytes(store.serialize_ros1(message, kind)), stamp)
        writer.finish()
    ros_check(tmp_path / "one.mcap")
    # A file that was cut off has its first chunks.
    (tmp_path / "one.mcap").write_bytes((tmp_path / "one.mcap").read_bytes()[:9000 if compression == "NONE" else 900])
    assert 2 <= len(read_recording(tmp_path / "one.mcap").time_s) < COUNT


def test_ros_bag_without_imu_is_refused(tmp_path):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "one.bag") as bag:
        connection = bag.add_connection("/imu/mag", "sensor_msgs/msg/MagneticField", typestore=store)
        for topic, kind, stamp, message in imu_messages(store.types, STAMPS):
            if topic == "/imu/mag":
                bag.write(connection, stamp, store.serialize_ros1(message, kind))
    with pytest.raises(RecordingError, match=r"no messages of type sensor_msgs/Imu with a rate, in the encoding of "
                                             r"ROS; record or convert to them; its topics: /imu/mag "
                                             r"\(sensor_msgs/msg/MagneticField\)$"):
        read_recording(tmp_path / "one.bag")
    # A record whose header has no field "op".
    (tmp_path / "bad.bag").write_bytes(b"#ROSBAG V2.0\n" + struct.pack("<II3sI", 7, 3, b"a=b", 0))
    with pytest.raises(RecordingError, match="not a bag that can be read"):
        read_recording(tmp_path / "bad.bag")


# Text files ----------------------------------------------------------------------------------------------------------

def text(path, head, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def test_x_imu3(tmp_path):
    head = ",".join(["Timestamp (us)", *(f"{name} {axis} ({unit})" for name, unit in (
        ("Gyroscope", "deg/s"), ("Accelerometer", "g")) for axis in "XYZ")])
    inertial = text(tmp_path / "Inertial.csv", head, [[10_000 * k, *RATE, *FORCE / 9.80665] for k in range(COUNT)])
    field = text(tmp_path / "Magnetometer.csv", "Timestamp (us),X Axis (a.u.),Y Axis (a.u.),Z Axis (a.u.)",
                 [[52_000 * k, 0.5, 0.1 + k, -1] for k in range(9)])
    text(tmp_path / "Quaternion.csv", "Timestamp (us),W Element,X Element,Y Element,Z Element",
         [[20_000 * k, *QUATERNION] for k in range(COUNT // 2)])
    recording = read_recording(inertial)
    check(recording, field=[0.5, 0.1, -1])
    assert recording.reference.quaternion[0] == pytest.approx(QUATERNION)
    assert np.flatnonzero(recording.mag_new).tolist() == [round(5.2 * k) for k in range(9)]
    with pytest.raises(RecordingError) as error:
        read_recording(field)
    assert str(error.value) == (f"{field}: only a magnetometer is in this file; replay the file of the inertial sensor "
                                "beside it (Inertial.csv): it finds this one")


def xsens(path, *, tail=""):
    head = "// Sample rate: 50.0Hz\n" + "\t".join(
        ["Counter", *(f"{name}_{axis}" for name in ("Acc", "Gyr", "Mag") for axis in "XYZ"),
         *(f"Quat_{axis}" for axis in "wxyz")])
    rows = [" ".join(["", *map(str, [(65530 + k) % 65536])]) + "\t" + "\t".join(
        map(str, [*FORCE, *np.radians(RATE), 0.5, 0.1, -1, *QUATERNION])) + tail for k in range(COUNT) if k != 20]
    path.write_text(head + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


UP = FORCE / np.linalg.norm(FORCE)
QUATERNION = np.array([1 + UP[2], UP[1], -UP[0], 0]) / np.linalg.norm([1 + UP[2], UP[1], -UP[0], 0])
"""The shortest turn that makes FORCE vertical."""


@pytest.mark.parametrize("tail", ["", "\t"])
def test_xsens(tmp_path, tail):
    recording = read_recording(xsens(tmp_path / "MT.txt", tail=tail))
    check(recording, rate_hz=50, field=[0.5, 0.1, -1])
    # The counter wraps, and one sample is lost.
    assert recording.timing.faults == {"gaps, bridged": 1, "samples lost, filled in on a line": 1}
    assert recording.reference.quaternion[0] == pytest.approx(QUATERNION)


def phone(folder, units):
    text(folder / "Gyroscope.csv", f'"Time (s)","X ({units[0]})","Y ({units[0]})","Z ({units[0]})"',
         [[f"{0.01 * k + 0.2:.4e}", *np.radians(RATE)] for k in range(COUNT)])
    text(folder / "Accelerometer.csv", f'"Time (s)","X ({units[1]})","Y ({units[1]})","Z ({units[1]})"',
         [[0.01 * k + 0.203, *FORCE] for k in range(COUNT)])
    text(folder / "Linear Acceleration.csv", '"Time (s)","X (m/s^2)","Y (m/s^2)","Z (m/s^2)"',
         [[0.01 * k + 0.203, 0, 0, 0.01] for k in range(COUNT)])
    text(folder / "Magnetometer.csv", '"Time (s)","X (µT)","Y (µT)","Z (µT)"',
         [[0.05 * k + 0.2, *FIELD + k / 100] for k in range(COUNT // 5)])
    text(folder / "meta" / "device.csv", "property,value", [["deviceModel", "phone"]])
    return folder


def zipped(folder):
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w") as archive:
        for file in folder.rglob("*.csv"):
            archive.write(file, file.relative_to(folder))
    return path


@pytest.mark.parametrize("form", ["folder", "zip"])
def test_phyphox(tmp_path, form):
    folder = phone(tmp_path / "phone", ("rad/s", "m/s^2"))
    recording = read_recording(zipped(folder) if form == "zip" else folder)
    check(recording)
    assert recording.mag_new.sum() == COUNT // 5


def logger(folder, *, total):
    """Files of Sensor Logger: axes in the order z, y, x."""
    start = 1_700_000_000 * 10**9

    def rows(vector, delay):
        return [[start + 10_000_000 * k + delay, 0.01 * k, *np.array(vector)[::-1]] for k in range(COUNT)]

    head = "time,seconds_elapsed,z,y,x"
    text(folder / "Gyroscope.csv", head, rows(np.radians(RATE), 0))
    text(folder / "Accelerometer.csv", head, rows(FORCE - [0, 0, 9.0], 1_000_000))
    text(folder / "Gravity.csv", head, rows([0, 0, 9.0], 1_000_000))
    if total:
        text(folder / "TotalAcceleration.csv", head, rows(FORCE, 1_000_000))
    text(folder / "Magnetometer.csv", head, rows(FIELD, 2_000_000))
    text(folder / "Metadata.csv", "version,device name", [["3", "phone"]])
    return folder


@pytest.mark.parametrize("total", [True, False])
def test_sensor_logger(tmp_path, total):
    recording = read_recording(logger(tmp_path / "phone", total=total))
    check(recording)
    added = [note for note in recording.notes if note.startswith("gravity of Gravity.csv is added")]
    assert len(added) == (not total)


def test_one_file_of_a_phone_is_refused_with_its_folder(tmp_path):
    folder = logger(tmp_path / "phone", total=True)
    for name, sensor in ("Gyroscope", "gyroscope"), ("TotalAcceleration", "accelerometer"):
        with pytest.raises(RecordingError) as error:
            read_recording(folder / f"{name}.csv")
        assert str(error.value) == (f"{folder / name}.csv: only the {sensor} is in this file; replay the folder with "
                                    "the "
                                    f"files of all sensors: {folder}")


def test_phone_without_gravity_is_refused(tmp_path):
    folder = logger(tmp_path / "phone", total=False)
    (folder / "Gravity.csv").unlink()
    (folder / "Accelerometer.csv").write_text((folder / "Accelerometer.csv").read_text(encoding="utf-8").replace(
        f"{FORCE[2] - 9.0:.17g}", "0.1"), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"gravity was removed from it \(linear acceleration\); use the "
                                              "accelerometer "
                                             r"with gravity \(TotalAcceleration\.csv of Sensor Logger"):
        read_recording(folder)


def test_phone_without_gyro_is_refused(tmp_path):
    folder = phone(tmp_path / "phone", ("rad/s", "m/s^2"))
    (folder / "Gyroscope.csv").unlink()
    with pytest.raises(RecordingError, match=r"no file with a gyroscope is in it \(Accelerometer\.csv, .*\); record "
                                              "the "
                                             r"gyroscope too$"):
        read_recording(folder)


def test_euroc(tmp_path):
    imu = ("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
           "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]")
    text(tmp_path / "mav0/imu0/data.csv", imu, [[STAMPS[k], *np.radians(RATE), *FORCE] for k in range(COUNT)])
    pose = ("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []")
    text(tmp_path / "mav0/state_groundtruth_estimate0/data.csv", pose,
         [[STAMPS[k], 1, 2, 3, *QUATERNION] for k in range(5, COUNT, 5)])
    recording = read_recording(tmp_path)
    check(recording, field=None)
    assert recording.reference.meaning == "the data set's ground truth"
    assert recording.reference.time_s[0] == pytest.approx(0.05, abs=1e-6)
    assert recording.reference.quaternion[0] == pytest.approx(QUATERNION)
    check(read_recording(tmp_path / "mav0/imu0/data.csv"), field=None)


def test_kitti(tmp_path):
    record = [49.0, 8.4, 112.0, 0.1, -0.2, np.pi / 2, 1, 2, 3, 0, 0, *FORCE, 0, 0, 0, *np.radians(RATE), *[0] * 10]
    for k in range(COUNT):
        path = tmp_path / "oxts" / "data" / f"{k:010}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(" ".join(map(str, record)) + "\n", encoding="utf-8")
    (tmp_path / "oxts" / "timestamps.txt").write_text(
        "\n".join(f"2011-09-26 13:02:{25 + k // 100:02}.{k % 100 * 10_000_000:09}" for k in range(COUNT)) + "\n",
        encoding="utf-8")
    for path in tmp_path, tmp_path / "oxts", tmp_path / "oxts" / "data" / "0000000000.txt":
        recording = read_recording(path)
        check(recording, field=None)
    # Yaw of 90 degrees from east, pitch down by -0.2 rad: forward is north and up.
    q = recording.reference.quaternion[0]
    forward = multiply(multiply(q, [0, 1, 0, 0]), q * [1, -1, -1, -1])[1:]
    assert forward == pytest.approx([0, np.cos(0.2), np.sin(0.2)], abs=1e-9)
    (tmp_path / "oxts" / "timestamps.txt").write_text("2011-09-26 13:02:25.0\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"timestamps\.txt: 1 times of 50 records; complete them$"):
        read_recording(tmp_path)


# Real files ----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize(("name", "samples", "rate_hz", "estimate"), [
    ("px4_small.ulg", 1298, 200, True), ("px4_sitl.ulg", 7783, 250, True), ("ardupilot_1s.BIN", 45, 50, True),
    ("betaflight_two_logs.bbl", 24_893, 498, False), ("phidgets_upside_down.bag", 13_964, 250, False),
    ("xio_fusion_sensor_data.csv", 13_514, 100, False), ("xio_ngimu_sensors.csv", 499, 50, False),
    ("xio_ximu3_Inertial.csv", 500, 50, False), ("xsens_mt_manager.txt", 953, 50, True)])
def test_real_files(shared_logs, name, samples, rate_hz, estimate):
    recording = read_recording(shared_logs / name)
    filled = recording.timing.faults.get("samples lost, filled in on a line", 0)
    assert len(recording.time_s) - filled == samples
    assert recording.sample_rate_hz == pytest.approx(rate_hz, rel=0.07)
    assert 9.2 < np.median(np.linalg.norm(recording.accel, axis=1)) < 10.6
    assert (recording.reference is not None) == estimate


def test_a_magnetometer_alone_is_refused_with_the_file_beside_it(shared_logs):
    with pytest.raises(RecordingError, match=r"replay the file of the inertial sensor beside it \(xio_ximu3_Inertial"):
        read_recording(shared_logs / "xio_ximu3_Magnetometer.csv")
