"""Runs a recording through a generated core, compares the outputs with the reference, and draws them."""

import csv
import json
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from strapdown.config import Config, ConfigError
from strapdown.cores import main_module, make_core, system_of
from strapdown.export import write_core
from strapdown.files import written_together

from .bag import require_rosbags, write_bag
from .curves import ESTIMATE, HARDWARE, REFERENCE
from .drivers.core import CoreModel
from .drivers.stream import StreamModel
from .drivers.toolchain import compiler, verilator_root
from .drivers.verilated import Waves
from .errors import (
    angle_difference,
    attitude_errors,
    conjugate,
    match_reference,
    multiply,
    quaternion_from_matrix,
    rotation_angle,
    spread,
)
from .external import with_external_acceleration
from .magnetometer import field_facts
from .navigation import (
    exact_attitude,
    has_attitude,
    navigated_attitude,
    navigation_inputs,
    position_beside,
    start_of,
    track_picture,
    velocity_beside,
)
from .page import Curve, Panel, require_plotly, write_page
from .picture import attitude_picture, outputs_picture
from .recordings import Recording, RecordingError
from .reference.attitude import euler_angles, matrix_from_quaternion
from .reference.flight import FRAME_QUATERNIONS
from .rerun_log import require_rerun, write_rerun
from .sensors import in_body
from .truth import REFERENCES

__all__ = ["Replay", "build_model", "for_recording", "port_inputs", "refusal", "replay", "replay_channels",
           "replay_recordings", "replayed_module", "write_attitude"]


@dataclass(frozen=True)
class Replay:
    """Result of a replay.

    Attributes
    ----------
    outputs : dict
        The circuit's outputs by the kernel's names, as from ``System.read``.
    summary : dict
        Contents of ``summary.json``.
    quaternion : ndarray, shape (N, 4), or None
        Sensor to the configuration's navigation frame, scalar first, of the circuit's matrix.
    angles : ndarray, shape (N, 3), or None
        The circuit's roll, pitch and yaw in degrees.
    panels : tuple of Panel
        Curves of the run for a page.
    recorded : ndarray, shape (N, 4), or None
        The log's own attitude in the same frame, NaN where it has none.
    """

    outputs: dict
    summary: dict
    quaternion: np.ndarray | None = None
    angles: np.ndarray | None = None
    panels: tuple[Panel, ...] = ()
    recorded: np.ndarray | None = None


def replay(recording: Recording, config: Config, directory: str | os.PathLike, *, build: str | os.PathLike,
           command: Sequence[str], html: bool = False, bag: str | None = None,
           rerun: bool = False, waves: tuple[float, float] | None = None, external: str | None = None,
           progress: Callable[[str, int, int], object] | None = None) -> Replay:
    """Run a recording through the main module of a configuration in Verilator, from reset, and write the results.

    The core is generated for the recording's sample rate. Its inputs ``a`` (m/s^2), ``m`` (uT) and ``g``
    (deg/s), by the kernel's names, come from the recording, and so do ``period`` (s) and ``mag_valid`` in a
    configuration that can have these inputs, unless it says that it has none. ``constant_inputs`` of the configuration
    gives all others.
    The function writes the core's ``.v`` and ``.json``, ``summary.json``, and

    - for a module in REFERENCES, which has an independent float64 reference: ``attitude.csv`` (t in seconds; q from
      sensor to earth; pitch, roll, yaw in degrees) and ``attitude.png``;
    - for any other module, whose kernel in float64 is the reference: ``outputs.csv`` and ``outputs.png``;
    - if asked, ``replay.html``: one self-contained page with all curves, the status bits, and a turning attitude;
    - if asked, ``replay.rrd``: the same and, of a navigator, its track, for the Rerun viewer;
    - if asked, ``replay.vcd``: a waveform of the updates of a stretch of the recording. Each update begins at the time
      of its sample, and has a clock period of 10 ns. The time counts from the first sample, if that has a negative one.

    The files are moved into the folder after all are written. If the replay fails or is interrupted, the folder does
    not change.

    Parameters
    ----------
    recording : Recording
    config : Config
        A configuration with one channel; the recording's sample rate replaces its own.
    directory : Path
        Folder to write to.
    build : Path
        Folder for compiled models.
    command : sequence of str
        Words of the command line that makes the Verilog again, without module and sample rate; empty for none.
    html : bool
        Whether to write ``replay.html``. Needs plotly.
    bag : str or None
        A key of ``BAGS``: writes the attitude with the samples as sensor_msgs/Imu. Needs rosbags.
    rerun : bool
        Whether to write ``replay.rrd``. Needs rerun-sdk.
    waves : (float, float) or None
        Ends of the stretch of ``replay.vcd``, seconds on the clock of the recording.
    external : str or None
        "velocity": the core gets the change of the recording's velocity as its external acceleration.
    progress : callable or None
        ``progress(stage, done, total)``, called from time to time; stages are "build", "simulate", "compare".

    Returns
    -------
    Replay

    Raises: SimulatorMissingError without g++ or Verilator, MissingPlotlyError, MissingRosbagsError or MissingRerunError
    without the package for what is asked, RecordingError for a stretch of ``waves`` without samples, or with too many,
    and ConfigError for a configuration of several channels, with inputs that a recording does not have, or without an
    attitude for a bag, before any file is made; ToolError if g++ or Verilator fails; OSError if files cannot be
    written.
    """
    _check_tools(html, bag, rerun)
    progress = progress or (lambda stage, done, total: None)
    count = len(recording.time_s)
    stretch = None if waves is None else _stretch(recording, *waves)

    progress("build", 0, 1)
    module, config = replayed_module(config), for_recording(config, recording)
    facts: dict = {}
    if external:
        recording, facts = with_external_acceleration(recording, config)
        config = for_recording(config, recording)
    inputs = port_inputs(recording, config)
    core = make_core(module, config)
    system = core.system
    if bag and module not in REFERENCES and not has_attitude(system.inputs, system.outputs):
        raise ConfigError(f"{module} has no attitude, and a bag holds an attitude")
    with written_together(Path(directory)) as partial:
        verilog = write_core(core, config, partial, _command(command, module, config))
        model = CoreModel(core, verilog, build, waves=stretch is not None)
        progress("build", 1, 1)

        result = model.update(inputs, waves=None if stretch is None else _waves(partial / WAVES, recording, stretch),
                              progress=lambda done: progress("simulate", done, count))

        progress("compare", 0, 2)
        outputs, differing = system.read(result), model.differing_bits(inputs, result)
        progress("compare", 1, 2)
        bits = _status_bits(core.engine, result)
        summary = _summary(recording, config, core, count, bits, differing)
        if facts:
            summary["external_acceleration"] = facts
        if stretch is not None:
            summary["waves"] = {
                "file": WAVES, "updates": [stretch.start + 1, stretch.stop], "clock_period_ns": 10,
                "from_s": float(recording.time_s[stretch.start]), "to_s": float(recording.time_s[stretch.stop - 1]),
                "bytes": (partial / WAVES).stat().st_size}
        title = f"{recording.name}: {module}, configuration {config.name}, {recording.sample_rate_hz:g} Hz"
        if module in REFERENCES:
            truth = _truth(module, config, recording, system)
            found = _attitude(recording, config, outputs, truth, partial, title, summary)
        else:
            found = _outputs(recording, system, result, system.run_float64(inputs)[0], partial, title, summary)
        (partial / "summary.json").write_text(json.dumps(found.summary, indent=2, allow_nan=False) + "\n",
                                              encoding="utf-8")
        _write_asked(partial, recording, config, found, title, bits, html=html, bag=bag, rerun=rerun)
    progress("compare", 2, 2)
    return found


def replay_channels(recordings: Sequence[Recording], config: Config, directory: str | os.PathLike, *,
                    build: str | os.PathLike, command: Sequence[str], html: bool = False, bag: str | None = None,
                    rerun: bool = False, progress: Callable[[str, int, int], object] | None = None) -> Replay:
    """Run recordings of several IMUs through a core for several channels, the first one in channel 0, and so on.

    Each channel gets one sample after the other in turn; channels without a recording get none. The function writes
    what ``replay`` writes, with the results of each channel, also what is asked, in a folder ``channel_0``, ....

    Parameters
    ----------
    recordings : sequence of Recording
        On one time axis, as from ``recordings_of``; at most as many as the core has channels.
    config : Config
        A configuration of several channels, whose core has an independent reference.
    directory, build, command, html, bag, rerun, progress
        See ``replay``.

    Returns
    -------
    Replay
        That of channel 0; its summary has the results of all channels.

    Raises: as ``replay``.
    """
    _check_tools(html, bag, rerun)
    progress = progress or (lambda stage, done, total: None)
    progress("build", 0, 1)
    first, lanes, count = recordings[0], len(recordings), len(recordings[0].time_s)
    module, config = main_module(config), for_recording(config, first)
    single = system_of(module, config).name.rpartition("_x")[0]
    if single not in REFERENCES:
        raise ConfigError(f"{module} has no reference for its channels: replay it with channels=1")
    core = make_core(module, config)
    system = core.system
    inputs = {port: np.stack([values[port] for values in (_bound(each, config, system) for each in recordings)],
                             axis=1).reshape(-1) for port in system.input_ports}
    with written_together(Path(directory)) as partial:
        model = StreamModel(core, write_core(core, config, partial, _command(command, module, config)), build)
        progress("build", 1, 1)
        result = model.update(np.tile(np.arange(lanes), count), inputs,
                              progress=lambda done: progress("simulate", done // lanes, count))
        progress("compare", 0, 2)
        differing = model.differing_bits(inputs, result)
        status = _status_bits(core.engine, result)
        summary = _summary(first, config, core, count * lanes, status, differing)
        summary["channels"] = {}
        replays = []
        for channel, recording in enumerate(recordings):
            folder = partial / f"channel_{channel}"
            folder.mkdir()
            rows = result["out_channel"] == channel
            outputs = system.read({port: result[port][rows] for port in system.output_ports})
            bits = {name: values[rows] for name, values in status.items()}
            own = _summary(recording, config, core, count, bits, differing)
            title = f"{recording.name}: channel {channel} of {module}, {recording.sample_rate_hz:g} Hz"
            truth = _truth(single, config, recording, system)
            found = _attitude(recording, config, outputs, truth, folder, title, own)
            _write_asked(folder, recording, config, found, title, bits, html=html, bag=bag, rerun=rerun)
            replays.append(found)
            summary["channels"][str(channel)] = {
                name: value for name, value in own.items() if name == "recording" or summary.get(name) != value}
        (partial / "summary.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    progress("compare", 2, 2)
    return replace(replays[0], summary=summary)


def _check_tools(html, bag, rerun):
    """Raises: what ``replay`` raises for programs and packages that are missing."""
    compiler()
    verilator_root()
    if html:
        require_plotly()
    if bag:
        require_rosbags()
    if rerun:
        require_rerun()


def _write_asked(folder, recording, config, found, title, bits, *, html, bag, rerun):
    """Write page, bag and recording for Rerun of a Replay, if asked; ``bits``: the status of its updates, by name."""
    frame = getattr(config, "frame", "NWU")
    if bag:
        write_bag(folder, bag, recording, found.quaternion, frame)
    shown = {"title": title, "time_s": recording.time_s, "panels": found.panels, "status": bits,
             "gaps": _bridged(recording), "frame": frame}
    if html:
        write_page(folder / "replay.html", quaternion=found.quaternion, facts=list(_facts(found.summary)), **shown)
    if rerun:
        attitudes = {name: quaternion for name, quaternion in (("hardware", found.quaternion), ("log", found.recorded))
                     if quaternion is not None}
        tracks = {}
        if recording.position is not None and "position" in found.outputs:
            tracks = {"hardware": (recording.time_s, found.outputs["position"].astype(float)),
                      "log": (recording.position.time_s, recording.position.values[:, :2])}
        write_rerun(folder / "replay.rrd", attitudes=attitudes, tracks=tracks, **shown)


def replay_recordings(recordings: Sequence[Recording], config: Config, directory: str | os.PathLike,
                      **options: Any) -> Replay:
    """What ``replay`` does for a configuration of one channel, and ``replay_channels`` for others; see there."""
    if config.channels > 1:
        return replay_channels(recordings, config, directory, **options)
    return replay(recordings[0], config, directory, **options)


def replayed_module(config: Config) -> str:
    """The main module of a configuration. Raises: ConfigError if it takes no recording."""
    module = main_module(config)
    if module in config.assemblies():
        raise ConfigError(f"{module} has other inputs than a recording: 'strapdown optical' runs it")
    return module


def build_model(recordings: Sequence[Recording], config: Config, build: str | os.PathLike) -> None:
    """Generate the core that ``replay_recordings`` needs, and compile its model if it is not in the folder ``build``.

    Raises: as ``replay``.
    """
    compiler()
    verilator_root()
    module, config = main_module(config), for_recording(config, recordings[0])
    core = make_core(module, config)
    with TemporaryDirectory() as folder:
        path = write_core(core, config, Path(folder), "")
        (StreamModel if config.channels > 1 else CoreModel)(core, path, build)


def refusal(summary: Mapping[str, Any]) -> str:
    """Why the outputs of a replay say nothing about the recording: a line, empty if there is no such reason."""
    if summary["refused_updates"] < summary["samples"]:
        return ""
    return ("all updates were refused: numbers are not finite, or too large for the core's format, so the outputs are "
            "those after reset")


def _command(command, module, config):
    """The words of a command line that makes the Verilog of a module again, quoted for a shell; empty for none."""
    if not command:
        return ""
    fields = (*(each.field for each in TIMED_INPUTS), *REPLAYED)
    inputs_set = (word for field in fields if getattr(config, field, False) for word in ("--set", f"{field}=true"))
    return shlex.join([*command, "--module", module, "--set", f"sample_rate_hz={config.sample_rate_hz!r}", *inputs_set])


WAVES = "replay.vcd"
"""Name of the waveform."""


MOST_WAVES = 2000
"""Most updates of a waveform. One of the larger cores needs half a megabyte."""


def _stretch(recording, from_s, to_s):
    """The samples between two times, as a slice. Raises: RecordingError without one, or with more than MOST_WAVES."""
    first, last = recording.time_s[[0, -1]]
    stretch = slice(*np.searchsorted(recording.time_s, [from_s, np.nextafter(to_s, np.inf)]).tolist())
    if stretch.start >= stretch.stop:
        raise RecordingError(f"{recording.name} has no sample between {from_s:g} and {to_s:g} s: choose a stretch of "
                             f"its time, {first:.6g} to {last:.6g} s")
    if stretch.stop - stretch.start > MOST_WAVES:
        raise RecordingError(f"{recording.name} has {stretch.stop - stretch.start:,} samples between {from_s:g} and "
                             f"{to_s:g} s: choose a shorter stretch, with at most {MOST_WAVES:,} samples")
    return stretch


def _waves(path, recording, stretch):
    """The waveform of the updates of a stretch, which begin at the times of their samples."""
    time_ns = np.full(len(recording.time_s), -1)
    time_ns[stretch] = np.rint(1e9 * (recording.time_s[stretch] - min(recording.time_s[0], 0.0)))
    return Waves(path, time_ns)


def _summary(recording, config, core, count, bits, differing):
    """The part of ``summary.json`` that all replays have; ``bits``: the status of ``count`` updates, by name."""
    status = {name: int(values.sum()) for name, values in bits.items()}
    summary = {
        "recording": recording.name,
        "config": config.name,
        "samples": count,
        "sample_rate_hz": recording.sample_rate_hz,
        "cycles_per_update": core.latency,
        "microseconds_per_update_at_100_mhz": core.latency / 100,
        "refused_updates": status.get("refused", 0),
        "updates_by_status": status,
        "bits_differing_from_twin": differing,
    }
    if recording.timing is not None:
        summary["time"] = _time_summary(recording.timing, "period" in _timed(recording, core.system))
    if recording.notes:
        summary["notes"] = list(recording.notes)
    if "m" in core.system.inputs and (facts := field_facts(in_body(recording, config))):
        summary["field"] = facts._asdict()
    return summary


def _truth(module, config, recording, system):
    """The outputs of the independent reference of a module, with the inputs that the system has."""
    timed = _timed(recording, system)
    arguments = {each.argument: timed[each.kernel] for each in TIMED_INPUTS if each.kernel in timed}
    return REFERENCES[module](config).run(recording.accel, _mag(recording), recording.gyro_deg_s, **arguments)


class TimedInput(NamedTuple):
    """An input beside the sensors: field of a configuration that gives it to its core, name in the kernel, part of a
    recording that feeds it, argument of the reference."""

    field: str
    kernel: str
    part: str
    argument: str


TIMED_INPUTS = (TimedInput("period_input", "period", "period_s", "period_s"),
                TimedInput("mag_valid_input", "mag_valid", "mag_new", "mag_valid"),
                TimedInput("external_input", "external", "external", "external"))

REPLAYED = ("stale_field",)
"""Further fields that are true in a replay, unless the configuration says otherwise: rows often repeat a field."""


def for_recording(config: Config, recording: Recording) -> Config:
    """The configuration with the recording's rate, and with TIMED_INPUTS and REPLAYED unless it says otherwise."""
    wanted = [each.field for each in TIMED_INPUTS if getattr(recording, each.part) is not None]
    inputs = {field: True for field in (*wanted, *REPLAYED)
              if field in type(config).model_fields and field not in config.model_fields_set}
    return config.replace(sample_rate_hz=recording.sample_rate_hz, **inputs)


def _time_summary(timing, fed):
    """Time of a recording for ``summary.json``; ``fed``: the core gets each sample's period."""
    return {"faults": timing.faults, "bridged_s": [list(ends) for ends in timing.bridged],
            "longest_gap_s": timing.longest_gap_s, "bridge_error_deg": timing.bridge_error_deg,
            "each_sample_has_its_period": fed,
            "one_rate_error_deg": 0.0 if fed else timing.one_rate_error_deg}


def port_inputs(recording: Recording, config: Config) -> dict[str, np.ndarray]:
    """Numbers of a recording for all input ports of the main module of a configuration: port to array, shape (N,).

    ``config`` is that of ``for_recording``. The inputs are those of ``replay``.

    Raises: ConfigError for a configuration of several channels, or with inputs that a recording does not have.
    """
    module = main_module(config)
    if config.channels > 1:
        raise ConfigError(f"{module} takes the samples of {config.channels} sensors, and a recording has one: "
                          "replay it with channels=1")
    return _bound(recording, config, system_of(module, config))


def _bound(recording, config, system):
    """Numbers of a recording for the input ports of a system."""
    module = system.name
    vectors = ({"a": recording.accel, "m": _mag(recording), "g": recording.gyro_deg_s} | config.constant_inputs()
               | navigation_inputs(recording, system.inputs, module) | _timed(recording, system))
    if unknown := [name for name in system.inputs if name not in vectors]:
        raise ConfigError(f"{module} has an input {unknown[0]!r}, and a recording has only a, m and g: give it a value "
                          f"in constant_inputs of {type(config).__name__}")
    return system.bind(**{name: vectors[name] for name in system.inputs})


def _timed(recording, system):
    """The parts of a recording that feed inputs of a system beside the sensors, by the kernel's names."""
    return {each.kernel: values for each in TIMED_INPUTS
            if each.kernel in system.inputs and (values := getattr(recording, each.part)) is not None}


def _mag(recording):
    """The magnetometer of a recording; zeros for one without."""
    return np.zeros_like(recording.accel) if recording.mag is None else recording.mag


def _status_bits(engine, result):
    """Maps each status bit of an engine to its values, bools of shape (N,), in the order of the port."""
    if not engine.system.status_port:
        return {}
    status = result[engine.system.status_port]
    return {name: (status >> bit & 1).astype(bool) for bit, name in enumerate(engine.status_names)}


def _attitude(recording, config, outputs, truth, directory, title, summary):
    """Attitude of a core, its float64 reference, and the reference of the recording: CSV and picture."""
    quaternion = quaternion_from_matrix(outputs["c"])
    # The core's order is pitch, roll, yaw.
    angles = outputs["angles"][:, [1, 0, 2]].astype(float)
    difference = rotation_angle(quaternion, quaternion_from_matrix(truth.c_n2b))
    summary |= {
        "frame": config.frame,
        "quaternion": "sensor to earth, scalar first",
        "against_float64_reference_deg": spread(difference),
    }
    device, panels, recorded = np.full_like(angles, np.nan), [], None
    if recording.reference is not None:
        to_frame = FRAME_QUATERNIONS[config.frame]
        match = match_reference(recording, multiply(conjugate(to_frame), quaternion))
        errors = attitude_errors(match.q_est, match.q_ref)
        summary["against_recorded_reference_deg"] = _against_reference(recording, match, errors)
        recorded = _at(match.sample, multiply(to_frame, match.q_ref), len(angles))
        pitch, roll, yaw = euler_angles(matrix_from_quaternion(recorded[match.sample]))
        device[match.sample] = np.stack([roll, pitch, yaw], axis=-1)
        panels = [_errors_panel(recording, match, errors)]

    write_attitude(directory / "attitude.csv", recording, outputs)
    model = np.stack([truth.roll, truth.pitch, truth.yaw], axis=-1)
    labels = ("hardware", "float64 reference", recording.reference.meaning if recording.reference else "")
    attitude_picture(
        directory / "attitude.png", title=title, time_s=recording.time_s, hardware=angles, reference_model=model,
        rotation=difference, bridged=_bridged(recording), device=None if recording.reference is None else device,
        labels=labels)
    turning = [Panel(f"{name} (°)", [
        *([Curve(labels[2], device[:, k], points=True, colour=ESTIMATE)] if recording.reference else []),
        Curve(labels[1], model[:, k], turns=True, colour=REFERENCE, width=4),
        Curve(labels[0], angles[:, k], turns=True, colour=HARDWARE)])
        for k, name in enumerate(("roll", "pitch", "yaw"))]
    panels = [*turning, Panel("hardware from float64 (°)", [Curve("rotation angle", difference)], logarithmic=True),
              *panels]
    if "bias" in outputs:
        panels.append(Panel("bias of the gyro (deg/s)", [
            Curve(f"bias {axis}", outputs["bias"][:, k]) for k, axis in enumerate("xyz")]))
    return Replay(outputs, summary, quaternion, angles, tuple(panels), recorded)


def write_attitude(path: Path, recording: Recording, outputs: dict) -> None:
    """Write the file attitude.csv of a replay: ``outputs`` of a core with the circuit's matrix and angles, by name."""
    quaternion, angles = quaternion_from_matrix(outputs["c"]), outputs["angles"].astype(float)
    columns = {f"q{index}": (quaternion[:, index], 9) for index in range(4)}
    columns |= {name: (angles[:, index], 6) for index, name in enumerate(("pitch", "roll", "yaw"))}
    _write_csv(path, recording.time_s, columns)


def _against_reference(recording, match, errors):
    """Errors against the recording's reference, for ``summary.json``."""
    return {"reference": recording.reference.meaning, "samples": len(match.sample),
            "heading_known": not match.turned,
            **{f"{name}_rms": spread(getattr(errors, name))["rms"] for name in errors._fields},
            "total_median": float(np.median(errors.total)) if len(match.sample) else None, **_with_constant(match)}


def _with_constant(match):
    """Errors against the reference with the heading that it gives, and the constant heading between the two, degrees.

    The constant is positive where the core's heading is anticlockwise of the reference's, seen from above.
    """
    errors = attitude_errors(match.q_est, match.q_given)
    w, _, _, z = multiply(match.q_ref, conjugate(match.q_given)).T
    return {"total_rms_with_constant_heading": spread(errors.total)["rms"],
            "heading_rms_with_constant_heading": spread(errors.heading)["rms"],
            "constant_heading_deg": float(angle_difference(2 * np.degrees(np.arctan2(z[0], w[0])), 0.0))
            if len(match.sample) else None}


def _outputs(recording, system, result, truth, directory, title, summary):
    """All outputs of a core, those of its kernel in float64, and what the log says: CSV and picture."""
    turns = {port: "degrees" in meaning for port, meaning in system.port_meanings.items()}
    differences = {port: np.abs(angle_difference(result[port], truth[port]) if turns[port]
                                else result[port] - truth[port]) for port in system.output_ports}
    summary["against_float64_kernel"] = {
        port: spread(difference) for port, difference in differences.items()}
    _write_csv(directory / "outputs.csv", recording.time_s,
               {port.removeprefix("out_"): (result[port], 9) for port in system.output_ports})
    outputs = system.read(result)
    quaternion, attitude, recorded, below = None, None, {}, []
    if has_attitude(system.inputs, outputs):
        quaternion = navigated_attitude(outputs)
        attitude, recorded, below = _navigated(recording, system, outputs, quaternion, directory, title, summary)
    outputs_picture(
        directory / "outputs.png", title=title, time_s=recording.time_s,
        hardware={port: result[port] for port in system.output_ports}, reference_model=truth,
        meanings=system.port_meanings, recorded=recorded, bridged=_bridged(recording))
    panels = [Panel(port.removeprefix("out_"), [
        *([Curve("the log's own", recorded[port], points=True, colour=ESTIMATE)] if port in recorded else []),
        Curve("kernel in float64", truth[port], turns=turns[port], colour=REFERENCE, width=4),
        Curve("hardware", result[port], turns=turns[port], colour=HARDWARE)], note=system.port_meanings[port])
        for port in system.output_ports]
    return Replay(outputs, summary, quaternion, panels=(*panels, *below), recorded=attitude)


def _navigated(recording, system, outputs, quaternion, directory, title, summary):
    """Compare an attitude, velocity and position with those of the log, for the summary; draw the track.

    Returns: the log's attitude, shape (N, 4), or None; output ports to what the log says, shape (N,); NaN where it says
    nothing; panels of the differences.
    """
    count, attitude = len(recording.time_s), None
    recorded: dict[str, np.ndarray] = {}
    panels = []

    def beside(name, sample, values):
        """What the log says for the ports of an output."""
        ports = [system.outputs[name]] if isinstance(system.outputs[name], str) else system.outputs[name]
        recorded.update((port, _at(sample, own, count)) for port, own in zip(ports, values, strict=True))

    def difference(name, unit, track):
        panels.append(Panel(f"{name}: difference ({unit})", [
            Curve(f"{part}, from the log's {name}", _at(track.sample, getattr(track, part), count), points=True)
            for part in ("horizontal", "vertical")]))
        return track.summary()

    start = start_of(recording)
    summary["start"] = start.source
    if "e" in outputs:
        summary["against_exact_rotations_deg"] = spread(rotation_angle(quaternion, exact_attitude(recording)))
    if recording.reference is not None:
        match = match_reference(recording, quaternion, shared_heading=start.recorded)
        errors = attitude_errors(match.q_est, match.q_ref)
        summary["against_recorded_reference_deg"] = _against_reference(recording, match, errors)
        panels.append(_errors_panel(recording, match, errors))
        attitude = _at(match.sample, match.q_ref, count)
        if "attitude" in outputs:
            # Heading is clockwise; the angles of FLU and NWU have the other sign for pitch and yaw.
            pitch, roll, yaw = euler_angles(matrix_from_quaternion(match.q_ref))
            beside("attitude", match.sample, (-pitch, roll, -yaw % 360))
        else:
            # Both signs are the same attitude.
            beside("e", match.sample, (np.copysign(1, np.vecdot(match.q_ref, match.q_est))[:, None] * match.q_ref).T)
    if "velocity" in outputs and recording.velocity is not None:
        track = velocity_beside(recording, outputs["velocity"].astype(float))
        summary["against_recorded_velocity_m_s"] = difference("velocity", "m/s", track)
        beside("velocity", track.sample, track.recorded.T)
    if "position" in outputs:
        (latitude, longitude), height = outputs["position"].astype(float).T, outputs["height"].astype(float)
        track = position_beside(recording, latitude, longitude, height)
        summary["against_recorded_position_m"] = difference("position", "m", track)
        beside("position", track.sample, track.recorded[:, :2].T)
        beside("height", track.sample, track.recorded[:, 2:].T)
        track_picture(directory / "track.png", title=title, recording=recording, latitude=latitude, longitude=longitude)
    return attitude, recorded, panels


def _errors_panel(recording, match, errors):
    """Errors against the recording's reference."""
    return Panel("difference (°)", [
        Curve(f"{name}, from {recording.reference.meaning}",
              _at(match.sample, getattr(errors, name), len(recording.time_s)), points=True)
        for name in errors._fields])


def _at(places, values, count):
    """Values at some samples of ``count``, along the first axis; NaN at the others."""
    whole = np.full((count, *np.shape(values)[1:]), np.nan)
    whole[places] = values
    return whole


def _facts(summary):
    """Rows of the table on the page of a run."""
    yield "recording", summary["recording"]
    yield "configuration", summary["config"]
    yield "samples", f"{summary['samples']:,} at {summary['sample_rate_hz']:g} Hz"
    yield "cycles per update", f"{summary['cycles_per_update']}"
    yield "refused updates", f"{summary['refused_updates']:,}"
    yield "bits that differ from the twin", f"{summary['bits_differing_from_twin']:,}"

    def figure(value, form, unit):
        return "–" if value is None else f"{value:{form}}{unit}"

    if difference := summary.get("against_float64_reference_deg"):
        yield "largest angle from float64", figure(difference["max"], ".6f", "°")
    if recorded := summary.get("against_recorded_reference_deg"):
        yield f"from {recorded['reference']}, RMS", ", ".join(
            f"{name} {figure(recorded[f'{name}_rms'], '.2f', '°')}" for name in ("total", "inclination"))
    for title, unit, name in ("position", " m", "position_m"), ("velocity", " m/s", "velocity_m_s"):
        if track := summary.get(f"against_recorded_{name}"):
            yield f"from the log's {title}, at most", ", ".join(
                f"{part} {figure(track[part]['max'], '.2f', unit)}" for part in ("horizontal", "vertical"))
    for kind, number in summary.get("time", {}).get("faults", {}).items():
        yield kind, f"{number:,}"


def _bridged(recording):
    return () if recording.timing is None else recording.timing.bridged


ROWS_AT_ONCE = 10_000
"""Rows whose texts are in memory at once."""


def _write_csv(path, time_s, columns):
    """Write a CSV file: t in seconds, then ``columns``, which maps names to (numbers, decimals)."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("t", *columns))
        for first in range(0, len(time_s), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            texts = [[f"{value:.{decimals}f}" for value in values[rows].tolist()]
                     for values, decimals in ((time_s, 6), *columns.values())]
            writer.writerows(zip(*texts, strict=True))
