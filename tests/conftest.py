"""Fixtures of all tests: folders, and models that are built once."""

import gc
from functools import cache
from pathlib import Path

import pytest

from strapdown.cores import axi_core
from strapdown.cores import make_core as make_new_core
from strapdown.cores import make_module as make_new_module
from strapdown.export import verilog_text, without_comments, write
from strapdown.kernel import engine, stream
from strapdown_sim.cache import Cache
from strapdown_sim.drivers.bus import BusInterface, BusModel
from strapdown_sim.drivers.toolchain import SimulatorMissingError

from .schedules import searched_once

ROOT = Path(__file__).parents[1]
GENERATORS = pytest.StashKey[dict]()


def pytest_collection_finish():
    """Collect garbage seldom: circuits are graphs of many small objects, and each collection searches all of them.
    What imports and collection made stays, and is not searched."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(500_000, 10, 10)


def pytest_collection_modifyitems(session, items):
    """Keep the state in which each module of tests has made its random generator RNG."""
    session.stash[GENERATORS] = {module: module.RNG.bit_generator.state
                                 for module in {item.module for item in items} if hasattr(module, "RNG")}


def pytest_unconfigure():
    """Let the interpreter free all objects when it ends: libraries in C++ report those that stay."""
    gc.unfreeze()


@pytest.fixture(autouse=True)
def same_random_numbers(request):
    """A test has the same random numbers, whichever tests of its module ran before it in this process."""
    state = request.session.stash[GENERATORS].get(request.module)
    if state:
        request.module.RNG.bit_generator.state = state


@pytest.fixture(scope="session")
def root():
    """Folder of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def of_this_run(request, tmp_path_factory):
    """A Cache for all processes of this run of the tests."""
    folder = tmp_path_factory.getbasetemp()
    return Cache((folder.parent if hasattr(request.config, "workerinput") else folder) / "shared")


@pytest.fixture(scope="session", autouse=True)
def schedules(of_this_run):
    """Engines search each of their schedules once in a run. Tests of a search call it directly."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "list_schedule", searched_once(engine.list_schedule, of_this_run))
        patch.setattr(stream, "modulo_schedule", searched_once(stream.modulo_schedule, of_this_run))
        yield


@pytest.fixture(scope="session")
def make_core():
    """``strapdown.cores.make_core``, which makes each core once: scheduling takes seconds."""
    return cache(make_new_core)


@pytest.fixture(scope="session")
def make_module(make_core):
    """``strapdown.cores.make_module``, which makes each module once; cores are those of ``make_core``."""
    make_assembly = cache(make_new_module)
    return lambda module, config: (make_assembly if module in config.assemblies() else make_core)(module, config)


@pytest.fixture(scope="session")
def text_of(make_module, of_this_run):
    """``strapdown.export.verilog_text`` of a module of a configuration; each is written once in a run."""
    def text(module, config):
        def make(path):
            path.write_text(verilog_text(make_module(module, config), config), encoding="utf-8")

        identity = {"module": module, "config": repr(config)}
        return of_this_run.file(identity, ".v", make).read_text(encoding="utf-8")
    return text


@pytest.fixture(scope="session")
def circuit_of(text_of):
    """``strapdown_lab.report.measure.core_circuit`` of a module of a configuration; each is written once in a run."""
    return lambda module, config: without_comments(text_of(module, config))


@pytest.fixture(scope="session")
def models():
    """Folder of compiled models; a model is built again only if its Verilog changed."""
    return ROOT / "build" / "sim" / "verilated"


@pytest.fixture(scope="session")
def make_bus(models, tmp_path_factory):
    """Makes a configuration's core behind its bus, and its BusModel; skips the test without a simulator."""
    @cache
    def make(config, **options):
        top = axi_core(config, **options)
        path = write(top, tmp_path_factory.mktemp("bus"), command="")
        try:
            return top, BusModel(path, BusInterface.of_top(top), models)
        except SimulatorMissingError as error:
            pytest.skip(str(error))
    return make


def beside_the_checkout(name):
    """A folder of ``../shared``; skips the test if it is absent."""
    folder = ROOT.parent / "shared" / name
    if not folder.is_dir():
        pytest.skip(f"There is no folder shared/{name} beside this checkout, so its recordings are not replayed.")
    return folder


@pytest.fixture(scope="session")
def shared_recordings():
    """Folder of the third-party recordings beside the project; skips the test if it is absent."""
    return beside_the_checkout("recordings")


@pytest.fixture(scope="session")
def shared_cases():
    """Folder of small recordings with known right answers beside the project; skips the test if it is absent."""
    return beside_the_checkout("cases")


@pytest.fixture(scope="session")
def shared_logs():
    """Folder of logs of several formats beside the project; skips the test if it is absent."""
    return beside_the_checkout("logs")


@pytest.fixture(scope="session")
def x_imu_recording():
    """The x-IMU recording that `make demo` fetches; skips the test if it is absent."""
    path = ROOT / "build" / "recordings" / "00033_CalInertialAndMag.csv"
    if not path.exists():
        pytest.skip("The x-IMU recording is not here: scripts/fetch_recording.py fetches it.")
    return path
