"""Runs in the environment of PYNQ: the class for the board, and PYNQ's own DMA class, on a device that is the circuit.

    python board.py TASK FOLDER ARGUMENTS...

FOLDER has recording.npz, the core's map, and model.json: the command line of the model behind its pipe. Registers of
the core go to the model. Registers of the DMA engine are those of PG021 without scatter-gather; the engine moves words
between the streams of the model and a memory that the processor sees through a cache. Results go to FOLDER.
"""

import contextlib
import ctypes
import importlib.util
import io
import json
import struct
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pynq
import pynq.lib.dma
import pynq.overlay
from pynq import Device
from pynq.buffer import PynqBuffer

from strapdown.device import to_words
from strapdown.pynq import Attitude

CORE, DMA = 0x43C0_0000, 0x4040_0000
CORE_BYTES = 4096
REQUEST, ANSWER = struct.Struct("<BBHI"), struct.Struct("<II")
RUN, RESET = 1, 4
HALTED, IDLE, INTERNAL_ERROR = 1, 2, 0x10
PATIENCE = 5000
"""Cycles in which an answer must come."""


class Channel:
    """One side of a DMA engine."""

    def __init__(self):
        self.control, self.status, self.address, self.length, self.moved = 0, HALTED, 0, 0, 0

    @property
    def active(self):
        """A transfer runs."""
        return not self.status & (HALTED | IDLE) and self.length > 0


class Board(Device):
    """A device with a core and a DMA engine, in PYNQ's terms: its registers are read and written by functions."""

    def __init__(self, command, length_width):
        super().__init__("model")
        self.capabilities = {"REGISTER_RW": True}
        self.transfers = []
        self._length_mask = (1 << length_width) - 1
        self._memory, self._next = {}, 0x1000_0000
        self._channels = Channel(), Channel()
        self._model = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def close(self):
        """End the model."""
        self._model.stdin.close()
        assert self._model.wait() == 0

    # The bus.

    def _transact(self, *requests):
        """Answers of the model to requests: operation, half-word, word."""
        self._model.stdin.write(b"".join(REQUEST.pack(ord(kind), 0xF, half, word) for kind, half, word in requests))
        self._model.stdin.flush()
        data = self._model.stdout.read(ANSWER.size * len(requests))
        return list(ANSWER.iter_unpack(data))

    def read_registers(self, address, length):
        """Bytes of registers."""
        assert (address % 4, length) == (0, 4)
        if CORE <= address < CORE + CORE_BYTES:
            (response, word), = self._transact(("R", address - CORE, 0))
            assert response == 0, f"bus error at {address:#x}"
        else:
            word = self._read_engine(address - DMA)
        return word.to_bytes(4, "little")

    def write_registers(self, address, data):
        """Write bytes to registers."""
        assert (address % 4, len(data)) == (0, 4)
        word = int.from_bytes(bytes(data), "little")
        if CORE <= address < CORE + CORE_BYTES:
            (response, _), = self._transact(("W", address - CORE, word))
            assert response == 0, f"bus error at {address:#x}"
        else:
            self._write_engine(address - DMA, word)

    # The memory, and the cache of the processor before it.

    def allocate(self, shape, dtype, **options):
        """A buffer, as ``pynq.allocate`` makes it."""
        buffer = PynqBuffer(shape, dtype=dtype, device=self, device_address=self._next, bo=self._next, coherent=False)
        self._memory[self._next] = bytearray(buffer.nbytes)
        self._next += buffer.nbytes + 0xFFF & ~0xFFF
        return buffer

    def flush(self, bo, offset, address, size):
        """From the cache to the memory."""
        self._memory[bo][offset:offset + size] = ctypes.string_at(address, size)

    def invalidate(self, bo, offset, address, size):
        """From the memory to the cache."""
        ctypes.memmove(address, bytes(self._memory[bo][offset:offset + size]), size)

    # The engine.

    def _read_engine(self, offset):
        channel = self._channels[offset >= 0x30]
        register = offset % 0x30
        if register == 0x04:
            self._move()
        return {0x00: channel.control, 0x04: channel.status, 0x28: channel.moved}[register]

    def _write_engine(self, offset, word):
        receives = offset >= 0x30
        channel = self._channels[receives]
        register = offset % 0x30
        if register == 0x00:
            assert not word & RESET
            channel.control = word
            channel.status = channel.status & ~HALTED if word & RUN else channel.status | HALTED
        elif register == 0x18:
            channel.address = word
        elif register == 0x1C:
            assert word == 0
        elif register == 0x28:
            assert not channel.status & HALTED
            # Higher bits do not exist.
            channel.length = word & self._length_mask
            channel.moved = 0
            channel.status = channel.status & ~IDLE if channel.length else channel.status | INTERNAL_ERROR
            self.transfers.append(("S2MM" if receives else "MM2S", channel.length))
            if not receives and channel.length:
                memory = bytes(self._memory[channel.address][:channel.length])
                words = struct.unpack(f"<{channel.length // 4}I", memory)
                last = len(words) - 1
                self._transact(*(("S", int(index == last), word) for index, word in enumerate(words)))
        else:
            raise AssertionError(f"no register at {offset:#x}")

    def _move(self):
        """Let the streams run, and end the transfers that are complete."""
        sender, receiver = self._channels
        if receiver.active:
            count = (receiver.length - receiver.moved) // 4
            found = self._transact(("G", 0, PATIENCE))
            if found[0][0] & 1:
                found += self._transact(*[("G", 0, PATIENCE)] * (min(count, 1000) - 1))
            for code, word in found:
                if not code & 1:
                    break
                place = slice(receiver.moved, receiver.moved + 4)
                self._memory[receiver.address][place] = word.to_bytes(4, "little")
                receiver.moved += 4
                if code & 2:
                    receiver.status |= IDLE
                    break
            if receiver.active and receiver.moved == receiver.length:
                # The packet is longer than the buffer.
                receiver.status |= INTERNAL_ERROR
        (code, _), = self._transact(("N", 0, 1))
        if sender.active and not code >> 1:
            sender.moved = sender.length
            sender.status |= IDLE


def engine(board, length_width):
    """PYNQ's own DMA class on the engine."""
    parameters = {"c_include_sg": "0", "c_sg_length_width": str(length_width), "c_include_mm2s": "1",
                  "c_include_s2mm": "1", "c_m_axi_mm2s_data_width": "32", "c_m_axi_s2mm_data_width": "32"}
    return pynq.lib.dma.DMA({"phys_addr": DMA, "addr_range": 0x1_0000, "device": board, "interrupts": {},
                             "parameters": parameters})


def core(board):
    """The class for the board, as PYNQ makes it."""
    return Attitude({"phys_addr": CORE, "addr_range": CORE_BYTES, "device": board})


def module(path):
    """A Python file as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@contextlib.contextmanager
def running(folder, length_width=14):
    """Context manager: a board, its core, its DMA engine, and the map."""
    board = Board(json.loads((folder / "model.json").read_text(encoding="utf-8")), length_width)
    (path,) = folder.glob("*_map.py")
    yield board, core(board), engine(board, length_width), module(path)
    board.close()


def save(folder, map, outputs, status, **more):
    """Write words of answers as they go through the stream."""
    words = to_words(map.OUTPUTS, outputs)
    np.savez(folder / "answers.npz", words=np.column_stack([words, status]), **more)


def by_register(folder):
    """Each sample by registers."""
    recording = dict(np.load(folder / "recording.npz"))
    with running(folder) as (_, ins, _, map):
        ins.open(map)
        found = [ins.update({port: values[index] for port, values in recording.items()})
                 for index in range(len(next(iter(recording.values()))))]
        names = ins.status_names
    status = [sum(1 << names.index(name) for name in update.status) for update in found]
    save(folder, map, {port: np.array([update.outputs[port] for update in found]) for port, *_ in map.OUTPUTS}, status,
         numbers=[update.number for update in found])


def by_dma(folder, length_width):
    """The recording by DMA."""
    with running(folder, int(length_width)) as (board, ins, dma, map):
        ins.open(map)
        outputs, status = ins.replay(np.load(folder / "recording.npz"), dma)
        save(folder, map, outputs, status, transfers=[length for kind, length in board.transfers if kind == "MM2S"])


def errors(folder):
    """Messages of errors, and what the classes are bound to."""
    recording = dict(np.load(folder / "recording.npz"))
    sample = {port: values[0] for port, values in recording.items()}
    told = {}

    def tell(name, function, *arguments, **options):
        try:
            function(*arguments, **options)
        except Exception as error:
            told[name] = f"{type(error).__name__}: {error}"

    with running(folder, 5) as (_, ins, dma, map):
        def changed(**changes):
            return types.SimpleNamespace(**vars(map) | changes)

        for name, bit in ("IDENTITY", 0), ("VERSION", 16), ("CONFIGURATION", 7):
            other = map.CONSTANTS | {name: map.CONSTANTS[name] ^ 1 << bit}
            tell(name, ins.open, changed(CONSTANTS=other))
        ins.open(changed(CONSTANTS=map.CONSTANTS | {"VERSION": map.CONSTANTS["VERSION"] + 1}))
        ins.open(map)
        tell("parameter", ins.set, kp=1.0)
        tell("channel", ins.select, 1)
        ins.select(0)
        tell("sample", ins.start, {"in_accx": 0.0})
        ins.start(sample)
        tell("busy", ins.start, sample)
        tell("late", ins.wait, 1)
        ins.wait()
        tell("dma", ins.replay, recording, dma)
        ins.map = changed(REGISTERS=map.REGISTERS | {"CHANNEL": 0})
        tell("channels", ins.replay, recording, dma)
        ins.map = changed(FIELDS=map.FIELDS | {"CONTROL": {}})
        tell("streams", ins.replay, recording, dma)
        ins.map = map
        ins.reset()
        assert ins.snapshot().number == 0
    told["bound"] = [name for name, driver in pynq.overlay._ip_drivers.items() if driver is Attitude]
    (folder / "told.json").write_text(json.dumps(told), encoding="utf-8")


def notebook(folder, path):
    """The code of a notebook, on a stand-in for the overlay."""
    cells = json.loads(Path(path).read_text(encoding="utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    sys.path.insert(0, str(folder))
    with running(folder) as (_, ins, dma, map), contextlib.chdir(folder):
        pynq.Overlay = lambda name: types.SimpleNamespace(core=ins, dma=dma, name=name)
        found, told = {}, io.StringIO()
        with contextlib.redirect_stdout(told):
            exec(code, found)
        save(folder, map, found["outputs"], found["status"], told=told.getvalue())


if __name__ == "__main__":
    task, folder, *arguments = sys.argv[1:]
    {"register": by_register, "dma": by_dma, "errors": errors, "notebook": notebook}[task](Path(folder), *arguments)
