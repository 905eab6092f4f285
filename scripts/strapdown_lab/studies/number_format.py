"""The difference between the outputs of each core and the same equations in float64, on a motion.

Attitude and quaternion cores: the recording of `make demo`. Navigation cores: the start of a flight. The script writes
docs/report/number_format.json for the product guides. It takes about a minute.
"""

import json

import numpy as np

from strapdown.cores import CONFIGS, main_module, system_of
from strapdown_lab.checkout import ROOT
from strapdown_lab.studies.airliner import start_attitude
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.errors import angle_difference, largest, quaternion_from_matrix, rms
from strapdown_sim.recordings import read_recording
from strapdown_sim.stimuli.flight import airliner

__all__ = ["accuracy_rows", "core_configs", "digest_of", "measured"]

SAMPLES = 3000
REST_S = 4
"""Rest before the flight of the navigation cores."""


def core_configs():
    """Configurations whose main module has equations, and a recording or a flight as its motion."""
    return [config for config in CONFIGS.values() if not config.assemblies()]


def motion(config, system):
    """Inputs of a system by port: samples of the recording, or of the flight."""
    if "omega" in system.inputs and "f" in system.inputs:
        flight = airliner(rest_s=REST_S)
        omega, force, truth = flight.sample(config.period_s)
        count = min(SAMPLES, len(omega))
        load = np.zeros(count)
        load[0] = 1.0
        values = {"omega": omega[:count], "f": force[:count], "load": load, "align": 0.0,
                  "altitude": truth.height_m[:count], "start_v": np.zeros(3),
                  "place": (flight.latitude_deg, flight.longitude_deg), "start_h": flight.height_m,
                  "start_q": quaternion_from_matrix(start_attitude(flight).T)}
    else:
        recording = read_recording(ROOT / "build" / "recordings" / "00033_CalInertialAndMag.csv")
        part = slice(SAMPLES)
        a, m, g = recording.accel[part], np.asarray(recording.mag)[part], recording.gyro_deg_s[part]
        values = {"a": a, "m": m, "g": g, "omega": np.radians(g),
                  "load": 0.0, "start": (1.0, 0.0, 0.0, 0.0), **config.constant_inputs()}
    return system.bind(**{name: values[name] for name in system.inputs})


def measured(config):
    """Largest and RMS difference of each group of outputs, by the kernel's name, with its meaning."""
    system = system_of(main_module(config), config)
    inputs = motion(config, system)
    (twin, _), (truth, _) = system.run(config.engine_pool, inputs), system.run_float64(inputs)
    twin, truth = system.read(twin), system.read(truth)
    rows = {}
    for name in system.outputs:
        meaning = system.meanings[name]
        difference = (angle_difference if "degrees" in meaning else np.subtract)(twin[name].astype(float), truth[name])
        rows[name] = {"meaning": meaning, "max": largest(difference), "rms": rms(difference)}
    return {"samples": len(next(iter(inputs.values()))), "equations_sha256": digest_of(config), "outputs": rows}


def digest_of(config):
    """Digest of the equations of a configuration."""
    return equations_digest(system_of(main_module(config), config), config.engine_pool)


def accuracy_rows(result, config):
    """Rows of the table in the product guide: quantity, largest and RMS difference."""
    outputs = result[config.name]["outputs"]
    return [[f"`{name}`: {row['meaning']}", f"{row['max']:.1e}", f"{row['rms']:.1e}"]
            for name, row in outputs.items()]


def main():
    """Measure, and write the JSON file."""
    result = {config.name: measured(config) for config in core_configs()}
    (ROOT / "docs" / "report" / "number_format.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
