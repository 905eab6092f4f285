"""OPT_top between sensors and serial line: runs in Verilator, and its software twin from the words of the ADCs."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from strapdown.blocks import SENSORS
from strapdown.cores import OpticalConfig, make_module
from strapdown.cores.optical_modules import capture, finder, thresholds
from strapdown.cores.optical_update import STATUS, counted, placed
from strapdown.export import verilog_text
from strapdown.link import OPTICAL_ATTITUDE, Frame, FrameDecoder

from .pins import Line, PinDriver, PinRun

__all__ = ["ANGLES", "TOP", "Inertial", "OpticalRun", "PinBench", "Spots"]

TOP = "OPT_top"
"""The module under test."""

RESET_CYCLES = 3
START = 16
"""Clock cycle in which ``in_run_en`` rises."""

ANGLES = "out_roll", "out_pitch", "out_roll_measured", "out_pitch_measured"
"""Ports of the angles."""


@dataclass(frozen=True)
class Inertial:
    """Samples of accelerometer and yaw rate, far enough apart for OPT_top to take all of them.

    Attributes
    ----------
    cycle : ndarray of int, shape (M,)
        Clock cycles, rising.
    f_b : ndarray, shape (M, 3)
        Specific force, body axes, m/s².
    yaw_rate : ndarray, shape (M,)
        Rate of the heading, rad/s.
    """

    cycle: np.ndarray
    f_b: np.ndarray
    yaw_rate: np.ndarray

    @classmethod
    def none(cls):
        """No samples."""
        return cls(np.zeros(0, int), np.zeros((0, 3)), np.zeros(0))

    @property
    def ports(self):
        """Numbers of the samples, by input port."""
        return {**{f"in_acc{axis}": self.f_b[:, index] for index, axis in enumerate("xyz")},
                "in_yaw_rate": self.yaw_rate}


@dataclass(frozen=True)
class OpticalRun:
    """A run of OPT_top: N updates.

    Attributes
    ----------
    config : OpticalConfig
    pins : PinRun
    inertial : Inertial
    calibration : dict
        Values of the calibration's input ports.
    update : int
        Cycles from the first pixel of a line, in the stream of the ADCs, to its finish.
    """

    config: OpticalConfig
    pins: PinRun
    inertial: Inertial
    calibration: dict[str, float]
    update: int

    @property
    def cycle(self):
        """Clock cycle of each finish, shape (N,)."""
        return self.pins.events["cycle"]

    @property
    def angles(self):
        """Angles by output port, degrees, float32, shape (N,)."""
        return {port: self.pins.events[port].astype(np.uint32).view(np.float32) for port in ANGLES}

    @property
    def status(self):
        """Status bits, shape (N,)."""
        return self.pins.events["out_status"].astype(int)

    def flag(self, name):
        """A status bit, by its name, as bools, shape (N,)."""
        return (self.status >> STATUS.index(name) & 1).astype(bool)

    @property
    def line(self):
        """Numbers of the lines, shape (N,)."""
        return self.pins.events["out_line"].astype(int)

    @cached_property
    def sums(self):
        """Sums of the inertial samples of each update, one added after the other, by input port: float32, shape (N,);
        and their number. A sample counts for the line whose first pixel comes after it.
        """
        place = np.searchsorted(self.cycle - self.update, self.inertial.cycle, side="right")
        used = place < len(self.cycle)
        sums = {port: np.zeros(len(self.cycle), np.float32) for port in self.inertial.ports}
        for port, total in sums.items():
            np.add.at(total, place[used], self.inertial.ports[port][used].astype(np.float32))
        return sums, np.bincount(place[used], minlength=len(self.cycle))

    @cached_property
    def light(self):
        """Pixels that the ADCs have sampled, light positive, shape (2, N, pixels)."""
        return capture(self.config, self.config.timing()).compute(self.pins.words)

    @cached_property
    def seen(self):
        """The Line of each update: a list of N pairs of roll and pitch; None where a sensor had none."""
        return [tuple(lines[number] if number >= 0 else None
                      for lines, number in zip(self.pins.lines, numbers, strict=True))
                for numbers in self.pins.line_of_event.T.tolist()]

    def frames(self):
        """The FrameDecoder that has read the serial line, and the list of its frames."""
        decoder = FrameDecoder(every=self.config.send_every)
        return decoder, [*decoder.feed(self.pins.bytes), *decoder.finish()]


@dataclass(frozen=True)
class Spots:
    """What the twin finds in N lines of one sensor.

    Attributes
    ----------
    results : dict
        Results of the SpotFinder, and ``black``, ``lo`` and ``hi`` of each line, shape (N,).
    good : ndarray of bool, shape (N,)
        The position is used.
    position : ndarray of int, shape (N,)
        Position that is used, 1/4096 pixels; -1 if there was no good one yet.
    """

    results: dict[str, np.ndarray]
    good: np.ndarray
    position: np.ndarray


class PinBench:
    """OPT_top with sensors and ADCs, Verilated.

    Parameters
    ----------
    config : OpticalConfig
    build : Path
        Folder for compiled models.
    """

    def __init__(self, config: OpticalConfig, build: str | os.PathLike) -> None:
        self.config = config
        self.core = core = make_module(TOP, config)
        self.timing = config.timing()
        # The sample's edge comes a cycle after ``sample``, and the finish is seen in the cycle before it can be read.
        self._update = core.latency - 1
        self._delay = capture(config, self.timing).latency + self._update
        self._read_out = (SENSORS[config.sensor].pixels - 1) * self.timing.slot_cycles
        self._period_ps = round(1e12 / config.clock_hz)
        self.driver = PinDriver(
            verilog_text(core, config), {TOP: core.ports}, build, sensor=config.sensor, adc=config.adc,
            adc_latency=config.adc_latency, pixels=SENSORS[config.sensor].pixels, event="out_attitude_finish",
            event_rises=True, middle="out_middle", uart="uart_tx", divisor=round(config.clock_hz / config.baud_rate),
            period_ps=self._period_ps)

    def actions(self, calibration: Mapping[str, float], inertial: Inertial) -> list[tuple[int, str, int]]:
        """Actions of a run: reset, calibration, ``in_run_en``, and samples."""
        inputs = self.driver.interface.inputs

        def bits(value):
            return int(np.float32(value).view(np.uint32))

        actions = [(0, "rst_n", 0), (RESET_CYCLES, "rst_n", 1), (START, "in_run_en", 1),
                   *((0, port, bits(value)) for port, value in calibration.items() if port in inputs)]
        if "in_acc_en" in inputs:
            for index, cycle in enumerate(inertial.cycle.tolist()):
                actions += [(cycle, "in_acc_en", 1), (cycle + 1, "in_acc_en", 0),
                            *((cycle, port, bits(values[index])) for port, values in inertial.ports.items()
                              if port in inputs)]
        return actions

    def run(self, lines: int, image: Callable[[Line], np.ndarray], *, calibration: Mapping[str, float],
            inertial: Inertial | None = None, actions: Sequence[tuple[int, str, int]] = (),
            progress: Callable[[int], object] | None = None) -> OpticalRun:
        """A run from power-up.

        Parameters
        ----------
        lines : int
            Number of line periods after which the run ends: as many updates come, without faults.
        image : callable
            Gives the pixels of a Line, 12 bits.
        calibration : dict
            Values of the calibration's input ports.
        inertial : Inertial
            No samples by default.
        actions : sequence of (int, str, int)
            Further clock cycles, inputs, and the values that they have from then on.
        progress : callable or None
            Called from time to time with the number of lines done.

        Returns: OpticalRun.
        """
        line = self.timing.line_cycles
        inertial = inertial or Inertial.none()

        def told(cycle):
            if progress:
                progress(min(cycle // line, lines))

        pins = self.driver.run([*self.actions(calibration, inertial), *actions], image, delay=self._delay,
                               cycles=self.cycles(lines), progress=told)
        return OpticalRun(self.config, pins, inertial, dict(calibration), self._update + self._read_out)

    def cycles(self, lines: int) -> int:
        """Clock cycles in which this number of lines is exposed and read, and its updates end."""
        return START + (lines + 1) * self.timing.line_cycles + self.core.latency

    def spots(self, light: np.ndarray) -> Spots:
        """The spots of consecutive lines of one sensor from reset on, by the twin; shape (N, pixels)."""
        results = thresholds(self.config).track(finder(self.config), light)
        good = (results["found"] & results["known"]).astype(bool)
        last = np.maximum.accumulate(np.where(good, np.arange(len(good)), -1))
        return Spots(results, good, np.where(last >= 0, results["position"][last], -1))

    def twin(self, run: OpticalRun) -> tuple[dict[str, np.ndarray], tuple[Spots, Spots]]:
        """The outputs of all updates by the twin, from the words of the ADCs of a run without resets.

        Returns
        -------
        outputs : dict
            Angles and the further numbers of a frame, by output port, and ``out_status``, shape (N,).
        spots : pair of Spots
        """
        engine = self.core.component.engine
        system, fmt = engine.system, engine.program.format
        spots = self.spots(run.light[0]), self.spots(run.light[1])
        count = len(run.cycle)
        inputs: dict = {port: np.full(count, value, np.float32) for port, value in run.calibration.items()
                        if port in system.input_ports}
        for name, own in zip(("roll", "pitch"), spots, strict=True):
            position, base = placed(own.position).T
            inputs |= {f"in_{name}_position": position, f"in_{name}_base": base,
                       f"in_{name}_peak": counted(own.results["peak"])}
        exposures = [(roll.closed_ps - roll.opened_ps) // self._period_ps for roll, _ in run.seen]
        inputs["in_exposure_r"] = counted(exposures)
        flags = {f"{name}_missing": ~own.good for name, own in zip(("roll", "pitch"), spots, strict=True)}
        flags |= {name: np.logical_or.reduce([own.good & (own.results[name] > 0) for own in spots])
                  for name in ("several", "saturated", "edge")}
        if "in_samples" in system.input_ports:
            # The sums count if both sensors had a good position before this line.
            before = np.logical_and.reduce([own.position >= 0 for own in spots])
            sums, number = run.sums
            counts = np.concatenate(([False], before[:-1]))
            inputs |= {port: np.where(counts, values, np.float32(0)) for port, values in sums.items()
                       if port in system.input_ports}
            inputs["in_samples"] = counted(np.where(counts, number, 0))
            flags["uncompensated"] = number == 0
        result, _ = system.run(engine.program.schedule.pool, inputs)
        flags["refused"] = result["refused"]
        status = sum(flags[name].astype(int) << bit for bit, name in enumerate(STATUS) if name in flags)
        return {port: fmt.to_bits(result[port]) for port in system.output_ports} | {"out_status": status}, spots

    def differing_bits(self, run: OpticalRun, twin: Mapping[str, np.ndarray] | None = None) -> int:
        """Number of bits of angles and status that differ from the twin, over all updates of a run without resets.

        ``twin`` is what the twin gives, if that is known.
        """
        twin = self.twin(run)[0] if twin is None else twin
        return sum(int(np.bitwise_count(run.pins.events[port].astype(np.int64) ^ twin[port].astype(np.int64)).sum())
                   for port in (*ANGLES, "out_status"))

    def frames_differing(self, frames: Sequence[Frame], twin: Mapping[str, np.ndarray]) -> int:
        """Number of frames of the serial line whose status or numbers differ from those of the twin."""
        return sum(frame.status != twin["out_status"][frame.number] or any(
            value.view(np.uint32) != twin[f"out_{quantity.name}"][frame.number]
            for quantity, value in zip(OPTICAL_ATTITUDE.quantities, frame.values, strict=True)) for frame in frames)
