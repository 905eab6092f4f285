"""Driver for PYNQ: a core in an overlay, by registers, or by streams and a DMA engine. See docs/software.md.

A board needs this file and ``device.py``: ``pip install --no-deps strapdown`` brings them without the generator.
"""

from collections.abc import Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pynq import DefaultIP, allocate

from .device import Driver, DriverError, from_words, to_words

__all__ = ["Attitude", "DriverError"]

CORES = ("INS_top_axi", "INS_flight_axi", "QUAT_direct_axi", "SINS_top_axi")
WORD_BYTES = 4


class Attitude(DefaultIP, Driver):
    """A core in an overlay: ``overlay.core`` is one, if this module is imported. First call ``open`` with its map.

    A core of your own, or one with channels: ``class Mine(Attitude): bindto = ["strapdown:navigation:NAME:1.0"]``.
    """

    bindto = [f"strapdown:navigation:{name}:1.0" for name in CORES]  # noqa: RUF012  the way of PYNQ

    def replay(self, recording: Mapping[str, ArrayLike], dma: Any) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """A whole recording from the reset state, by DMA, in as few transfers as the engine permits.

        Parameters
        ----------
        recording : mapping
            Each port of a sample to its numbers, shape (N,); a file of ``numpy.savez`` is one.
        dma : pynq.lib.dma.DMA
            An engine without scatter-gather, between memory and both streams of the core.

        Returns
        -------
        outputs : dict
            Each output port to its numbers, shape (N,). A refused update repeats the numbers of the one before.
        status : ndarray of uint32, shape (N,)
            The status bits; ``status_names`` names them.

        Raises: DriverError if the core has no streams or several channels, or if a sample or an answer is longer than
        the longest transfer; RuntimeError if the engine reports an error; KeyError for a port that is missing.
        """
        if not self._streams:
            raise DriverError(f"{self.map.NAME} was generated without streams")
        if "CHANNEL" in self.map.REGISTERS:
            raise DriverError(f"{self.map.NAME} has several channels, which this DMA engine cannot tell apart")
        samples = to_words(self.map.SAMPLES, recording)
        answers = np.empty((len(samples), sum(port[2] for port in self.map.OUTPUTS) + 1), "<u4")
        bytes_each = WORD_BYTES * max(samples.shape[1], answers.shape[1])
        most = dma.buffer_max_size // bytes_each
        if not most:
            raise DriverError(f"the DMA engine moves at most {dma.buffer_max_size} bytes at once, and a sample or an "
                              f"answer has {bytes_each}: raise its c_sg_length_width")
        self.reset()
        with self._streaming():
            for first in range(0, len(samples), most):
                block = slice(first, first + most)
                answers[block] = self._transfer(samples[block], answers[block].shape, dma)
        return from_words(self.map.OUTPUTS, answers[:, :-1]), answers[:, -1]

    @contextmanager
    def _streaming(self):
        """Context manager: the core takes its samples from the stream."""
        self._put("CONTROL", self._mask("CONTROL", "stream"))
        try:
            yield
        finally:
            self._put("CONTROL", 0)

    def _transfer(self, samples, shape, dma):
        """Answers to samples, in one transfer each way. The engine ends the packet, and the core ends its answer."""
        sent = allocate(samples.shape, "u4", target=self.device)
        received = allocate(shape, "u4", target=self.device)
        sent[:] = samples
        dma.recvchannel.transfer(received)
        dma.sendchannel.transfer(sent)
        dma.sendchannel.wait()
        dma.recvchannel.wait()
        return np.array(received)
