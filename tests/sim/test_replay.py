"""Whole recordings through the circuit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from vcd.reader import TokenKind, tokenize

from strapdown.config import ConfigError
from strapdown.cores import CONFIGS, FLIGHT_6AXIS, MAHONY, QUATERNION_J2, THESIS_X8, main_module
from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_sim.errors import angle_difference, attitude_errors, match_reference
from strapdown_sim.recordings import Log, RecordingError, Stream, read_recording, recording_of, recordings_of
from strapdown_sim.replay import for_recording, port_inputs, replay, replay_channels
from strapdown_sim.truth import REFERENCES

# float32 is good to 2**-24; Kp = 0.5 forgets an error in two seconds, some 600 updates of ten
# roundings each. If all of them went one way it would be 600·10·2**-24 rad = 0.02 degrees; they
# do not, and the requirement is half of that.
LARGEST_DEG = 0.01


def check(recording, folder, models, **options):
    result = replay(recording, MAHONY, folder, build=models, command=(), **options)
    summary = result.summary
    assert summary["samples"] == len(recording.time_s) == len(result.quaternion)
    assert summary["bits_differing_from_twin"] == 0
    assert summary["refused_updates"] == 0
    assert summary["against_float64_reference_deg"]["max"] <= LARGEST_DEG
    return summary


@pytest.mark.verilator
def test_x_imu_recording(x_imu_recording, tmp_path, models, root):
    summary = check(read_recording(x_imu_recording), tmp_path, models, html=True)
    assert summary["samples"] == 12_626
    assert summary["sample_rate_hz"] == 256
    # `make demo` runs the same; its table in the README must be correct.
    page = (tmp_path / "replay.html").read_text(encoding="utf-8")
    assert "<th>bits that differ from the twin</th><td>0</td>" in page
    written = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert block((root / "README.md").read_text(encoding="utf-8"), "demo")[1].strip() == docs.demo_block(written)


@pytest.mark.verilator
def test_80_seconds_at_286_hz(shared_recordings, tmp_path, models):
    summary = check(read_recording(shared_recordings / "broad_02_undisturbed_slow_rotation_B.npz"), tmp_path, models)
    assert summary["samples"] == 22_857
    assert summary["against_recorded_reference_deg"]["samples"] > 10_000


CASES = {  # file: configuration, right yaw in degrees, tolerance
    "two_rates": ("flight_6axis", 1.80, 0.01),
    # Steps of 10 ms, then 400 of 5 ms at 45 deg/s. The first of these samples ends a step of 10 ms, but its rate holds
    # for the step of 5 ms that begins at it.
    "two_rates_90deg": ("flight_6axis", 90.0, 0.01),
    "dropped_one": ("flight", 0.0, 1e-3), "late_sample_b": ("flight", 0.0, 1e-3), "dup_stamps": ("flight", 0.0, 1e-3)}


def right_answer(recording, config):
    """Pitch, roll and yaw of the float64 reference at the end, with each sample's own period and new fields."""
    config = for_recording(CONFIGS[config], recording)
    return REFERENCES[main_module(config)](config).run(
        recording.accel, recording.mag, recording.gyro_deg_s, period_s=recording.period_s, mag_valid=recording.mag_new)


@pytest.mark.parametrize("name", CASES)
def test_cases_of_time(shared_cases, name):
    config, yaw, tolerance = CASES[name]
    truth = right_answer(read_recording(shared_cases / f"{name}.csv"), config)
    assert angle_difference(truth.yaw[-1], yaw) == pytest.approx(0, abs=tolerance)
    assert truth.pitch[-1] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(("name", "like"), [("mag20_held", "mag20_zero"), ("mag_nan", "mag_zero")])
def test_cases_of_the_field(shared_cases, name, like):
    found, right = (right_answer(read_recording(shared_cases / f"{file}.csv"), "flight") for file in (name, like))
    assert (found.q_b2n == right.q_b2n).all()


def test_a_false_equilibrium_has_a_status_bit(shared_cases):
    """The body heads south and is level; the filter stays at a yaw of zero for ever."""
    recording = read_recording(shared_cases / "heading_south.csv")
    config = for_recording(MAHONY, recording)
    system = config.systems()["INS_top"](config)
    result, _ = system.run(config.pool, system.bind(a=recording.accel, m=recording.mag, g=recording.gyro_deg_s))
    assert result["out_yaw"][-1] == 0
    assert result["out_pitch"][-1] == pytest.approx(-16.4, abs=0.1)
    assert result["heading_reversed"].all()
    assert not result["tilt_reversed"].any()


def turning(steps):
    """A Recording of a level sensor that turns at 90 deg/s in its second half."""
    time_s, rates = np.cumsum(steps) - steps[0], np.zeros((len(steps), 3))
    rates[len(steps) // 2:, 2] = 90
    force = np.tile([0, 0, 9.80665], (len(steps), 1))
    return recording_of(Log(Path("turning.csv"), "made here", (
        Stream("gyro", "imu", time_s, rates, "deg/s"), Stream("accel", "imu", time_s, force, "m/s^2"))))


@pytest.mark.verilator
def test_each_period_reaches_the_circuit(tmp_path, models):
    recording = turning(np.repeat([0.01, 0.005], 30))
    result = replay(recording, FLIGHT_6AXIS, tmp_path / "own", build=models, command=("generate",))
    assert result.summary["bits_differing_from_twin"] == 0
    # 30 samples of 5 ms.
    assert result.angles[-1, 2] == pytest.approx(90 * 30 * 0.005, abs=1e-3)
    assert result.summary["time"]["each_sample_has_its_period"]
    assert result.summary["time"]["one_rate_error_deg"] == 0
    assert "in_period" in (tmp_path / "own" / "INS_flight.v").read_text(encoding="utf-8")
    assert "--set period_input=true" in (tmp_path / "own" / "INS_flight.v").read_text(encoding="utf-8")


def test_a_configuration_can_refuse_the_period():
    recording = turning(np.repeat([0.01, 0.005], 30))
    assert for_recording(FLIGHT_6AXIS, recording).period_input
    assert not for_recording(FLIGHT_6AXIS.replace(period_input=False), recording).period_input
    # One rate stands for 5 ms in the 30 samples at 90 deg/s.
    assert recording.timing.one_rate_error_deg == pytest.approx(90 * 30 * (1 / recording.sample_rate_hz - 0.005))


def values_in(path, scope, port):
    """Times in ns and values of a port in a waveform, by pyvcd, which is independent of Verilator."""
    scopes, code, now, found = [], None, 0, []
    with path.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.SCOPE:
                scopes.append(token.scope.ident)
            elif token.kind is TokenKind.UPSCOPE:
                scopes.pop()
            elif token.kind is TokenKind.VAR and (scopes[-1], token.var.reference) == (scope, port):
                code = token.var.id_code
            elif token.kind is TokenKind.TIMESCALE:
                assert (token.timescale.magnitude.value, token.timescale.unit.value) == (1, "ns")
            elif token.kind is TokenKind.CHANGE_TIME:
                now = token.time_change
            elif token.kind in (TokenKind.CHANGE_VECTOR, TokenKind.CHANGE_SCALAR):
                change = token.vector_change if token.kind is TokenKind.CHANGE_VECTOR else token.scalar_change
                if change.id_code == code:
                    found.append((now, int(change.value)))
    return np.array(found).T


@pytest.mark.verilator
def test_waves_of_a_stretch(tmp_path, models):
    """The ports of each update in the waveform have the values of outputs.csv and of the recording."""
    recording = turning(np.repeat([0.01, 0.005], 30))
    result = replay(recording, QUATERNION_J2, tmp_path, build=models, command=(), waves=(0.1, 0.35))
    assert result.summary["bits_differing_from_twin"] == 0
    rows = np.flatnonzero((recording.time_s >= 0.1) & (recording.time_s <= 0.35))
    kept = result.summary["waves"]
    assert kept["file"] == "replay.vcd"
    assert kept["updates"] == [rows[0] + 1, rows[-1] + 1]
    assert (kept["from_s"], kept["to_s"]) == (recording.time_s[rows[0]], recording.time_s[rows[-1]])
    path = tmp_path / "replay.vcd"
    assert kept["bytes"] == path.stat().st_size
    table = np.genfromtxt(tmp_path / "outputs.csv", delimiter=",", names=True)

    def at(port, time_ns):
        """Values that a port has at times."""
        changed, values = values_in(path, "QUAT_direct", port)
        return values[np.searchsorted(changed, time_ns, side="right") - 1]

    changed, levels = values_in(path, "QUAT_direct", "out_quat_finish")
    finished = changed[1:][np.diff(levels) > 0]
    begin = np.rint(1e9 * recording.time_s[rows]).astype(int)
    # The edge that takes the inputs is half a period of 10 ns after the begin; then come the cycles of the latency.
    assert (finished - begin - 5 == 10 * result.summary["cycles_per_update"]).all()
    for index in range(4):
        numbers = at(f"out_e{index}", finished).astype(np.uint32).view(np.float32)
        assert [f"{number:.9f}" for number in numbers] == [f"{number:.9f}" for number in table[f"e{index}"][rows]]
    assert at("in_rate_en", begin).all()
    rate = at("in_r", begin).astype(np.uint32).view(np.float32)
    assert np.array_equal(rate, np.radians(recording.gyro_deg_s[rows, 2]).astype(np.float32))


def test_waves_of_no_sample(tmp_path):
    recording = turning(np.repeat([0.01, 0.005], 30))
    for stretch in (1, 2), (0.3, 0.2), (-2, -1):
        with pytest.raises(RecordingError, match=r"^turning has no sample between \S+ and \S+ s: choose a "
                                                 r"stretch of its time, 0 to 0\.44 s$"):
            replay(recording, QUATERNION_J2, tmp_path / "out", build=tmp_path, command=(), waves=stretch)
    assert not (tmp_path / "out").exists()


def test_waves_of_a_long_stretch(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.replay.MOST_WAVES", 20)
    recording = turning(np.repeat([0.01, 0.005], 30))
    with pytest.raises(RecordingError, match=r"^turning has 21 samples between 0 and 0\.205 s: choose a shorter "
                                             r"stretch, with at most 20 samples$"):
        replay(recording, QUATERNION_J2, tmp_path / "out", build=tmp_path, command=(), waves=(0, 0.205))
    assert not (tmp_path / "out").exists()


def test_px4_tilt(shared_logs):
    recording = read_recording(shared_logs / "px4_small.ulg")
    truth = right_answer(recording, "flight")
    match = match_reference(recording, truth.q_b2n)
    assert attitude_errors(match.q_est, match.q_ref).inclination.max() < 1.2
    assert recording.reference.meaning == "the autopilot's own estimate, not truth"


@pytest.mark.verilator
def test_several_imus_of_a_log_share_a_core(tmp_path, models):
    time_s, still = np.arange(40) / 100, np.tile([0, 0, 9.80665], (40, 1))
    # The second IMU turns the other way, 3 ms later; the third has too few samples.
    log = Log(Path("three.bin"), "made here", (
        Stream("gyro", "one", time_s, np.tile([0, 0, 50.0], (40, 1))), Stream("accel", "one", time_s, still),
        Stream("gyro", "two", time_s + 0.003, np.tile([0, 0, -50.0], (40, 1))),
        Stream("accel", "two", time_s + 0.003, still),
        Stream("gyro", "three", time_s[::4], np.tile([0, 0, 9.0], (10, 1)))))
    recordings = recordings_of(log, 8)
    assert [recording.name for recording in recordings] == ["three", "three, two"]
    result = replay_channels(recordings, THESIS_X8, tmp_path / "out", build=models, command=(), html=True, bag="mcap")
    assert result.summary["bits_differing_from_twin"] == 0
    assert result.summary["samples"] == 80
    for channel in "01":
        assert result.summary["channels"][channel]["against_float64_reference_deg"]["max"] < LARGEST_DEG
    ends = [float((tmp_path / "out" / f"channel_{channel}" / "attitude.csv").read_text(encoding="utf-8")
                  .splitlines()[-1].rpartition(",")[2]) for channel in range(2)]
    assert ends[0] == pytest.approx(50 * 0.4, abs=0.1)
    assert ends[1] == pytest.approx(360 - 50 * 0.4, abs=0.1)
    for channel, end in enumerate(ends):
        folder = tmp_path / "out" / f"channel_{channel}"
        page = (folder / "replay.html").read_text(encoding="utf-8")
        assert f"<th>recording</th><td>{recordings[channel].name}</td>" in page
        assert "<th>samples</th><td>40 at 100 Hz</td>" in page
        assert "magnetometer_missing" in page
        (run,) = (json.loads(data) for data in re.findall(r"const run = (.*);</script>", page))
        *_, (w, _, _, z) = run["attitude"]["quaternion"]
        # Two numbers of four decimals make an angle.
        assert 2 * np.degrees(np.arctan2(z, w)) % 360 == pytest.approx(end, abs=0.02)
        again = read_recording(folder / "imu")
        assert len(again.time_s) == 40
        assert again.gyro_deg_s[5, 2] == pytest.approx(recordings[channel].gyro_deg_s[5, 2])


@pytest.mark.verilator
def test_channels_get_the_period_of_each_sample(tmp_path, models):
    """Steps of 10 ms and of 5 ms: the core and its reference get them, and the command line says so."""
    time_s = np.cumsum(np.where(np.arange(40) < 20, 0.01, 0.005))
    still = np.tile([0, 0, 9.80665], (40, 1))
    log = Log(Path("two.bin"), "made here", tuple(
        Stream(kind, name, time_s, np.tile(values, (40, 1)) if kind == "gyro" else still)
        for name, values in (("one", [0, 0, 50.0]), ("two", [0, 0, -50.0])) for kind in ("gyro", "accel")))
    config = FLIGHT_6AXIS.replace(channels=2)
    result = replay_channels(recordings_of(log, 2), config, tmp_path / "out", build=models, command=("strapdown",))
    assert result.summary["bits_differing_from_twin"] == 0
    assert result.summary["time"]["each_sample_has_its_period"]
    for channel in "01":
        assert result.summary["channels"][channel]["against_float64_reference_deg"]["max"] < LARGEST_DEG
    verilog = (tmp_path / "out" / "INS_flight_x2.v").read_text(encoding="utf-8")
    assert "--set period_input=true" in " ".join(verilog.replace("//", " ").split())


def test_one_recording_has_no_numbers_for_several_channels():
    recording = turning(np.full(20, 0.01))
    with pytest.raises(ConfigError, match=r"^INS_top_x8 takes the samples of 8 sensors, and a recording has one: "
                                           "replay it "
                                          r"with channels=1$"):
        port_inputs(recording, for_recording(THESIS_X8, recording))
